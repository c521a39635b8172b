"""A course with a law of motion: squared speed linear between nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.reference.course import Course, Motion
from omnidrive.reference.limits import LimitRows
from omnidrive.reference.reference import Setpoint

_CHECKS = 8
"""Places on every interval where limits are checked, besides its start."""


@dataclass(frozen=True, eq=False)
class TimedReference:
    """Motion from rest to rest along a course: ``(ds/dt)^2`` is linear in s between equal nodes.

    So d2s/dt2 is constant between nodes, and the pose at any time has a closed form. Velocity is
    continuous; acceleration may jump at nodes.

    Attributes:
        course: The poses, as a function of s.
        limits: What the motion is held against, see :attr:`limit_usage`.
        squared_speeds: (ds/dt)^2 at the nodes, in 1/s^2; a whole number of intervals per piece.
    """

    course: Course
    limits: tuple[LimitRows, ...]
    squared_speeds: Float[Array, " nodes"]

    @property
    def _width(self) -> float:
        """Of an interval, in units of s."""
        return len(self.course.pieces) / (len(self.squared_speeds) - 1)

    @cached_property
    def times(self) -> Float[Array, " nodes"]:
        """When each node is passed, in s: the speed's mean over an interval is that of its ends."""
        speeds = np.sqrt(self.squared_speeds)
        return np.concatenate([[0.0], np.cumsum(2.0 * self._width / (speeds[:-1] + speeds[1:]))])

    @property
    def duration(self) -> float:
        """Length of the motion in s."""
        return float(self.times[-1])

    def at(self, t: float) -> Setpoint:
        """Setpoint at time ``t`` in s; outside [0, duration] an end pose, at rest."""
        x, y, yaw, *twist = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(x, y, yaw), WorldTwist(*twist))

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Setpoints at ``t + k * dt`` for k = 0..n-1, columns as in :class:`Reference`."""
        at = t + dt * np.arange(n)
        inside = (at >= 0.0) & (at <= self.duration * (1.0 + 1e-12))  # k * dt may round past it
        at = np.clip(at, 0.0, self.duration)
        k = np.clip(np.searchsorted(self.times, at, side="right") - 1, 0, len(self.times) - 2)
        since, width = at - self.times[k], self._width
        before, after = self.squared_speeds[k], self.squared_speeds[k + 1]
        u = (after - before) / (2.0 * width)
        speed = np.maximum(np.sqrt(before) + u * since, 0.0)
        share = np.clip((np.sqrt(before) + 0.5 * u * since) * since / width, 0.0, 1.0)
        motion = self._motion(k, share)
        return np.hstack([motion.poses, motion.slopes * (speed * inside)[:, None]])

    def _motion(self, interval: Array, share: Array) -> Motion:
        """Poses and derivatives at a share of the way through intervals."""
        per_piece = round(1.0 / self._width)
        return self.course.at(interval // per_piece, (interval % per_piece + share) * self._width)

    @cached_property
    def interval_usage(self) -> dict[str, Float[Array, " intervals"]]:
        """Peak share of every limit that the motion uses in each interval; 1 is all of it.

        Checked at both ends of each interval and at seven places between.
        """
        count = len(self.squared_speeds) - 1
        usage = {group.name: np.zeros(count) for group in self.limits}
        before, after = self.squared_speeds[:-1], self.squared_speeds[1:]
        u = ((after - before) / (2.0 * self._width))[:, None]
        for share in np.arange(_CHECKS + 1) / _CHECKS:
            body = self.course.body(self._motion(np.arange(count), np.full(count, share)))
            x = (before + share * (after - before))[:, None]
            for group in self.limits:
                usage[group.name] = np.maximum(usage[group.name], _shares(group, body, u, x))
        return usage

    @cached_property
    def limit_usage(self) -> dict[str, float]:
        """Peak share of every limit that the motion uses, between nodes, too; 1 is all of it."""
        return {name: float(shares.max()) for name, shares in self.interval_usage.items()}

    def slowed(self, duration: float) -> TimedReference:
        """The same motion, all of it slower, in ``duration`` seconds.

        Speeds shrink with the duration, accelerations with its square.

        Raises:
            InvalidReference: ``duration`` is shorter than the motion's, or not finite.
        """
        if not np.isfinite(duration) or duration < self.duration * (1.0 - 1e-9):
            raise InvalidReference(
                f"{duration:g} s is no time in which the robot can follow this path: the fastest "
                f"motion within its limits takes {self.duration:.3f} s"
            )
        slower = (self.duration / duration) ** 2
        return TimedReference(self.course, self.limits, self.squared_speeds * slower)


def _shares(
    group: LimitRows, body: tuple[Array, Array, Array], u: Array, x: Array
) -> Float[Array, " n"]:
    """Share of one limit at many places."""
    slopes, rates, bends = body
    if group.kind == "speed":
        vectors = slopes * np.sqrt(x)
    else:
        vectors = slopes * u + (rates if group.kind == "twist rate" else bends) * x
    values = group.rows @ vectors.T  # rows first: long columns are the fast way to reduce
    shares: Float[Array, " n"] = (
        np.linalg.norm(values, axis=0) if group.round else np.abs(values).max(axis=0)
    )
    return shares
