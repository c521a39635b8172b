"""Integer lengths of moves, and heuristics that estimate the remaining length to the goal."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from omnidrive.compiled import inlined

STRAIGHT, DIAGONAL = 470832, 665857
"""Integer lengths of a move along an axis and of a diagonal move.

665857 / 470832 is a convergent of sqrt(2), and no fraction between the two has a smaller
denominator (Hardy & Wright, "An Introduction to the Theory of Numbers", th. 181). Sums of these
integers therefore compare exactly as the true lengths do, for paths that differ by fewer than
470832 diagonal moves.
"""


class Heuristic(NamedTuple):
    """Estimate of the remaining length: a weighted sum of the distances along both axes.

    Attributes:
        greater: Weight of the greater of the two distances.
        lesser: Weight of the lesser of the two distances.
        is_euclidean: Use the Euclidean distance instead of the weighted sum.
    """

    greater: int
    lesser: int
    is_euclidean: bool = False

    @property
    def is_consistent(self) -> bool:
        """Whether no move (of eight) lowers the estimate by more than its own length."""
        return self.greater + self.lesser <= DIAGONAL


HEURISTICS: dict[str, Heuristic] = {
    "octile": Heuristic(STRAIGHT, DIAGONAL - STRAIGHT),
    "manhattan": Heuristic(STRAIGHT, STRAIGHT),
    "euclidean": Heuristic(0, 0, is_euclidean=True),
    "zero": Heuristic(0, 0),
}


def weighted(name: str, weight: float) -> Heuristic:
    """Return a heuristic times a weight."""
    greater, lesser, is_euclidean = HEURISTICS[name]
    return Heuristic(round(weight * greater), round(weight * lesser), is_euclidean)


@inlined
def cost_to_go(heuristic: Heuristic, rows: int, cols: int) -> int:
    """Estimate the length over ``rows`` and ``cols`` cells, in the units of :data:`STRAIGHT`."""
    rows, cols = abs(rows), abs(cols)
    if heuristic.is_euclidean:
        return int(STRAIGHT * sqrt(float(rows * rows + cols * cols)))
    return heuristic.greater * max(rows, cols) + heuristic.lesser * min(rows, cols)
