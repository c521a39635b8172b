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

    __slots__ = ("dt", "duration", "points", "reference", "rows", "start")

    def __init__(self, points: int, dt: float) -> None:
        """Prepare windows of ``points`` setpoints ``dt`` (s) apart."""
        self.points, self.dt = points, dt
        self.reference: Reference | None = None
        self.start, self.duration, self.rows = 0.0, 0.0, np.zeros((points, 6))

    def find(self, t: float, reference: Reference) -> tuple[int, int]:
        """Return where the setpoints from ``t`` (s) on are, and how many of them count.

        Returns:
            The row of :attr:`rows` with the setpoint at ``t``; the next ones follow. And how many
            setpoints after that one are not later than the reference.
        """
        first = (t - self.start) / self.dt
        row = round(first)
        if not (
            reference is self.reference
            and 0 <= row <= len(self.rows) - self.points
            and abs(first - row) <= _SAME_TIME
        ):
            self._evaluate(t, reference)
            row = 0
        left = (self.duration - t) / self.dt + _SAME_TIME
        return row, int(min(max(0.0, left), self.points))  # 0 for a duration that is not a number

    def _evaluate(self, t: float, reference: Reference) -> None:
        """Evaluate a reference from ``t`` (s) on."""
        fixed = isinstance(reference, (WindowReference, Hold))
        count = self.points + (_AHEAD if fixed else 0)
        rows = np.ascontiguousarray(reference.window(t, count, self.dt), dtype=float)
        if rows.shape != (count, 6):
            raise InvalidReference(
                f"window must return {count} rows of 6 numbers, got an array of shape {rows.shape}"
            )
        self.rows, self.duration = rows, reference.duration
        self.reference, self.start = (reference if fixed else None), t
