"""Setpoints of a reference over a horizon."""

from __future__ import annotations

import numpy as np

from omnidrive.errors import InvalidReference
from omnidrive.reference import Hold, Reference
from omnidrive.reference.reference import WindowReference

_AHEAD = 256
"""Number of further sample times for which a reference is evaluated at once."""
_SAME_TIME = 1e-6
"""Difference of times, as a share of the sample time, that is taken for rounding."""


class ReferenceWindow:
    """Setpoints of a reference at multiples of the sample time, evaluated for many steps at once.

    References of this package do not change; any other is evaluated in every step.
    """

    __slots__ = ("dt", "points", "reference", "rows", "start")

    def __init__(self, points: int, dt: float) -> None:
        """Prepare windows of ``points`` setpoints ``dt`` (s) apart."""
        self.points, self.dt = points, dt
        self.reference: Reference | None = None
        self.start, self.rows = 0.0, np.zeros((points, 6))

    def find(self, t: float, reference: Reference) -> int:
        """Return the row of :attr:`rows` with the setpoint at ``t`` (s); the next ones follow."""
        first = (t - self.start) / self.dt
        row = round(first)
        if (
            reference is self.reference
            and 0 <= row <= len(self.rows) - self.points
            and abs(first - row) <= _SAME_TIME
        ):
            return row
        fixed = isinstance(reference, (WindowReference, Hold))
        count = self.points + (_AHEAD if fixed else 0)
        rows = np.ascontiguousarray(reference.window(t, count, self.dt), dtype=float)
        if rows.shape != (count, 6):
            raise InvalidReference(
                f"window must return {count} rows of 6 numbers, got an array of shape {rows.shape}"
            )
        self.rows = rows
        self.reference, self.start = (reference if fixed else None), t
        return 0

    def last(self, t: float, reference: Reference) -> int:
        """Return how many setpoints after that at ``t`` (s) are not later than the reference."""
        left = (reference.duration - t) / self.dt + _SAME_TIME
        return int(min(max(0.0, left), self.points))  # 0 for a duration that is not a number
