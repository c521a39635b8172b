"""Small drawing of a map and a path for notebooks."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.maps import OccupancyGrid
from omnidrive.notebook import BLUE, GREY, Drawing

_MAX_BLOCKS = 60  # along each side of the map


def path_svg(grid: OccupancyGrid, positions: Float[Array, "points 2"]) -> str:
    """Return an SVG drawing of a map, 200 px along its longer side, and of a path on it.

    Args:
        grid: The map. Square blocks of cells are drawn, at most 60 along each side; a block is
            occupied if any of its cells is.
        positions: Points (x, y) of the path in W, m; at most 300 of them are drawn.
    """
    drawing = Drawing(grid.extent, width=200.0)
    rows, cols = grid.occupied.shape
    k = ceil(max(rows, cols) / _MAX_BLOCKS)
    for row, first, end in _runs(_blocks(grid.occupied, k)):
        corners = np.array([(row, first), (row, end), (row + 1, end), (row + 1, first)], float)
        corners = np.minimum(corners * k, (rows, cols))
        drawing.polygon(grid.points_of(corners), GREY)
    drawing.line(grid.corners[[0, 1, 2, 3, 0]], width=0.5)
    drawing.line(positions, BLUE, width=2.0)
    return drawing.svg()


def _blocks(occupied: Bool[Array, "rows cols"], k: int) -> Bool[Array, "fewer_rows fewer_cols"]:
    """Return whether any cell of each block of ``k`` x ``k`` cells is occupied."""
    rows, cols = (np.arange(0, count, k) for count in occupied.shape)
    blocks: Bool[Array, "fewer_rows fewer_cols"] = np.logical_or.reduceat(
        np.logical_or.reduceat(occupied, rows, axis=0), cols, axis=1
    )
    return blocks


def _runs(occupied: Bool[Array, "rows cols"]) -> list[tuple[int, int, int]]:
    """Return (row, first column, column after the last) of every run of occupied cells in a row."""
    padded = np.pad(occupied, ((0, 0), (1, 1))).astype(np.int8)
    edges = np.argwhere(np.diff(padded, axis=1))
    return [
        (int(row), int(a), int(b)) for (row, a), (_, b) in zip(edges[::2], edges[1::2], strict=True)
    ]
