"""Inflation of grids by the footprint of a robot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from tests.examples import examples

SIDE = 0.25
SQUARE = np.array([[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]])
CHEVRON = np.array([[0.6, 0.0], [-0.5, 0.45], [-0.1, 0.0], [-0.5, -0.45]])
ASIDE = np.array([[0.4, 0.3], [0.9, 0.35], [0.5, 0.8]])
STAR = np.array([[0.5, 0], [-0.4, 0.3], [0.15, -0.48], [0.15, 0.48], [-0.4, -0.3]])

small_grids = arrays(bool, (6, 8), elements=st.sampled_from([False, False, False, True]))
footprints = st.sampled_from([SQUARE, CHEVRON, ASIDE, SQUARE[::-1], STAR])


def clipped_area(corners, left, bottom):
    """Return the area of the intersection of a polygon and a cell.

    Clipping by Sutherland & Hodgman 1974; area by the shoelace formula.
    """
    for axis, edge, sign in ((0, left, 1), (0, left + SIDE, -1), (1, bottom, 1),
                             (1, bottom + SIDE, -1)):  # fmt: skip
        kept = []
        for a, b in zip(corners, [*corners[1:], *corners[:1]], strict=True):
            inside_a, inside_b = sign * (a[axis] - edge) >= 0, sign * (b[axis] - edge) >= 0
            if inside_a:
                kept.append(a)
            if inside_a != inside_b:
                kept.append(a + (b - a) * (edge - a[axis]) / (b[axis] - a[axis]))
        corners = kept
        if not corners:
            return 0.0
    x, y = np.array(corners).T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


def brute(grid, footprint, yaw):
    """Return the inflated occupancy by the area shared with obstacles, cell by cell."""
    rows, cols = grid.occupied.shape
    turned = footprint @ (1, 1j) * np.exp(1j * (yaw - grid.yaw))
    taken = grid.occupied.copy()
    for row, col in np.ndindex(rows, cols):
        at = turned + complex(col + 0.5, row + 0.5) * SIDE
        corners = list(np.column_stack([at.real, at.imag]))
        for r in range(-6, rows + 6):
            for c in range(-6, cols + 6):
                full = grid.occupied[r, c] if grid.contains(r, c) else grid.walled
                if full and not taken[row, col]:
                    taken[row, col] = clipped_area(corners, c * SIDE, r * SIDE) > 1e-9
    return taken


@examples(15)
@given(
    occupied=small_grids, footprint=st.sampled_from([SQUARE, CHEVRON, ASIDE, SQUARE[::-1]]),
    yaw=st.floats(-4, 4) | st.sampled_from([0.0, np.pi / 2]),
    turn=st.sampled_from([0.0, 0.7]), walled=st.booleans(),
)  # fmt: skip
def test_cell_is_free_exactly_if_the_footprint_is_free(occupied, footprint, yaw, turn, walled):
    grid = OccupancyGrid(occupied, SIDE, (3.0, 1.0), walled, turn)
    inflated = grid.inflated_by(footprint, yaw)
    assert inflated.yaw == turn
    np.testing.assert_array_equal(inflated.occupied, brute(grid, footprint, yaw))


def test_contact_along_cell_edges_is_free():
    """A footprint of exactly three cells by one in a corridor of one cell."""
    occupied = np.ones((3, 9), bool)
    occupied[1] = False
    grid = OccupancyGrid(occupied, 0.1)
    half = np.array([[0.15, 0.05], [-0.15, 0.05], [-0.15, -0.05], [0.15, -0.05]])
    free = ~grid.inflated_by(half, 0.0).occupied
    assert np.argwhere(free).tolist() == [[1, c] for c in range(1, 8)]
    assert grid.inflated_by(half * 1.001, 0.0).occupied.all()
    assert grid.inflated_by(half, np.pi / 2).occupied.all()


def test_self_intersecting_polygon_has_no_hole():
    """An obstacle in the centre of a five-pointed star."""
    occupied = np.zeros((60, 60), bool)
    occupied[30, 30] = True
    grid = OccupancyGrid(occupied, 0.02, walled=False)
    middle = grid.inflated_by(STAR, 0.0).occupied[25:36, 25:36]
    assert middle.all()


@examples(20)
@given(occupied=small_grids, footprint=footprints, yaw=st.floats(-4, 4))
def test_without_heading_the_disc_through_the_farthest_corner_is_used(occupied, footprint, yaw):
    grid = OccupancyGrid(occupied, SIDE)
    disc = grid.inflated_by(footprint).occupied
    assert (disc == grid.inflated(np.hypot(*footprint.T).max()).occupied).all()
    assert (disc | ~grid.inflated_by(footprint, yaw).occupied).all()


def test_polygon_with_many_corners_approximates_a_disc():
    occupied = np.zeros((41, 41), bool)
    occupied[20, 20] = True
    grid = OccupancyGrid(occupied, 0.05, walled=False)
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    within = grid.inflated_by(0.5 * circle, 0.3).occupied
    assert (within | ~grid.inflated(0.499).occupied).all()
    assert (grid.inflated(0.5).occupied | ~within).all()


@pytest.mark.parametrize("scale", [1e-6, 1e3, 1e200])
def test_footprint_sizes(scale):
    occupied = np.zeros((5, 7), bool)
    occupied[2, 3] = True
    grown = OccupancyGrid(occupied, 0.1, walled=False).inflated_by(SQUARE * scale, 0.2).occupied
    assert (grown == (occupied if scale < 1 else True)).all()


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([[0, 0], [1, 1]], r"at least three corners \(x, y\), got shape \(2, 2\)"),
        ([[0, 0], [1, 1], [2, 2]], "on one line"),
        ([[0, 0], [0, 0], [0, 0]], "on one line"),
        ([[0, 0], [1, 0], [0, np.nan]], "must be finite"),
    ],
)
def test_invalid_footprint_is_rejected(corners, message):
    with pytest.raises(InvalidInput, match=message):
        OccupancyGrid(np.zeros((2, 2), bool), 0.1).inflated_by(np.array(corners, float), 0.0)


def test_nonfinite_heading_is_rejected():
    with pytest.raises(InvalidInput, match="heading must be finite"):
        OccupancyGrid(np.zeros((2, 2), bool), 0.1).inflated_by(SQUARE, np.inf)
