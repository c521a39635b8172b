"""The rest of a reference after the robot was held."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference import Reference
from omnidrive.reference.reference import WindowReference

_EASE = 1.0
"""Time in which the motion reaches its speed, s."""


@dataclass(frozen=True, eq=False, slots=True)
class RemainingReference(WindowReference):
    """Motion of ``reference`` from the time ``done`` on, which begins at rest.

    Its speed rises to that of ``reference`` in one second, as a raised cosine, so that the motion
    is later by half a second from then on.

    Attributes:
        reference: The whole motion.
        done: Time of it that is over, s.
    """

    reference: Reference
    done: float

    @property
    def duration(self) -> float:
        """Duration of the rest, s."""
        return max(self.reference.duration - self.done, 0.0) + 0.5 * _EASE

    def progress(self, t: float) -> float:
        """Return the time of ``reference`` that is over since ``done`` at the time ``t``, s."""
        share = min(t / _EASE, 1.0)
        return t - 0.5 * _EASE * (share + sin(pi * share) / pi)

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        if t >= _EASE:
            return self.reference.window(self.done + t - 0.5 * _EASE, n, dt)
        times = np.maximum(t + dt * np.arange(n), 0.0)
        easing = int(np.count_nonzero(times < _EASE))  # they are the first ones
        rate = 0.5 * (1.0 - np.cos(pi * times[:easing]))
        at = [self.done + self.progress(each) for each in times[:easing].tolist()]
        setpoints = np.empty((n, 6))
        for k, each in enumerate(at):
            setpoints[k] = self.reference.window(each, 1, 0.0)[0]
        setpoints[:easing, 3:] *= rate[:, None]
        if easing < n:
            begin = self.done + float(times[easing]) - 0.5 * _EASE
            setpoints[easing:] = self.reference.window(begin, n - easing, dt)
        return setpoints
