"""Clocks of the real-time loop: the monotonic clock of the system, and a simulated one."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """A clock that never goes back; all stamps of a drive are its times."""

    def now(self) -> float:
        """Return the present time, s."""
        ...

    def sleep_until(self, t: float) -> None:
        """Return at the time ``t`` (s), or at once if it has passed."""
        ...


class MonotonicClock:
    """CLOCK_MONOTONIC: the same in all processes of a computer, not set by anyone."""

    def now(self) -> float:
        """Return the present time, s."""
        return time.monotonic()

    def sleep_until(self, t: float) -> None:
        """Sleep until the absolute time ``t`` (s)."""
        remaining = t - time.monotonic()
        if remaining > 0.0:  # CPython sleeps with clock_nanosleep until an absolute time
            time.sleep(remaining)


@dataclass(slots=True)
class SimulatedClock:
    """A clock that passes only while the loop sleeps, so that a drive runs as fast as it can.

    Attributes:
        time: Present time, s.
    """

    time: float = 0.0

    def now(self) -> float:
        """Return the present time, s."""
        return self.time

    def sleep_until(self, t: float) -> None:
        """Set the time to ``t`` (s) if it is later."""
        self.time = max(self.time, t)
