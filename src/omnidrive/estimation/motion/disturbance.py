"""Disturbance of the motion observer: the twist that the model of the robot lacks."""

from __future__ import annotations

from typing import Any

from omnidrive.compiled import compiled
from omnidrive.estimation.motion.pose_noise import noisy_share
from omnidrive.robot.drive_model import DriveModel, axis_unit
from omnidrive.robot.slip import Vector

_USUAL_SPEED = 0.5
"""Speed, m/s, for which disturbances are stated where poses are noisy."""
_MIN_GAIN = 0.5
"""Smallest gain of a commanded twist that is compensated where poses are noisy."""


@compiled
def disturbance_at(model: DriveModel, state: Any, command: Vector) -> Vector:
    """Return the estimated disturbance with a commanded twist; m/s, m/s, rad/s."""
    disturbance = state.disturbance
    return (
        disturbance_scale(model, state, command[0], 0) * disturbance[0],
        disturbance_scale(model, state, command[1], 1) * disturbance[1],
        disturbance_scale(model, state, command[2], 2) * disturbance[2],
    )


@compiled
def without_disturbance(model: DriveModel, state: Any, twist: Vector) -> Vector:
    """Return the commanded twist that has the effect of a twist in spite of the disturbance."""
    return (
        _without(model, state, twist[0], 0),
        _without(model, state, twist[1], 1),
        _without(model, state, twist[2], 2),
    )


@compiled
def _without(model: DriveModel, state: Any, component: float, axis: int) -> float:
    """Return the component of :func:`without_disturbance` in an axis."""
    share, disturbance = noisy_share(model, state, axis), state.disturbance[axis]
    gain = 1.0 + share * disturbance / (_USUAL_SPEED * axis_unit(model, axis))
    return float((component - (1.0 - share) * disturbance) / max(gain, _MIN_GAIN))


@compiled
def disturbance_scale(model: DriveModel, state: Any, command: float, axis: int) -> float:
    """Return the disturbance of an axis at a commanded component, as a multiple of its state.

    Where poses are noisy the disturbance is an error of gain, in proportion to the command. A
    constant one would follow slow errors of the measured poses.
    """
    share = noisy_share(model, state, axis)
    return 1.0 - share + share * command / (_USUAL_SPEED * axis_unit(model, axis))
