"""What a search found."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from jaxtyping import Int

from omnidrive.arrays import Array


@dataclass(frozen=True, eq=False, slots=True)
class SearchResult:
    """A way over cells.

    Attributes:
        cells: Row and column of every cell of the way, start and goal included; of an any-angle
            search only the cells in which it turns.
        cost: Length of the way from cell centre to cell centre, in cells.
        expansions: Cells whose neighbours were looked at.
        seconds: Time that the search took, in s.
    """

    cells: Int[Array, "cells 2"]
    cost: float
    expansions: int
    seconds: float


def length(cells: Int[Array, "cells 2"]) -> float:
    """Length of the lines between the centres of cells one after the other, in cells.

    Moves to neighbours are counted, so that nothing is rounded but the sum.
    """
    steps = np.abs(cells[1:] - cells[:-1])
    if steps.max(initial=0) <= 1:
        diagonal = int(np.count_nonzero(steps[:, 0] & steps[:, 1]))
        return len(steps) - diagonal + diagonal * sqrt(2.0)
    total: float = np.hypot(*steps.T).sum().item()
    return total
