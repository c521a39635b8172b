"""Occupancy grids: cells, inflation and exact distances."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import distance_transform_edt, label

from omnidrive.errors import InvalidInput, InvalidMap
from omnidrive.maps import OccupancyGrid, paper_map, paper_wall
from tests.examples import examples

small_grids = arrays(bool, (6, 8), elements=st.sampled_from([False, False, True]))


turns = st.sampled_from([0.0, 0.5, np.pi / 2, 3.0, -1.1])


def in_grid_frame(grid, x, y):
    """Transform a point from W to the axes of the grid, in m, by complex numbers."""
    turned = complex(x - grid.origin[0], y - grid.origin[1]) * np.exp(-1j * grid.yaw)
    return turned.real, turned.imag


def to_square(grid, x, y, row, col):
    """Return the distance from a point in W to the square of one cell."""
    side = grid.resolution
    u, v = in_grid_frame(grid, x, y)
    across = max(col * side - u, u - (col + 1) * side, 0.0)
    along = max(row * side - v, v - (row + 1) * side, 0.0)
    return np.hypot(across, along)


def brute_distance(grid, x, y, *, kind=True):
    """Return the distance to the nearest occupied or free square, also around the grid."""
    rows, cols = grid.occupied.shape
    return min(
        (
            to_square(grid, x, y, r, c)
            for r in range(-1, rows + 1)
            for c in range(-1, cols + 1)
            if (grid.occupied[r, c] if grid.contains(r, c) else grid.walled) == kind
        ),
        default=np.inf,
    )


@examples(100)
@given(
    occupied=small_grids,
    x=st.floats(0.0, 1.999),
    y=st.floats(0.0, 1.499),
    yaw=turns,
    walled=st.booleans(),
)
def test_clearance_is_exact(occupied, x, y, yaw, walled):
    grid = OccupancyGrid(occupied, 0.25, (4.0, -7.0), walled, yaw)
    point = complex(x, y) * np.exp(1j * yaw) + complex(4.0, -7.0)
    x, y = point.real, point.imag
    clearance = grid.clearance(np.array([[x, y]]))[0]
    expected = (
        -brute_distance(grid, x, y, kind=False)
        if grid.is_occupied(x, y)
        else brute_distance(grid, x, y)
    )
    assert clearance == pytest.approx(expected, abs=1e-12)


def test_clearance_outside_the_grid():
    occupied = np.zeros((4, 6), bool)
    occupied[1, 2] = True
    points = np.array([[0.25, -3.0], [-3.0, 0.15], [9.0, 9.0], [0.25, 0.15], [np.nan, 0.0]])
    walled, open_ = OccupancyGrid(occupied, 0.1), OccupancyGrid(occupied, 0.1, walled=False)
    far = np.hypot(8.7, 8.8)
    expected = [3.1, 3.2, far, -0.05, np.nan]
    np.testing.assert_allclose(open_.clearance(points), expected, atol=1e-12)
    expected = [-3.0, -3.0, -np.hypot(8.4, 8.6), -0.05, np.nan]
    np.testing.assert_allclose(walled.clearance(points), expected, atol=1e-12)


def test_clearance_on_empty_and_full_grids():
    points = np.array([[0.5, 0.5], [7.0, 7.0], [1e300, np.inf]])
    empty = OccupancyGrid(np.zeros((3, 3), bool), 1.0, walled=False)
    assert empty.clearance(points)[:2].tolist() == [np.inf, np.inf]
    full = OccupancyGrid(np.ones((3, 3), bool), 1.0)
    assert full.clearance(points)[:2].tolist() == [-np.inf, -np.inf]
    assert np.isnan(full.clearance(points)[2])
    assert full.clearance(np.empty((0, 2))).shape == (0,)


@examples(60)
@given(
    occupied=small_grids, radius=st.floats(0.01, 0.8) | st.sampled_from([0.125, 0.25, 0.375, 0.5]),
    yaw=turns, walled=st.booleans(),
)  # fmt: skip
def test_cell_is_free_exactly_if_the_disc_is_free(occupied, radius, yaw, walled):
    grid = OccupancyGrid(occupied, 0.25, (-1.0, 3.0), walled, yaw)
    inflated = grid.inflated(radius)
    assert (inflated.origin, inflated.walled, inflated.yaw) == (grid.origin, walled, yaw)
    for row, col in np.ndindex(occupied.shape):
        distance = brute_distance(grid, *grid.centre(row, col))
        assert inflated.occupied[row, col] == (distance < radius - 1e-9)


@pytest.mark.parametrize("density", [0.0003, 0.01, 0.2])
def test_large_grids_against_the_distance_transform_of_scipy(density):
    """A square is represented by all its points on a lattice of half cells: exact distances."""
    occupied = np.random.default_rng(7).random((230, 410)) < density
    squares = np.zeros((461, 821), bool)
    for down in range(3):
        for right in range(3):
            squares[down : down + 459 : 2, right : right + 819 : 2] |= occupied
    exact = 0.05 / 2 * distance_transform_edt(~squares)[1::2, 1::2]
    grid = OccupancyGrid(occupied, 0.05, walled=False)
    free = np.argwhere(~occupied)
    np.testing.assert_allclose(grid.clearance(grid.centres(free)), exact[~occupied], atol=1e-12)
    for radius in (0.026, 0.3, 1.0, 7.7):
        assert (grid.inflated(radius).occupied == (exact < radius - 1e-9)).all()


@examples(20)
@given(occupied=small_grids, radius=st.floats(0.01, 0.8), seed=st.integers(0, 99))
def test_overlap_inside_a_free_cell_is_at_most_half_the_diagonal(occupied, radius, seed):
    grid = OccupancyGrid(occupied, 0.25)
    points = np.random.default_rng(seed).uniform((0, 0), (2.0, 1.5), (200, 2))
    points = points[~grid.inflated(radius).occupied_at(points)]
    assert (grid.clearance(points) >= radius - 0.25 * 0.5**0.5 - 1e-12).all()


@pytest.mark.parametrize("radius", [np.nan, np.inf, -0.1])
def test_invalid_radius_is_rejected(radius):
    with pytest.raises(InvalidInput, match="finite radius"):
        paper_map().inflated(radius)


@pytest.mark.parametrize("radius", [1e-200, 1e12, 1e200])
def test_radius_sizes(radius):
    occupied = np.zeros((3, 4), bool)
    occupied[0, 0] = True
    inflated = OccupancyGrid(occupied, 0.1, walled=False).inflated(radius).occupied
    assert (inflated == (occupied if radius < 1 else True)).all()


@given(row=st.integers(-3, 9), col=st.integers(-3, 9), yaw=st.floats(-7, 7))
def test_cell_and_centre_are_inverse(row, col, yaw):
    grid = OccupancyGrid(np.zeros((6, 8), bool), 0.05, (-10.0, 4.0), yaw=yaw)
    assert grid.cell(*grid.centre(row, col)) == (row, col)
    centres = grid.centres(np.array([[row, col], [0, 0]]))
    assert centres[0] == pytest.approx(grid.centre(row, col), abs=1e-12)
    assert grid.cells_of(centres).tolist() == [[row, col], [0, 0]]


def test_pose_of_a_rotated_grid_matches_nav2():
    """Rotated by 90 degrees about its origin: columns run along y, rows along -x."""
    grid = OccupancyGrid(np.zeros((2, 3), bool), 0.5, (10.0, 20.0), yaw=np.pi / 2)
    assert grid.centre(0, 2) == pytest.approx((9.75, 21.25))
    assert grid.extent == pytest.approx((9.0, 10.0, 20.0, 21.5))
    assert grid.corners == pytest.approx(np.array([[10, 20], [10, 21.5], [9, 21.5], [9, 20]]))
    assert grid.cell(9.3, 20.2) == (1, 0)


@examples(30)
@given(occupied=small_grids, yaw=st.floats(-7, 7), seed=st.integers(0, 99))
def test_clearance_is_invariant_under_rotation(occupied, yaw, seed):
    points = np.random.default_rng(seed).uniform((-1, -1), (3, 2.5), (50, 2))
    turned = (points @ (1, 1j)) * np.exp(1j * yaw) + 2 - 1j
    turned = np.column_stack([turned.real, turned.imag])
    plain = OccupancyGrid(occupied, 0.25)
    grid = OccupancyGrid(occupied, 0.25, (2.0, -1.0), yaw=yaw)
    np.testing.assert_allclose(grid.clearance(turned), plain.clearance(points), atol=1e-12)
    away = np.abs(points / 0.25 - np.round(points / 0.25)).min(axis=1) > 1e-9
    assert (grid.occupied_at(turned) == plain.occupied_at(points))[away].all()
    left, right, bottom, top = grid.extent
    inside = grid.centres(np.argwhere(occupied | ~occupied))
    assert (inside >= (left, bottom)).all()
    assert (inside <= (right, top)).all()


def test_vectorised_lookup_matches_single_points():
    grid = paper_wall()
    points = np.random.default_rng(3).uniform(-1, 11, (300, 2))
    alone = [grid.is_occupied(x, y) for x, y in points.tolist()]
    assert grid.occupied_at(points).tolist() == alone
    assert grid.cells_of(points).tolist() == [list(grid.cell(x, y)) for x, y in points.tolist()]
    assert grid.cells_of(np.array([[1e300, -1e300]])).tolist() == [[-(2**62), 2**62]]


def test_map_of_the_paper():
    """Cell (i, j), counted from 1, is the point (j / 5, i / 5) m; the gap is two cells wide."""
    grid = paper_map()
    assert grid.occupied.shape == (50, 50)
    assert grid.centre(4, 4) == pytest.approx((1.0, 1.0))
    assert np.flatnonzero(~grid.occupied.all(axis=1)).size == 50
    assert np.flatnonzero(~grid.occupied[14]).tolist() == [23, 24]
    assert np.flatnonzero(grid.occupied[:, 0]).tolist() == list(range(10, 18))


@pytest.mark.parametrize("resolution", [0.0, -0.05, np.nan])
def test_nonpositive_resolution_is_rejected(resolution):
    with pytest.raises(InvalidMap, match="resolution must be positive"):
        OccupancyGrid(np.zeros((2, 2), bool), resolution)


def test_empty_grid_is_rejected():
    with pytest.raises(InvalidMap, match="needs a two-dimensional array of booleans"):
        OccupancyGrid(np.zeros((0, 3), bool), 0.1)


@pytest.mark.parametrize("pose", [{"origin": (0.0, np.inf)}, {"yaw": np.nan}])
def test_nonfinite_origin_is_rejected(pose):
    with pytest.raises(InvalidMap, match="origin must be finite"):
        OccupancyGrid(np.zeros((2, 2), bool), 0.1, **pose)


def test_origin_too_far_for_exact_positions_is_rejected():
    for origin in ((1e308, 0.0), (0.0, -1.1e11)):
        with pytest.raises(InvalidMap, match=r"cells of 0\.1 m from the origin of the world"):
            OccupancyGrid(np.zeros((2, 2), bool), 0.1, origin)
    grid = OccupancyGrid(np.zeros((2, 2), bool), 0.1, (5e5, 5e6))  # UTM
    assert grid.cell(*grid.centre(1, 1)) == (1, 1)


def test_any_finite_point_has_a_cell():
    grid = OccupancyGrid(np.zeros((2, 2), bool), 0.1, yaw=0.3)
    for x, y in [(1e308, 1e308), (-1.7e308, 1.7e308), (0.0, -1e300)]:
        row, col = grid.cell(x, y)
        assert not grid.contains(row, col)
        assert grid.is_occupied(x, y)
        assert grid.cells_of(np.array([[x, y]])).tolist() == [[row, col]]
        assert grid.nearest_free(x, y)[1] > 1e299


@examples(100)
@given(occupied=small_grids, x=st.floats(-3, 5), y=st.floats(-3, 5), yaw=turns)
def test_nearest_free_cell(occupied, x, y, yaw):
    grid = OccupancyGrid(occupied, 0.25, (1.0, 2.0), yaw=yaw)
    free = np.argwhere(~occupied)
    found = grid.nearest_free(x, y)
    if len(free) == 0:
        assert found is None
        return
    cell, distance = found
    assert not occupied[cell]
    centres = np.array([grid.centre(r, c) for r, c in free.tolist()])
    assert distance == pytest.approx(np.hypot(*(centres - (x, y)).T).min(), abs=1e-12)
    assert distance == pytest.approx(np.hypot(*np.subtract(grid.centre(*cell), (x, y))))


def test_nearest_free_cell_of_a_distant_point():
    occupied = np.ones((30, 40), bool)
    occupied[3, 39] = False
    grid = OccupancyGrid(occupied, 0.1)
    assert grid.nearest_free(-1e250, 1e250)[0] == (3, 39)
    assert grid.nearest_free(1e5, 0.0)[1] == pytest.approx(1e5 - 3.95)


@pytest.mark.parametrize("shape", [(2_000_000, 2), (2, 2_000_000)])
@pytest.mark.parametrize("end", [None, 0, -1])
def test_nearest_free_cell_of_a_long_map(shape, end):
    """Linear in the cells; quadratic time would be hours."""
    occupied = np.ones(shape, bool)
    if end is not None:
        occupied[end, end] = False
    grid = OccupancyGrid(occupied, 1.0)
    found = grid.nearest_free(1.5, 1.5)
    if end is None:
        assert found is None
    else:
        assert found[0] == tuple(n + end if end else 0 for n in shape)


@pytest.mark.long
def test_nearest_free_cell_of_a_long_map_is_found_soon():
    """In a process that can be ended: quadratic time would be hours."""
    code = (
        "import numpy as np; from omnidrive.maps import OccupancyGrid; "
        "print(OccupancyGrid(np.ones((2_000_000, 2), bool), 1.0).nearest_free(1.5, 1.5))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout == "None\n"


@pytest.mark.parametrize(("cut_corners", "sizes"), [(False, [3, 8, 2]), (True, [13, 13, 13])])
def test_region_size(cut_corners, sizes):
    rows = ["..#..", ".#..#", "##.#.", "...#."]
    grid = OccupancyGrid(np.array([[c == "#" for c in line] for line in rows]), 1.0)
    for cell, size in zip([(0, 0), (0, 3), (3, 4)], sizes, strict=True):
        assert grid.region_size(*cell, cut_corners=cut_corners) == size
    assert grid.region_size(0, 2) == grid.region_size(9, 9) == 0


@examples(60)
@given(occupied=small_grids, row=st.integers(0, 5), col=st.integers(0, 7), cut=st.booleans())
def test_region_size_matches_the_labels_of_scipy(occupied, row, col, cut):
    regions, _ = label(~occupied, np.ones((3, 3)) if cut else None)
    expected = 0 if occupied[row, col] else np.count_nonzero(regions == regions[row, col])
    assert OccupancyGrid(occupied, 1.0).region_size(row, col, cut_corners=cut) == expected


@examples(30)
@given(
    occupied=small_grids, x=st.floats(-1, 1), y=st.floats(-1, 1), side=st.floats(0.05, 0.5),
    yaw=turns,
)  # fmt: skip
def test_occupied_on_the_cells_of_another_grid(occupied, x, y, side, yaw):
    here = OccupancyGrid(occupied, 0.25, (0.3, 0.1), yaw=0.4)
    other = OccupancyGrid(np.zeros((5, 7), bool), side, (x, y), yaw=yaw)
    found = here.occupied_on(other)
    for row in range(5):
        for col in range(7):
            assert found[row, col] == here.is_occupied(*other.centre(row, col))


def test_wall_of_the_paper_lies_inside_its_inflation():
    """A robot of 0.75 m at the centre of a free cell at most touches the wall."""
    wall, inflated = paper_wall(), paper_map()
    assert (inflated.occupied_on(wall) | ~wall.occupied).all()
    rows, cols = np.nonzero(~inflated.occupied)
    inside = [inflated.centre(r, c) for r, c in zip(rows.tolist(), cols.tolist(), strict=True)]
    inner = np.array([p for p in inside if 1.0 < p[0] < 9.0 and 1.0 < p[1] < 9.0])
    assert wall.clearance(inner).min() >= 0.75 - 1e-12
    left, right, bottom, top = wall.extent
    assert (left, right, bottom, top) == pytest.approx(inflated.extent)
    assert wall.is_occupied(3.9, 3.0)
    assert not wall.is_occupied(4.1, 3.0)


def test_occupied_on_equal_frames_is_a_copy():
    occupied = np.random.default_rng(5).random((7, 9)) < 0.4
    grid = OccupancyGrid(occupied, 0.3, (1.0, -2.0), yaw=0.4)
    other = OccupancyGrid(~occupied, 0.3, (1.0, -2.0), yaw=0.4)
    moved = OccupancyGrid(~occupied, 0.3, (1.0 + 1e-9, -2.0), yaw=0.4)
    for frame in (other, moved):
        found = grid.occupied_on(frame)
        np.testing.assert_array_equal(found, occupied)
        assert found is not grid.occupied
