"""A reference that is continued along another one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference.reference import Reference, WindowReference

_KEPT = 5.0
"""Time before a splice for which the motion is kept, s."""


@dataclass(frozen=True, eq=False, slots=True)
class SplicedReference(WindowReference):
    """Motion of ``before`` up to ``switch_time``, then that of ``after`` from its start on.

    The motion is continuous if ``after`` starts with pose and twist of ``before`` there.

    Attributes:
        before: Motion up to ``switch_time``.
        after: Motion from then on; its time 0 is ``switch_time``.
        switch_time: Time at which ``after`` begins, s.
    """

    before: Reference
    after: Reference
    switch_time: float

    @classmethod
    def of(cls, before: Reference, after: Reference, at: float) -> SplicedReference:
        """Return a splice that holds no motion that ended long before ``at``.

        Repeated splices so need bounded memory; before ``at`` minus 5 s their poses are undefined.
        """
        if isinstance(before, SplicedReference) and at > before.switch_time + _KEPT:
            before = cls(before.after, before.after, before.switch_time)
        return cls(before, after, at)

    @property
    def duration(self) -> float:
        """Duration of both parts, s."""
        return self.switch_time + self.after.duration

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        if t >= self.switch_time:
            return self.after.window(t - self.switch_time, n, dt)
        rows: Float[Array, "n 6"] = np.array(self.before.window(t, n, dt))
        first = int(np.searchsorted(t + dt * np.arange(n), self.switch_time))
        if first < n:
            rows[first:] = self.after.window(t + first * dt - self.switch_time, n - first, dt)
        return rows
