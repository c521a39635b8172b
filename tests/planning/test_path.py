"""Geometry of spline paths: bounds against dense samples and analytic values."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import BSpline

from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.planning.clearance import Obstacles, piece_clearances
from omnidrive.planning.pieces import pieces
from tests.examples import examples

MOVES = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
ANYWHERE = st.floats(-3.0, 9.0).map(lambda x: round(x, 3))


def spline(points):
    points = np.asarray(points, float)
    return SplinePath(np.column_stack([points, np.zeros(len(points))]))


def control_points(least=4, most=12):
    return st.integers(least, most).flatmap(lambda n: arrays(float, (n, 2), elements=ANYWHERE))


def samples(path, count=4001):
    u = np.linspace(0.0, 1.0, count)
    return u, path.poses(u)[:, :2]


# ---- the curve


@given(points=control_points())
@examples(60)
def test_piece_lies_in_the_hull_of_four_control_points(points):
    """In every direction a piece extends at most to the farthest of its control points."""
    path, count = spline(points), len(points) - 3
    directions = np.stack([np.cos(np.arange(24) / 3.8), np.sin(np.arange(24) / 3.8)])
    for j in range(count):
        curve = path.poses(np.linspace(j / count, (j + 1) / count, 50))[:, :2]
        reach, limit = (
            (curve @ directions).max(axis=0),
            (points[j : j + 4] @ directions).max(axis=0),
        )
        assert (reach <= limit + 1e-9).all()


def test_three_coincident_control_points_make_a_corner():
    path = spline([(0, 0), (1, 0), (2, 0), (2, 0), (2, 0), (2, 1), (2, 2)])
    _, curve = samples(path)
    assert np.minimum(np.abs(curve[:, 1]), np.abs(curve[:, 0] - 2.0)).max() < 1e-12
    assert path.max_curvature == (np.inf, np.inf)
    assert path.curvature(0.5) == np.inf
    assert path.length == pytest.approx(4.0, rel=1e-6)


# ---- length


@given(points=control_points())
@examples(60)
def test_length_bounds_contain_a_fine_polyline(points):
    path = spline(points)
    _, curve = samples(path, 60_001)
    fine = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
    shortest, longest = path.length_bounds
    assert shortest <= path.length <= longest
    assert fine <= longest
    assert fine >= shortest * (1.0 - 1e-5) - 1e-9  # the polyline is slightly shorter than the curve
    assert longest - shortest <= 1.01e-6 * longest + 1e-12


def test_length_of_a_path_that_reverses():
    """Back and forth along a line: the speed has a kink, which limits Simpson's rule."""
    path = spline([(0, 0), (5, 0), (5, 0), (1, 0)])
    travelled = np.abs(np.diff(path.poses(np.linspace(0.0, 1.0, 200_001))[:, 0])).sum()
    assert path.length_bounds[0] - 1e-9 <= travelled <= path.length_bounds[1]
    assert path.length == pytest.approx(travelled, rel=1e-6)


# ---- curvature


@given(points=control_points())
@examples(50)
def test_curvature_bounds_contain_samples(points):
    path = spline(points)
    attained, proved = path.max_curvature
    u, _ = samples(path)
    dense = np.abs(path.curvature(u)).max()
    assert attained <= proved
    if np.isfinite(proved):
        assert dense <= proved * (1.0 + 1e-9) + 1e-9
        assert proved <= 1.0011 * attained + 0.0011 / max(path.length_bounds[0], 1e-12)
    else:
        assert dense > 10.0 / path.length  # the path comes to rest at or between samples


def test_curvature_matches_the_circle_through_three_points():
    path = spline([(0, 0), (1, 0.2), (2, 1), (2.2, 2), (1.5, 3), (2, 4)])
    for u in (0.1, 0.35, 0.5, 0.8):
        a, b, c = path.poses(np.array([u - 1e-4, u, u + 1e-4]))[:, :2]
        area = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
        sides = np.linalg.norm([b - a, c - b, c - a], axis=1).prod()
        assert path.curvature(u) == pytest.approx(2.0 * area / sides, rel=1e-4)


