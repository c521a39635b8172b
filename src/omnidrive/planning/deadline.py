"""Shares of a time limit for search and smoothing."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

from omnidrive.errors import InvalidInput

_WITH_PATH, _WITHOUT_PATH = 0.5, 0.55
"""Share of the time limit for the search, with a path so far and without one."""
_SHORT, _LONG = 1e-3, 1e6  # s
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

    @classmethod
    def of(cls, limit: float, clock: Callable[[], float] = perf_counter) -> Deadline:
        """Return a time limit that begins now.

        Raises:
            InvalidInput: The limit is not positive.
        """
        check_time_limit(limit)
        return cls(clock(), limit, clock)

    @property
    def remaining(self) -> float:
        """Time until the end, s; negative after it."""
        return self.limit - self.elapsed()

    def left(self) -> float:
        """Return the time until the end, s; from 1 ms to some days."""
        return min(max(self.remaining, _SHORT), _LONG)

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


def check_time_limit(limit: float) -> None:
    """Check a time limit in s.

    Raises:
        InvalidInput: It is not positive.
    """
    if not limit > 0.0:
        raise InvalidInput(f"the time limit must be positive, got {limit:g} s")
