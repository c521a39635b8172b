"""Lengths of ways over cells as whole numbers, and lower bounds of what is left to go."""

from __future__ import annotations

from math import sqrt
from typing import Literal, NamedTuple

from omnidrive.compiled import inlined

STRAIGHT, DIAGONAL = 470832, 665857
"""Lengths of a move along an axis and of a diagonal one.

665857 / 470832 is a convergent of sqrt(2), and no fraction between the two has a smaller
denominator (Hardy & Wright, "An Introduction to the Theory of Numbers", th. 181): sums of these
compare as the true lengths do, exactly, for ways that differ by fewer than 470832 diagonal moves.
"""


class Heuristic(NamedTuple):
    """What is taken to be left to go: a sum over the greater and the lesser of two distances.

    Attributes:
        greater: Weight of the distance along the axis on which it is greater.
        lesser: Weight of the distance along the other axis.
        beeline: Take the straight line's length instead.
    """

    greater: int
    lesser: int
    beeline: bool = False

    @property
    def is_consistent(self) -> bool:
        """Whether no move, of eight, brings the goal nearer by more than its length."""
        return self.greater + self.lesser <= DIAGONAL


HeuristicName = Literal["octile", "manhattan", "euclidean", "zero"]
HEURISTICS: dict[str, Heuristic] = {
    "octile": Heuristic(STRAIGHT, DIAGONAL - STRAIGHT),
    "manhattan": Heuristic(STRAIGHT, STRAIGHT),
    "euclidean": Heuristic(0, 0, beeline=True),
    "zero": Heuristic(0, 0),
}


@inlined
def to_go(heuristic: Heuristic, rows: int, cols: int) -> int:
    """The heuristic over a distance of ``rows`` and ``cols`` cells, in units of the lengths."""
    rows, cols = abs(rows), abs(cols)
    if heuristic.beeline:
        return int(STRAIGHT * sqrt(float(rows * rows + cols * cols)))
    return heuristic.greater * max(rows, cols) + heuristic.lesser * min(rows, cols)
