"""Disturbance of the motion observer: the twist that the model of the robot lacks."""

from __future__ import annotations

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.motion_memory import MotionMemory
from omnidrive.control.nmpc.holonomic.pose_noise import noisy_share
from omnidrive.robot.drive_model import DriveModel, axis_unit
from omnidrive.robot.slip import Vector

_USUAL_SPEED = 0.5
"""Speed, m/s, for which disturbances are stated where poses are noisy."""
_MIN_GAIN = 0.5
"""Smallest gain of a commanded twist that is compensated where poses are noisy."""


@compiled
def disturbance_at(model: DriveModel, memory: MotionMemory, command: Vector) -> Vector:
    """Return the estimated disturbance with a commanded twist; m/s, m/s, rad/s."""
    disturbance = memory.disturbance
    return (
        disturbance_scale(model, memory, command[0], 0) * disturbance[0],
        disturbance_scale(model, memory, command[1], 1) * disturbance[1],
        disturbance_scale(model, memory, command[2], 2) * disturbance[2],
    )


@compiled
def without_disturbance(model: DriveModel, memory: MotionMemory, twist: Vector) -> Vector:
    """Return the commanded twist that has the effect of a twist in spite of the disturbance."""
    return (
        _without(model, memory, twist[0], 0),
        _without(model, memory, twist[1], 1),
        _without(model, memory, twist[2], 2),
    )


@compiled
def _without(model: DriveModel, memory: MotionMemory, component: float, axis: int) -> float:
    """Return the component of :func:`without_disturbance` in an axis."""
    share, disturbance = noisy_share(model, memory, axis), memory.disturbance[axis]
    gain = 1.0 + share * disturbance / (_USUAL_SPEED * axis_unit(model, axis))
    return float((component - (1.0 - share) * disturbance) / max(gain, _MIN_GAIN))


@compiled
def disturbance_scale(model: DriveModel, memory: MotionMemory, command: float, axis: int) -> float:
    """Return the disturbance of an axis at a commanded component, as a multiple of its state.

    Where poses are noisy the disturbance is an error of gain, in proportion to the command. A
    constant one would follow slow errors of the measured poses.
    """
    share = noisy_share(model, memory, axis)
    return 1.0 - share + share * command / (_USUAL_SPEED * axis_unit(model, axis))
