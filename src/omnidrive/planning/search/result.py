"""Result of a grid search."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from jaxtyping import Int

from omnidrive.arrays import Array


@dataclass(frozen=True, eq=False, slots=True)
class SearchResult:
    """Grid path found by a search; a search without a path raises an error instead.

    Attributes:
        cells: Row and column of every cell of the path, from start to goal inclusive. An any-angle
            path has only start, goal and the cells in which it turns.
        cost: Length of the path from cell centre to cell centre, in cell widths; with travel costs
            every half of a move counts ``1 + cost`` times, with the cost of its cell.
        expansions: Number of expansions; a cell that is expanded twice counts twice. Those of the
            search by A* that precedes ``lazy-theta`` are not counted.
        seconds: Duration of the search, in s.
    """

    cells: Int[Array, "cells 2"]
    cost: float
    expansions: int
    seconds: float

    @property
    def length(self) -> float:
        """Length of the path from cell centre to cell centre, in cell widths."""
        return path_length(self.cells)


def path_length(cells: Int[Array, "cells 2"]) -> float:
    """Return the length of the polyline through the centres of the cells, in cell widths.

    If all moves are to neighbours, straight and diagonal ones are counted, so that rounding errors
    do not accumulate. Otherwise the lengths of the moves are summed.
    """
    steps = np.abs(cells[1:] - cells[:-1])
    if steps.max(initial=0) <= 1:
        diagonal = int(np.count_nonzero(steps[:, 0] & steps[:, 1]))
        return len(steps) - diagonal + diagonal * sqrt(2.0)
    total: float = np.hypot(*steps.T).sum().item()
    return total
