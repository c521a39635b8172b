"""Check of the times of consecutive readings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf

from omnidrive.estimation.state import is_usable_number


class Stamp(Enum):
    """Result of the check of a time."""

    FOLLOWS = "follows"
    """It is not before the last accepted time, nor too far after it."""
    DROPPED = "dropped"
    """It is not usable, before the last accepted time, or too far after it."""
    JUMPED = "jumped"
    """It is not before the dropped time of the previous readings: the clock itself jumped."""


@dataclass(slots=True)
class ReadingClock:
    """Time of the readings of one run.

    One wrong time is dropped. Two in a row that are in order among themselves are a jump of the
    clock, to which the readings before it cannot be related.

    Attributes:
        longest_step: Longest time between accepted readings, s.
        time: Last accepted time, s; None before the first.
    """

    longest_step: float = inf
    time: float | None = None
    _suspect: float | None = None
    """Dropped time of the previous readings, s."""

    def reset(self) -> None:
        """Start a run; the next finite time is accepted."""
        self.time = self._suspect = None

    def advance(self, t: float) -> Stamp:
        """Check a time, s, and take it over unless it is dropped."""
        if not is_usable_number(t):
            return Stamp.DROPPED
        if self.time is None or 0.0 <= t - self.time <= self.longest_step:
            self.time, self._suspect = t, None
            return Stamp.FOLLOWS
        if self._suspect is None or t < self._suspect:
            self._suspect = t
            return Stamp.DROPPED
        self.time, self._suspect = t, None
        return Stamp.JUMPED
