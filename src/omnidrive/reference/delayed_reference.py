"""References that follow the path of another reference, never ahead of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.reference.reference import Reference, WindowReference


@dataclass(frozen=True, eq=False)
class DelayedReference(WindowReference):
    """Motion along the path of ``reference`` that is never ahead of it.

    At the time t it is where ``reference`` is at ``t - delay(t)``. A window in which there is no
    delay has the setpoints of ``reference``, bit for bit; others are interpolated between samples
    (cubic Hermite).

    Attributes:
        reference: The original motion.
        step: Time between samples, in s.
        setpoints: Setpoints at 0, ``step``, 2 ``step``, ..., yaw unwrapped; columns as in
            :class:`~omnidrive.reference.Reference`. The last one is the end, at rest.
        delays: Delay at the same times, in s; not negative.
    """

    reference: Reference
    step: float
    setpoints: Float[Array, "samples 6"]
    delays: Float[Array, " samples"]

    @property
    def duration(self) -> float:
        """Duration of the original motion and delay of its end, in s."""
        return self.reference.duration + float(self.delays[-1])

    @property
    def max_delay(self) -> float:
        """Largest delay, in s."""
        return float(self.delays.max())

    def delay(self, t: float) -> float:
        """Return the delay at the time ``t`` (s), in s."""
        last = len(self.delays) - 1
        at = min(max(t / self.step, 0.0), float(last))
        i = min(int(at), last - 1)
        before, after = self.delays[i : i + 2].tolist()
        delay: float = before + (at - i) * (after - before)
        return delay

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        last = len(self.delays) - 1
        first = int(min(max(t / self.step, 0.0), last))
        end = int(min(max((t + (n - 1) * dt) / self.step, 0.0), last - 1)) + 2
        if self._delayed_before[first] == self._delayed_before[end]:
            return self.reference.window(t, n, dt)
        rows = np.empty((n, 6))
        interpolate(self.setpoints, self.step, float(t), float(dt), rows)
        return rows

    @cached_property
    def _delayed_before(self) -> Int[Array, " more"]:
        """Number of samples with a delay before each sample, and in all."""
        return np.concatenate([[0], np.cumsum(self.delays > 0.0)])


@compiled
def interpolate(
    setpoints: Float[Array, "samples 6"], step: float, t: float, dt: float, out: Float[Array, "n 6"]
) -> None:
    """Write the setpoints at ``t + k * dt`` (s) into ``out``; outside the samples an end, at rest.

    Args:
        setpoints: Setpoints at 0, ``step``, 2 ``step``, ...; at least two.
        step: Time between them, in s.
        t: First time, in s.
        dt: Time between rows of ``out``, in s.
        out: Output; columns as in :class:`~omnidrive.reference.Reference`.
    """
    last = len(setpoints) - 1
    for k in range(len(out)):
        at = (t + k * dt) / step
        if not 0.0 <= at < last:
            end = last if at > 0.0 else 0
            for j in range(3):
                out[k, j], out[k, 3 + j] = setpoints[end, j], 0.0
            continue
        i = int(at)
        r = at - i
        for j in range(3):
            p, rise = setpoints[i, j], setpoints[i + 1, j] - setpoints[i, j]
            v, w = step * setpoints[i, 3 + j], step * setpoints[i + 1, 3 + j]
            square, cube = 3.0 * rise - 2.0 * v - w, v + w - 2.0 * rise
            out[k, j] = p + r * (v + r * (square + r * cube))
            out[k, 3 + j] = (v + r * (2.0 * square + 3.0 * r * cube)) / step
