"""Base of references along a path, timed within limits."""

from __future__ import annotations

from abc import abstractmethod
from typing import Self

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.reference.reference import WindowReference
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.piecewise_path import PathDerivatives, PiecewisePath


class LimitedReference(WindowReference):
    """Motion along a path within limits; abstract.

    Attributes:
        path: Poses as a function of the path parameter s.
        limits: Limits that :attr:`limit_usage` evaluates.
        times: Time of each node, in s, from 0.
    """

    path: PiecewisePath
    limits: tuple[LimitRows, ...]
    times: Float[Array, " nodes"]

    @property
    def duration(self) -> float:
        """Duration of the motion, in s."""
        return float(self.times[-1])

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        at = t + dt * np.arange(n)
        inside = (at >= 0.0) & (at <= self.duration * (1.0 + 1e-12))  # k * dt may round past it
        at = np.clip(at, 0.0, self.duration)
        k = np.clip(np.searchsorted(self.times, at, side="right") - 1, 0, len(self.times) - 2)
        motion, speed = self._along(k, at - self.times[k])
        return np.hstack([motion.poses, motion.first_derivatives * (speed * inside)[:, None]])

    @abstractmethod
    def _along(self, k: Array, since: Array) -> tuple[PathDerivatives, Array]:
        """Evaluate path and ds/dt at a time (s) after the start of each interval k."""

    @property
    @abstractmethod
    def limit_usage(self) -> dict[str, float]:
        """Peak usage of each limit, between nodes as well, as a share of the limit."""

    @abstractmethod
    def slowed(self, rate: float) -> Self:
        """Return the same motion with all speeds multiplied by ``rate``, at most 1."""

    def with_duration(self, duration: float) -> Self:
        """Return the same motion, slowed evenly to take ``duration`` seconds.

        Speeds scale with 1 / duration, accelerations with its square, jerks with its cube.

        Raises:
            InvalidReference: ``duration`` is shorter than that of this motion, or not finite.
        """
        if not np.isfinite(duration) or duration < self.duration * (1.0 - 1e-9):
            raise InvalidReference(
                f"a duration of {duration:g} s is too short for this path: the fastest motion "
                f"within the limits takes {self.duration:.3f} s"
            )
        return self.slowed(self.duration / duration)
