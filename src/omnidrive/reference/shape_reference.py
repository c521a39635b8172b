"""References along a named shape, from rest to rest or uniform."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose
from omnidrive.reference.motion import Motion
from omnidrive.reference.reference import WindowReference, check_duration
from omnidrive.reference.shapes import Shape

ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class ShapeReference(WindowReference):
    """Motion along a shape with exact velocities and accelerations.

    The parameter s of the shape grows with the rate v w(t), where w = 3 u^2 - 2 u^3 rises from 0 to
    1 over :attr:`~omnidrive.reference.shapes.Shape.ramp` times the duration (u from 0 to 1), is
    constant, and falls to 0 in the same way; v = 1 / (1 - ramp) per duration. The accelerations
    are continuous in time, except for the yaw acceleration of a slalom between clothoids.

    Attributes:
        shape: The shape.
        duration: Duration of the motion, in s.
        start: Pose in W of the frame of the shape, in which the motion starts at the origin. Its
            heading is that of the shape's x axis.

    Raises:
        InvalidReference: The duration is not positive, or the start is not finite.
    """

    shape: Shape
    duration: float
    start: Pose = ORIGIN

    def __post_init__(self) -> None:
        check_duration(self.duration)
        if not np.isfinite(self.start).all():
            raise InvalidReference(f"the start must be finite, got {tuple(self.start)}")

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        motion = self.motion(t + dt * np.arange(n))
        return np.hstack([motion.poses, motion.twists])

    def motion(self, times: Float[Array, " n"]) -> Motion:
        """Return poses, twists and accelerations in W at ``times`` in s, one row each."""
        share = times / self.duration
        inside = ((share >= 0.0) & (share <= 1.0 + 1e-12))[:, None]  # rounding may pass 1
        law = _time_law(np.clip(share, 0.0, 1.0), self.shape.ramp)
        poses, first, second = self._in_world(np.array(self.shape.evaluate(law.s)))
        poses += self.start
        rate, change = law.rate[:, None] / self.duration, law.change[:, None] / self.duration**2
        accelerations = second * rate**2 + first * change
        return Motion(poses, first * rate * inside, accelerations * inside)

    def _in_world(self, vectors: Float[Array, "3 n 3"]) -> Float[Array, "3 n 3"]:
        """Rotate vectors (x, y, yaw) of the frame of the shape into W."""
        c, s = cos(self.start.yaw), sin(self.start.yaw)
        x, y = vectors[..., 0], vectors[..., 1]
        vectors[..., 0], vectors[..., 1] = c * x - s * y, s * x + c * y
        return vectors


class _TimeLaw(NamedTuple):
    """Parameter of the shape and its derivatives with respect to time / duration."""

    s: Float[Array, " n"]
    rate: Float[Array, " n"]
    change: Float[Array, " n"]


def _time_law(share: Float[Array, " n"], ramp: float) -> _TimeLaw:
    """Return the time law at shares of the duration in [0, 1]."""
    if ramp == 0.0:
        return _TimeLaw(share, np.ones_like(share), np.zeros_like(share))
    top = 1.0 / (1.0 - ramp)
    up, down = np.minimum(share / ramp, 1.0), np.minimum((1.0 - share) / ramp, 1.0)
    minimum = np.minimum(up, down)
    s = np.where(
        share <= 0.5,
        top * (share - up * ramp + ramp * (up**3 - 0.5 * up**4)),
        1.0 - top * (1.0 - share - down * ramp + ramp * (down**3 - 0.5 * down**4)),
    )
    change = 6.0 * (up * (1.0 - up) - down * (1.0 - down)) * top / ramp
    return _TimeLaw(s, top * minimum**2 * (3.0 - 2.0 * minimum), change)