def test_curvature_of_a_circle():
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    path = spline(3.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert path.curvature(np.linspace(0.1, 0.9, 9)) == pytest.approx(1 / 3, rel=1e-3)
    assert spline(path.control_points[::-1, :2]).curvature(0.5) == pytest.approx(-1 / 3, rel=1e-3)


def test_curvature_of_a_cusp_is_infinite():
    loop = spline([(0, 0), (3, 2), (-1, 2), (2, 0)])  # both are Bezier curves
    assert np.isfinite(loop.max_curvature[1])
    cusp = spline([(0, 0), (1, 1), (0, 1), (1, 0)])
    assert cusp.first_derivatives(0.5)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
    assert cusp.max_curvature == (np.inf, np.inf)
    assert cusp.curvature(0.5) == np.inf


def test_curvature_of_straight_and_zero_length_paths_is_zero():
    line = spline([(0, 0), (1, 2), (2, 4), (3, 6), (5, 10)])
    assert max(line.max_curvature) < 1e-9
    point = spline([(1, 1)] * 5)
    assert point.max_curvature == (0.0, 0.0)
    assert (point.curvature(np.linspace(0.0, 1.0, 5)) == 0.0).all()
    assert point.length == 0.0


# ---- clearance


@given(
    occupied=arrays(bool, (6, 6), elements=st.sampled_from([False, False, False, True])),
    points=control_points(4, 8),
    walled=st.booleans(),
)
@examples(40)
def test_clearance_bounds_contain_samples(occupied, points, walled):
    grid = OccupancyGrid(occupied, 1.0, walled=walled)
    path = spline(points)
    lower, upper = path.clearance(grid)
    _, curve = samples(path, 501)
    dense = grid.clearance(curve).min()
    if np.isinf(dense):
        assert lower == upper == dense
        return
    step = np.linalg.norm(np.diff(curve, axis=0), axis=1).max()
    assert lower <= dense + 1e-9
    assert upper >= dense - 0.5 * step - 1e-9
    assert 0.0 <= upper - lower <= 4.1e-3


def test_clearance_of_a_line_next_to_a_square():
    grid = OccupancyGrid(np.array([[False, False, True]]), 0.5, (1.0, 2.0), walled=False)
    path = spline([(0.0, 2.25), (0.5, 2.25), (1.0, 2.25), (1.7, 2.25)])
    lower, upper = path.clearance(grid)
    assert lower <= 0.3 <= upper
    assert upper - lower < 1e-7
    lower, upper = spline([(1.0, 2.25), (1.5, 2.25), (2.0, 2.25), (2.2, 2.25)]).clearance(grid)
    assert lower <= -0.2 <= upper
    assert upper - lower < 2.1e-3


def test_clearance_without_obstacles_is_infinite():
    grid = OccupancyGrid(np.zeros((3, 3), bool), 1.0, walled=False)
    assert spline([(0, 0), (1, 1), (2, 2), (30, 3)]).clearance(grid) == (np.inf, np.inf)


def test_nonpositive_tolerance_is_rejected():
    with pytest.raises(InvalidInput, match="tolerance must be positive, got 0 cells"):
        spline([(0, 0), (1, 1), (2, 2), (3, 3)]).clearance(
            OccupancyGrid(np.zeros((3, 3), bool), 1.0), 0.0
        )


# ---- the cells of a grid path as control points

KINDS = [(n, j) for n in range(4, 9) for j in range(n - 3)]
"""Number of control points and index of the piece: six knots determine the shape of a piece, and
eight control points cover all shapes."""


def weights(n, j):
    """Return the weights of four control points at 101 positions of piece j of n - 3."""
    knots = np.concatenate([[0.0] * 3, np.arange(n - 2), [n - 3.0] * 3])
    u = np.minimum(np.linspace(j, j + 1, 101), j + 1 - 1e-13)
    return BSpline(knots, np.eye(n), 3)(u)[:, j : j + 4]


def sequences_of_three_moves(cut_corners):
    """Yield all sequences of four cells, and the cells that are necessarily free.

    Up to rotation and reflection: the first move is (1, 0) or (1, 1).
    """
    for moves in product(MOVES[:2], MOVES, MOVES):
        cells = np.cumsum([(0, 0), *moves], axis=0)
        free = set(map(tuple, cells.tolist()))
        if not cut_corners:
            for (x, y), (dx, dy) in zip(cells.tolist(), moves, strict=False):
                free |= {(x + dx, y), (x, y + dy)}
        yield cells, free


def distances(positions, free):
    """Return the distance from every position to the nearest square that is not in ``free``."""
    squares = np.array([c for c in product(range(-5, 6), repeat=2) if c not in free])
    gaps = np.maximum(np.abs(positions[..., None, :] - squares) - 0.5, 0.0)
    return np.hypot(gaps[..., 0], gaps[..., 1]).min(axis=-1)


def closest(kinds, cut_corners):
    """Return the least sampled distance in cells over all pieces and moves."""
    shapes = np.stack([weights(*kind) for kind in kinds])
    return min(
        distances(shapes @ cells, free).min()
        for cells, free in sequences_of_three_moves(cut_corners)
    )


@pytest.mark.parametrize(("cells", "least"), [(4, 0.2854), (5, 0.3535), (6, 0.40896), (8, 0.40896)])
def test_spline_distance_without_corner_cutting(cells, least):
    """The values hold for all longer paths, which have no other pieces."""
    kinds = [kind for kind in KINDS if kind[0] == cells]
    assert least <= closest(kinds, cut_corners=False) <= least + 2e-4


def test_spline_distance_of_0409_cells_is_proved():
    """Proved bounds for every piece of a path of six cells or more."""
    for cells, free in sequences_of_three_moves(cut_corners=False):
        occupied = np.ones((11, 11), bool)
        for x, y in free:
            occupied[y + 5, x + 5] = False
        for n, j in KINDS[-12:]:
            window = np.arange(n).clip(j, j + 3) - j
            curve = pieces(cells[window] + 5.5)
            bounds = piece_clearances(
                Obstacles.of(OccupancyGrid(occupied, 1.0, walled=False)),
                curve.positions,
                curve.second_derivatives,
                1e-6,
                1.0,
            )
            assert bounds[j] >= 0.40896


def test_spline_with_corner_cutting_may_enter_an_obstacle():
    assert closest(KINDS, cut_corners=True) == 0.0
