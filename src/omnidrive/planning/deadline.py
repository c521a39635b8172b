"""Shares of a time limit for search and smoothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

_WITH_PATH, _WITHOUT_PATH = 0.5, 0.55
"""Share of the time limit for the search, with a path so far and without one."""
_FEW = 0.02  # share of the time limit that the result takes at least


class Deadline(NamedTuple):
    """Time limit of a plan.

    Attributes:
        began: Time at the beginning, s.
        limit: Time limit, s.
        clock: The clock, s.
    """

    began: float
    limit: float
    clock: Callable[[], float]

    def elapsed(self) -> float:
        """Return the time since the beginning, s."""
        return self.clock() - self.began

    def ends_search(self, has_path: bool) -> bool:
        """Whether the time of the search is over, given whether there is a path."""
        return self.elapsed() >= self.limit * (_WITH_PATH if has_path else _WITHOUT_PATH)

    def ends_smoothing(self, step: float) -> Callable[[], bool]:
        """Return whether the time of the smoothing is over.

        Args:
            step: Duration of an operation on the whole path, s, of which the result, and the
                steps between two looks at the clock, take up to four.
        """
        until = self.limit * (1.0 - _FEW) - 4.0 * step
        return lambda: self.elapsed() >= until
