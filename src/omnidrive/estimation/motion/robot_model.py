"""Parameters of the robot in a step: response, wheels, and limits."""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.drive_estimate import DriveSettings
from omnidrive.robot.drive_model import DriveModel
from omnidrive.robot.slip import Vector

_MAX_SPEEDING = 3.0
"""Wheel speed, as a multiple of the maximum, above which an estimated twist is a fault."""


class RobotModel(NamedTuple):
    """Parameters of the robot in a step."""

    model: DriveModel
    """Response to commands."""
    wheels: Float[Array, "wheels 3"]
    """Wheel matrix."""
    faces: Float[Array, "faces 3"]
    """Limits of acceleration, ``|faces @ acceleration| <= 1`` in B; empty: none."""
    max_wheel_speed: float
    """In rad/s."""
    drive: Any
    """Known parameters of the drive, a record of
    :data:`~omnidrive.estimation.drive_estimate.DRIVE_PARAMETERS`."""
    identify: Any
    """:func:`~omnidrive.estimation.drive.drive_identification.identify` as a
    :class:`~omnidrive.compiled.CompiledFunction`; None: the drive is not identified."""
    bounds: DriveSettings
    """Bounds of the identification."""


@compiled
def fastest_wheel(robot: RobotModel, twist: Vector) -> float:
    """Return the largest wheel speed of a twist, rad/s."""
    fastest, wheels = 0.0, robot.wheels
    for i in range(len(wheels)):
        speed = wheels[i, 0] * twist[0] + wheels[i, 1] * twist[1] + wheels[i, 2] * twist[2]
        fastest = max(fastest, abs(speed))
    return fastest


@compiled
def is_plausible(robot: RobotModel, twist: Vector) -> bool:
    """Return whether a twist is known, and not far beyond what the wheels reach: a fault."""
    if not isfinite(twist[0] + twist[1] + twist[2]):
        return False
    return fastest_wheel(robot, twist) <= _MAX_SPEEDING * robot.max_wheel_speed
