"""Occupancy grids: cells, inflation and exact distances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from omnidrive.errors import InvalidMap
from omnidrive.maps import OccupancyGrid, paper_map, paper_wall

small_grids = arrays(bool, (6, 8), elements=st.sampled_from([False, False, True]))


def brute_distance(grid, x, y):
    """Distance to the nearest occupied square, the ring outside included, square by square."""
    rows, cols = grid.occupied.shape
    half = grid.resolution / 2
    best = np.inf
    for r in range(-1, rows + 1):
        for c in range(-1, cols + 1):
            if not grid.contains(r, c) or grid.occupied[r, c]:
                cx, cy = grid.centre(r, c)
                gap = np.hypot(max(abs(x - cx) - half, 0), max(abs(y - cy) - half, 0))
                best = min(best, gap)
    return best


@settings(max_examples=60, deadline=None)
@given(occupied=small_grids, x=st.floats(0.0, 1.999), y=st.floats(0.0, 1.499))
def test_clearance_is_exact(occupied, x, y):
    grid = OccupancyGrid(occupied, 0.25, (0.0, 0.0))
    clearance = grid.clearance(np.array([[x, y]]))[0]
    if grid.is_occupied(x, y):
        free = OccupancyGrid(~occupied, 0.25)
        if occupied.all():
            assert clearance == -np.inf
        else:
            inner = [
                np.hypot(
                    max(abs(x - free.centre(r, c)[0]) - 0.125, 0),
                    max(abs(y - free.centre(r, c)[1]) - 0.125, 0),
                )
                for r, c in np.argwhere(~occupied).tolist()
            ]
            assert clearance == pytest.approx(-min(inner), abs=1e-12)
    else:
        assert clearance == pytest.approx(brute_distance(grid, x, y), abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(occupied=small_grids, radius=st.floats(0.01, 0.8))
def test_a_disc_on_a_free_cell_of_the_inflated_grid_touches_nothing(occupied, radius):
    grid = OccupancyGrid(occupied, 0.25, (-1.0, 3.0))
    inflated = grid.inflated(radius)
    assert (inflated.occupied | ~occupied).all()
    for row, col in np.argwhere(~inflated.occupied).tolist():
        assert brute_distance(grid, *grid.centre(row, col)) >= radius - 1e-12


@given(row=st.integers(0, 5), col=st.integers(0, 7))
def test_cell_and_centre_are_inverse(row, col):
    grid = OccupancyGrid(np.zeros((6, 8), bool), 0.05, (-10.0, 4.0))
    assert grid.cell(*grid.centre(row, col)) == (row, col)


def test_the_papers_map():
    """Cell (i, j), counted from 1, is the point (j / 5, i / 5) m; the gap is two cells wide."""
    grid = paper_map()
    assert grid.occupied.shape == (50, 50)
    assert grid.centre(4, 4) == pytest.approx((1.0, 1.0))
    assert np.flatnonzero(~grid.occupied.all(axis=1)).size == 50
    assert np.flatnonzero(~grid.occupied[14]).tolist() == [23, 24]
    assert np.flatnonzero(grid.occupied[:, 0]).tolist() == list(range(10, 18))


@pytest.mark.parametrize("resolution", [0.0, -0.05, np.nan])
def test_a_resolution_that_is_not_positive_is_refused(resolution):
    with pytest.raises(InvalidMap, match="resolution must be positive"):
        OccupancyGrid(np.zeros((2, 2), bool), resolution)


@settings(max_examples=30, deadline=None)
@given(occupied=small_grids, x=st.floats(-1, 1), y=st.floats(-1, 1), side=st.floats(0.05, 0.5))
def test_one_grid_seen_through_the_cells_of_another(occupied, x, y, side):
    here = OccupancyGrid(occupied, 0.25)
    other = OccupancyGrid(np.zeros((5, 7), bool), side, (x, y))
    seen = here.occupied_on(other)
    for row in range(5):
        for col in range(7):
            assert seen[row, col] == here.is_occupied(*other.centre(row, col))


def test_the_papers_wall_lies_inside_its_inflation():
    """A robot of 0.75 m on a free cell of the paper's map touches the wall nowhere."""
    wall, keepout = paper_wall(), paper_map()
    assert (keepout.occupied_on(wall) | ~wall.occupied).all()
    rows, cols = np.nonzero(~keepout.occupied)
    inside = [keepout.centre(r, c) for r, c in zip(rows.tolist(), cols.tolist(), strict=True)]
    inner = np.array([p for p in inside if 1.0 < p[0] < 9.0 and 1.0 < p[1] < 9.0])
    assert wall.clearance(inner).min() > 0.75
    left, right, bottom, top = wall.extent
    assert (left, right, bottom, top) == pytest.approx(keepout.extent)
    assert wall.is_occupied(3.9, 3.0)
    assert not wall.is_occupied(4.1, 3.0)
