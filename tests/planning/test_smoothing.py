"""Certified smoothing: no collisions, lower curvature, and degenerate grid paths."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from omnidrive.errors import InvalidInput, NoPathFound
from omnidrive.maps import OccupancyGrid, load_nav2_map, paper_map
from omnidrive.planning import SplinePath, search, smooth
from tests.examples import examples
from tests.shared_data import shared

MAPS = np.array([False, False, True])


def centres(grid, cells):
    return np.array([grid.centre(row, col) for row, col in np.asarray(cells).tolist()])


def enters(grid, path, per_cell=40):
    """Whether a dense sample of the path lies in an occupied cell, by lookup of cells.

    A point on the edge of a cell is in none: points shifted by 1e-7 cells in every diagonal
    direction must all lie in occupied cells.
    """
    count = 2 + int(per_cell * path.length / grid.resolution)
    positions = (path.poses(np.linspace(0.0, 1.0, count))[:, :2] - grid.origin) / grid.resolution
    padded = np.pad(grid.occupied, 1, constant_values=grid.walled)
    limits = np.array(padded.shape[::-1]) - 1
    inside = np.ones(count, bool)
    for off in product((-1e-7, 1e-7), repeat=2):
        col, row = (np.floor(positions + off).astype(int) + 1).clip(0, limits).T
        inside &= padded[row, col]
    return bool(inside.any())


def sampled_clearance(grid, path, per_cell=40):
    """Return the least distance in m at samples, by the exact distances of the grid."""
    count = 2 + int(per_cell * path.length / grid.resolution)
    return grid.clearance(path.poses(np.linspace(0.0, 1.0, count))[:, :2]).min()


def polygon_clearance(grid, points):
    fine = np.vstack([np.linspace(a, b, 60) for a, b in pairwise(points)])
    return grid.clearance(fine).min()


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    """Search before hypothesis draws examples, so that nothing is compiled or cached in a draw."""
    grid = OccupancyGrid(np.zeros((2, 2), bool), 1.0)
    for cut_corners in (False, True):
        search(grid, (0, 0), (1, 1), cut_corners=cut_corners)
    grid.region_size(0, 0)


@st.composite
def grid_paths(draw, cut_corners=None):
    """Draw a random map and a grid path whose ends lie anywhere in their cells."""
    occupied = draw(arrays(bool, (9, 10), elements=st.sampled_from(MAPS.tolist())))
    occupied[0, 0] = occupied[8, 9] = False
    grid = OccupancyGrid(occupied, 0.2, (-3.0, 1.0), walled=draw(st.booleans()))
    cut = draw(st.booleans()) if cut_corners is None else cut_corners
    try:
        points = centres(grid, search(grid, (0, 0), (8, 9), cut_corners=cut).cells)
    except NoPathFound:
        assume(False)
    off = draw(arrays(float, (2, 2), elements=st.floats(-0.099, 0.099)))
    points[[0, -1]] += off
    return grid, points


@st.composite
def any_angle_paths(draw):
    """Draw a path of any-angle steps in a map that is free only along it."""
    steps = draw(
        st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), min_size=1, max_size=8)
    )
    corners = np.cumsum([(20, 20), *steps], axis=0).clip(1, 38)
    occupied = np.ones((40, 40), bool)
    for a, b in pairwise(corners):
        for at in np.linspace(a, b, 400) + 0.5:
            occupied[tuple(np.floor(at).astype(int))] = False
    grid = OccupancyGrid(occupied, 1.0)
    return grid, centres(grid, corners)


# ---- collisions


@given(case=grid_paths(), clearance=st.sampled_from([0.0, 0.03, 0.07, 0.5]))
@examples(150)
def test_certified_path_enters_no_obstacle(case, clearance):
    grid, points = case
    smoothed = smooth(grid, points, clearance=clearance)
    assert not enters(grid, smoothed.path)
    assert 0.0 <= smoothed.clearance <= sampled_clearance(grid, smoothed.path) + 1e-12


@given(case=any_angle_paths(), clearance=st.sampled_from([0.0, 0.2, 0.4]))
@examples(100)
def test_any_angle_path_through_a_tunnel_is_smoothed(case, clearance):
    """The polygon touches the corners of a tunnel one cell wide."""
    grid, points = case
    smoothed = smooth(grid, points, clearance=clearance)
    assert not enters(grid, smoothed.path)


@given(case=grid_paths(False), clearance=st.floats(0.0, 0.1))
@examples(100)
def test_required_or_attainable_clearance_is_kept(case, clearance):
    grid, points = case
    smoothed = smooth(grid, points, clearance=clearance)
    available = polygon_clearance(grid, points)
    assert smoothed.clearance >= min(clearance, 0.8 * available) - 1e-8
    assert sampled_clearance(grid, smoothed.path) >= min(clearance, 0.8 * available) - 1e-8


@given(case=grid_paths(), method=st.sampled_from(["spline", "certified"]))
@examples(60)
def test_proved_clearance_holds_for_either_method(case, method):
    grid, points = case
    smoothed = smooth(grid, points, method=method)
    assert smoothed.clearance <= sampled_clearance(grid, smoothed.path) + 1e-12
    assert (smoothed.path.poses(0.0)[:2] == points[0]).all()
    assert smoothed.path.poses(1.0)[:2] == pytest.approx(points[-1], abs=1e-12)


def test_clearance_in_an_open_room_is_the_required_one():
    occupied = np.zeros((30, 30), bool)
    occupied[10:20, 12:14] = True
    grid = OccupancyGrid(occupied, 0.1)
    points = centres(grid, search(grid, (15, 2), (15, 25)).cells)
    near, far = (smooth(grid, points, clearance=m).clearance for m in (0.0, 0.04))
    assert 0.0 < near < 0.01
    assert 0.04 <= far < 0.05
    # the grid path keeps half a cell, which bounds the attainable clearance
    assert smooth(grid, points, clearance=1.0).clearance >= 0.04


# ---- curvature


def test_curvature_is_less_than_half_that_of_the_plain_spline():
    rng, ratios = np.random.default_rng(3), []
    for _ in range(40):
        grid = OccupancyGrid(rng.random((60, 60)) < 0.15, 0.1)
        grid.occupied[[0, -1], [0, -1]] = False
        try:
            points = centres(grid, search(grid, (0, 0), (59, 59)).cells)
        except NoPathFound:
            continue
        plain, ours = (smooth(grid, points, method=m).path for m in ("spline", "certified"))
        ratios.append(plain.max_curvature[0] / ours.max_curvature[1])
    assert len(ratios) > 20
    assert np.median(ratios) > 2.0


def test_clearance_has_no_effect_far_from_obstacles():
    """Results are bitwise equal: rounding rejects no move."""
    grid = OccupancyGrid(np.zeros((60, 60), bool), 0.1, walled=False)
    points = centres(grid, search(grid, (10, 10), (30, 50)).cells)
    first, *others = (
        smooth(grid, points, clearance=clearance) for clearance in (0.0, 0.013, 0.031, 0.1)
    )
    for other in others:
        assert (other.path.control_points == first.path.control_points).all()
    assert first.path.max_curvature[1] < 0.03 / grid.resolution


def test_smoothing_is_repeatable():
    grid = paper_map()
    points = centres(grid, search(grid, (4, 4), (29, 39)).cells)
    first, second = (smooth(grid, points).path.control_points for _ in range(2))
    assert (first == second).all()


def test_plain_spline_has_the_cells_as_control_points():
    grid = paper_map()
    points = centres(grid, search(grid, (4, 4), (29, 39)).cells)
    path = smooth(grid, points, method="spline").path
    assert (path.control_points[:, :2] == points).all()


def test_rotated_grid_rotates_the_path():
    flat = paper_map()
    turned = replace(flat, origin=(3.0, -2.0), yaw=0.7)
    cells = search(flat, (4, 4), (29, 39)).cells
    here, there = (smooth(grid, centres(grid, cells)) for grid in (flat, turned))
    c, s = np.cos(0.7), np.sin(0.7)
    moved = (here.path.control_points[:, :2] - flat.origin) @ [[c, s], [-s, c]] + (3.0, -2.0)
    assert there.path.control_points[:, :2] == pytest.approx(moved, abs=1e-9)
    assert there.clearance == pytest.approx(here.clearance, abs=1e-9)


# ---- degenerate grid paths

ROOM = OccupancyGrid(np.zeros((8, 8), bool), 1.0)


@pytest.mark.parametrize("method", ["spline", "certified"])
@pytest.mark.parametrize(
    "points",
    [
        [(2.5, 2.5)],
        [(2.5, 2.5), (2.5, 2.5)],
        [(2.5, 2.5)] * 6,
        [(2.1, 2.2), (2.9, 2.7)],
        [(2.5, 2.5), (3.5, 3.5)],
        [(2.5, 2.5), (3.5, 3.5), (4.5, 3.5)],
        [(0.5, 0.5), (1.5, 0.5), (1.5, 0.5), (1.5, 0.5), (2.5, 1.5)],
        [(1.5, 0.5), (6.5, 0.5), (1.5, 0.5)],
        [(0.0, 0.0), (8.0, 8.0)],
    ],
)
def test_short_paths_and_repeated_points(points, method):
    points = np.array(points)
    smoothed = smooth(ROOM, points, method=method)
    assert isinstance(smoothed.path, SplinePath)
    assert smoothed.path.poses(0.0)[:2] == pytest.approx(points[0], abs=1e-12)
    assert smoothed.path.poses(1.0)[:2] == pytest.approx(points[-1], abs=1e-12)
    assert smoothed.clearance >= -1e-2
    assert smoothed.path.clearance(ROOM)[1] >= 0.0


def test_corridor_one_cell_wide():
    occupied = np.ones((7, 9), bool)
    occupied[1, 1:8] = occupied[1:6, 7] = occupied[5, 2:8] = False
    grid = OccupancyGrid(occupied, 0.3)
    points = centres(grid, search(grid, (1, 1), (5, 2)).cells)
    smoothed = smooth(grid, points)
    assert not enters(grid, smoothed.path, 400)
    assert (
        smoothed.path.max_curvature[1]
        < 0.7 * smooth(grid, points, method="spline").path.max_curvature[0]
    )
    # four fifths of the clearance of the polygon
    assert smooth(grid, points, clearance=0.15).clearance >= 0.8 * 0.15


def test_path_between_touching_corners():
    """Diagonal moves between squares that touch in a corner: only the polygon is free."""
    occupied = ~np.eye(6, dtype=bool)
    occupied[5, 4] = False
    grid = OccupancyGrid(occupied, 1.0)
    points = centres(grid, [*((i, i) for i in range(6)), (5, 4)])
    smoothed = smooth(grid, points)
    assert not enters(grid, smoothed.path, 1000)
    assert smoothed.clearance == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(smoothed.path.control_points[:, 2]) == pytest.approx(0.75 * np.pi)


def test_path_through_the_corner_of_an_obstacle():
    """Only the polygon is free: the path stops and turns on the spot."""
    occupied = np.zeros((5, 5), bool)
    occupied[1, 2] = True
    grid = OccupancyGrid(occupied, 1.0)
    points = np.array([(0.5, 0.5), (2.0, 2.0), (4.5, 2.0)])
    smoothed = smooth(grid, points)
    assert not enters(grid, smoothed.path, 1000)
    assert smoothed.clearance == 0.0
    assert smoothed.path.max_curvature == (np.inf, np.inf)
    assert smoothed.path.length == pytest.approx(1.5 * 2**0.5 + 2.5)
    plain = smooth(grid, points, method="spline")
    assert enters(grid, plain.path, 1000)
    assert plain.clearance < 0.0


def test_start_without_line_of_sight_to_the_next_centre():
    """With corner cutting, a step from the edge of the first cell crosses the obstacle."""
    occupied = np.zeros((3, 3), bool)
    occupied[1, 0] = True
    grid = OccupancyGrid(occupied, 1.0)
    points = np.array([(0.1, 0.9), (1.5, 1.5), (1.5, 2.5)])
    smoothed = smooth(grid, points)
    assert not enters(grid, smoothed.path, 1000)
    assert (smoothed.path.control_points[0, :2] == points[0]).all()


def test_headings_follow_the_path_and_match_the_ends():
    points = np.array([(1.5, 1.5), (6.5, 1.5), (6.5, 6.5)])
    free = smooth(ROOM, points).path.control_points
    along = np.diff(free[:, :2] @ (1.0, 1j))
    assert np.exp(1j * free[1:, 2]) == pytest.approx(along / np.abs(along))
    assert free[0, 2] == free[1, 2]
    given = smooth(ROOM, points, yaws=(1.0, -1.0)).path.poses(np.array([0.0, 1.0]))[:, 2]
    assert given[0] == pytest.approx(1.0)
    assert np.cos(given[1] + 1.0) == pytest.approx(1.0)


# ---- errors


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        (np.zeros((0, 2)), {}, "at least one point"),
        ([(1.5, np.nan)], {}, "all points must be finite"),
        ([(1.5, 1.5), (5.5, 1.5)], {"clearance": -0.1}, "must be 0 m or more, got -0.1 m"),
        ([(1.5, 1.5), (5.5, 1.5)], {"clearance": np.inf}, "must be 0 m or more"),
        ([(1.5, 1.5), (9.5, 1.5)], {}, "enters an obstacle"),
        ([(1.5, 1.5), (1e9, 1.5)], {}, "1e.09 cells long"),
        ([(0.5, 4.5), (7.5, 4.5)], {}, r"enters an obstacle near \(3.5, 4.5\) m"),
    ],
)
def test_invalid_input_is_rejected(points, options, message):
    occupied = np.zeros((8, 8), bool)
    occupied[4, 4] = True
    with pytest.raises(InvalidInput, match=message):
        smooth(OccupancyGrid(occupied, 1.0), np.asarray(points, float), **options)


def test_large_map_and_large_clearance_are_fast():
    """The search for distant squares uses blocks: seconds instead of hours."""
    grid = OccupancyGrid(np.zeros((2000, 2000), bool), 1.0)
    points = np.array([(900.5, 1000.5), (1100.5, 1000.5)])
    assert smooth(grid, points, clearance=1e12).clearance == pytest.approx(899.5, abs=1.1)


# ---- real maps


def movingai(name):
    lines = shared(f"maps/movingai/{name}.map").read_text().splitlines()[4:]
    return OccupancyGrid(np.array([[c not in ".G" for c in line] for line in lines]), 1.0)


def real_maps():
    for name, radius in (
        ("depot", 0.25),
        ("tb3_sandbox", 0.15),
        ("smoothers_world", 0.25),
        ("demo_map", 0.15),
    ):
        yield load_nav2_map(shared(f"maps/nav2/{name}.yaml")).inflated(radius)
    for name in ("random-32-32-20", "maze-32-32-4", "room-64-64-8", "warehouse-10-20-10-2-1"):
        yield movingai(name)


def smooth_random_paths(grid, rng, count, **options):
    """Smooth grid paths between random free cells."""
    free = np.argwhere(~grid.occupied)
    for _ in range(count):
        (a, b), (c, d) = free[rng.integers(0, len(free), 2)].tolist()
        try:
            points = centres(grid, search(grid, (a, b), (c, d)).cells)
        except NoPathFound:
            continue
        yield points, smooth(grid, points, **options)


def check_real_maps(count):
    rng, plain, ours = np.random.default_rng(11), [], []
    for grid in real_maps():
        for points, smoothed in smooth_random_paths(grid, rng, count):
            assert not enters(grid, smoothed.path)
            assert smoothed.clearance > 0.0
            if len(points) >= 12:
                spline = smooth(grid, points, method="spline").path
                plain.append(spline.max_curvature[0] * grid.resolution)
                ours.append(smoothed.path.max_curvature[1] * grid.resolution)
    assert np.median(plain) >= 2.0 * np.median(ours)
    return len(plain)


def test_random_paths_on_real_maps():
    assert check_real_maps(8) > 40


@pytest.mark.long
def test_thousands_of_random_paths_on_real_maps():
    assert check_real_maps(600) > 3000
