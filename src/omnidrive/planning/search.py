"""Search on an occupancy grid: A* and greedy best-first."""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np
from jaxtyping import Bool, Int

from omnidrive.compiled import compiled
from omnidrive.errors import NoPathFound
from omnidrive.maps import OccupancyGrid

Array = np.ndarray
Cell = tuple[int, int]

_DIAGONAL = 2.0**0.5
# sideways moves first: of equal ways the straighter comes first
_MOVES = np.array([(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)])


def search(
    grid: OccupancyGrid, start: Cell, goal: Cell, *, greedy: bool = False, cut_corners: bool = False
) -> Int[Array, "cells 2"]:
    """Cells (row, column) of a way from ``start`` to ``goal`` over free cells, eight neighbours.

    A* with the octile distance (Hart, Nilsson & Raphael 1968): the way is shortest among those on
    the grid. ``greedy`` expands the cell nearest the goal instead and is not optimal (Russell &
    Norvig, "Artificial Intelligence", sec. 3.5.1); it is what the paper's published code does.

    Args:
        grid: The cells that may be used.
        start: A free cell.
        goal: A free cell.
        greedy: Ignore the length of the way so far.
        cut_corners: Allow a diagonal move past an occupied cell.

    Raises:
        NoPathFound: ``goal`` cannot be reached.
    """
    parents = _search(grid.occupied, start, goal, greedy, cut_corners)
    cols = grid.occupied.shape[1]
    first, cell = start[0] * cols + start[1], goal[0] * cols + goal[1]
    if parents[cell] < 0:
        raise NoPathFound(
            "there is no way from start to goal: every cell that can be reached was searched "
            f"({int((parents >= 0).sum())} of {int((~grid.occupied).sum())} free cells)"
        )
    way = [cell]
    while cell != first:
        cell = int(parents[cell])
        way.append(cell)
    return np.array([divmod(cell, cols) for cell in reversed(way)])


@compiled
def _octile(rows: int, cols: int) -> float:
    """Length of the shortest way of eight-neighbour moves across an empty grid, in cells."""
    rows, cols = abs(rows), abs(cols)
    return max(rows, cols) + (_DIAGONAL - 1.0) * min(rows, cols)


@compiled
def _search(
    occupied: Bool[Array, "rows cols"], start: Cell, goal: Cell, greedy: bool, cut_corners: bool
) -> Int[Array, " cells"]:
    """Predecessor of every cell reached, as a flat index; -1 elsewhere."""
    rows, cols = occupied.shape
    parents = np.full(rows * cols, -1, np.int64)
    length = np.full(rows * cols, np.inf)
    closed = np.zeros(rows * cols, np.bool_)
    first, last = start[0] * cols + start[1], goal[0] * cols + goal[1]
    parents[first], length[first] = first, 0.0
    queue = [(_octile(goal[0] - start[0], goal[1] - start[1]), 0.0, first)]
    while len(queue) > 0:
        _, _, cell = heappop(queue)
        if cell == last:
            break
        if closed[cell]:
            continue
        closed[cell] = True
        row, col = cell // cols, cell % cols
        for down, right in _MOVES:
            r, c = row + down, col + right
            if not (0 <= r < rows and 0 <= c < cols) or occupied[r, c]:
                continue
            if not cut_corners and (occupied[row, c] or occupied[r, col]):
                continue
            step = _DIAGONAL if down != 0 and right != 0 else 1.0
            so_far, index = length[cell] + step, r * cols + c
            if so_far < length[index] - 1e-9 and not (greedy and parents[index] >= 0):
                length[index], parents[index] = so_far, cell
                ahead = _octile(goal[0] - r, goal[1] - c)
                # of equal estimates the one with less to go comes first
                heappush(queue, (ahead if greedy else so_far + ahead, ahead, index))
    return parents
