"""Cells of a map by kind, reduced to fewer cells for pictures."""

from __future__ import annotations

import numpy as np
from jaxtyping import Num, UInt8

from omnidrive.arrays import Array
from omnidrive.maps import OccupancyGrid

FREE, INFLATED, OCCUPIED = 0, 1, 2
"""Kinds of cells, in ascending order of what hides what."""


def cell_kinds(grid: OccupancyGrid, free_space: OccupancyGrid) -> UInt8[Array, "rows cols"]:
    """Return the kind of every cell of a grid.

    Args:
        grid: Occupancy grid of the obstacles.
        free_space: Inflated grid: its free cells may contain the robot's centre.
    """
    kinds = free_space.occupied_on(grid).astype(np.uint8)
    kinds[grid.occupied] = OCCUPIED
    return kinds


def max_pool(cells: Num[Array, "rows cols"], k: int) -> Num[Array, "fewer_rows fewer_cols"]:
    """Return the maximum of every block of ``k`` x ``k`` cells; the last blocks may be smaller."""
    if k == 1:
        return cells
    rows, cols = (np.arange(0, count, k) for count in cells.shape)
    pooled: Num[Array, "fewer_rows fewer_cols"] = np.maximum.reduceat(
        np.maximum.reduceat(cells, rows, axis=0), cols, axis=1
    )
    return pooled
