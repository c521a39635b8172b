"""The part of a grid that can be reached from a cell."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from omnidrive.arrays import Array
from omnidrive.compiled import compiled


@compiled
def flood(taken: Bool[Array, "rows cols"], row: int, col: int, reach: int) -> int:
    """How many free cells are connected to a free cell, itself included.

    Args:
        taken: The cells that cannot be entered.
        row: Of the cell to start from.
        col: Of the cell to start from.
        reach: How many of the two coordinates a move may change: 1 sideways only, 2 diagonally too.
    """
    rows, cols = taken.shape
    closed = taken.copy()
    waiting = np.empty(taken.size, np.int32)  # pages that are never touched take no memory
    waiting[0] = row * cols + col
    closed[row, col] = True
    count, left = 1, 1
    while left > 0:
        left -= 1
        row, col = waiting[left] // cols, waiting[left] % cols
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(col - 1, 0), min(col + 2, cols)):
                if abs(r - row) + abs(c - col) <= reach and not closed[r, c]:
                    closed[r, c] = True
                    waiting[left] = r * cols + c
                    count, left = count + 1, left + 1
    return count
