"""Anything that accepts a body twist and reports its motion: a simulator or a real robot."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.simulation.conditions import Conditions


class Measurement(NamedTuple):
    """What a plant reports at one instant: the truth, from which sensors make their readings."""

    pose: Pose
    """Pose of B in W; m, m, rad. The yaw is continuous, not wrapped."""
    twist: BodyTwist
    """Velocity of B, written in B; m/s, m/s, rad/s."""
    work: float
    """Mechanical work of the motors since ``reset``, sum over wheels of the integral of
    |torque * speed|, in J; NaN for a plant without forces."""
    wheel_angles: tuple[float, ...] = ()
    """How far each wheel has turned since ``reset``, in rad, with the signs of the chassis's wheel
    speeds; empty for a plant that does not tell."""
    wheel_torques: tuple[float, ...] = ()
    """Mean torque that each motor gave at its wheel during the last step, in N m; empty for a plant
    that does not tell."""
    collisions: int = 0
    """How often since ``reset`` the body began to touch an obstacle."""


@runtime_checkable
class Plant(Protocol):
    """A robot, real or simulated."""

    def reset(self, pose: Pose) -> Measurement:
        """Start a run at rest at ``pose`` (a real robot already stands there)."""
        ...

    def step(self, twist: BodyTwist, dt: float) -> Measurement:
        """Command ``twist`` for ``dt`` seconds; report the motion at the end."""
        ...


@runtime_checkable
class DisturbablePlant(Plant, Protocol):
    """A simulated plant on which more acts than the command."""

    def impose(self, conditions: Conditions) -> None:
        """Let ``conditions`` hold from now on; ``reset`` takes them back.

        Raises:
            InvalidInput: They speak of wheels that the robot does not have.
        """
        ...
