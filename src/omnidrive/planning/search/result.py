"""Result of a grid search."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from jaxtyping import Int

from omnidrive.arrays import Array


@dataclass(frozen=True, eq=False, slots=True)
class SearchResult:
    """Grid path found by a search.

    Attributes:
        cells: Row and column of every cell of the path, start and goal included. An any-angle
            search returns only the cells in which the path turns.
        cost: Length of the path from cell centre to cell centre, in cells.
        expansions: Number of expanded cells.
        seconds: Duration of the search, in s.
    """

    cells: Int[Array, "cells 2"]
    cost: float
    expansions: int
    seconds: float


def path_length(cells: Int[Array, "cells 2"]) -> float:
    """Return the length of the polyline through the centres of the cells, in cells.

    Straight and diagonal moves are counted, so that only the final sum is rounded.
    """
    steps = np.abs(cells[1:] - cells[:-1])
    if steps.max(initial=0) <= 1:
        diagonal = int(np.count_nonzero(steps[:, 0] & steps[:, 1]))
        return len(steps) - diagonal + diagonal * sqrt(2.0)
    total: float = np.hypot(*steps.T).sum().item()
    return total
