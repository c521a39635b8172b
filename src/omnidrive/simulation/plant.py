"""Anything that accepts a body twist and reports its motion: a simulator or a real robot."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.geometry import BodyTwist, Pose


class Measurement(NamedTuple):
    """What a plant reports at one instant."""

    pose: Pose
    """Pose of B in W; m, m, rad. The yaw is continuous, not wrapped."""
    twist: BodyTwist
    """Velocity of B, written in B; m/s, m/s, rad/s."""
    work: float
    """Mechanical work of the motors since ``reset``, sum over wheels of the integral of
    |torque * speed|, in J; NaN for a plant without forces."""


@runtime_checkable
class Plant(Protocol):
    """A robot, real or simulated."""

    def reset(self, pose: Pose) -> Measurement:
        """Start a run at rest at ``pose`` (a real robot already stands there)."""
        ...

    def step(self, twist: BodyTwist, dt: float) -> Measurement:
        """Command ``twist`` for ``dt`` seconds; report the motion at the end."""
        ...
