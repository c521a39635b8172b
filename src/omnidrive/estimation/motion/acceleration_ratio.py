"""Ratio of the robot's acceleration to the planned one, and of its response in time."""

from __future__ import annotations

from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.motion.pose_noise import position_variance
from omnidrive.geometry.arc import arc_velocity
from omnidrive.geometry.kernels import wrap_angle
from omnidrive.robot.drive_model import DriveModel
from omnidrive.robot.slip import Vector

_ASSUMED, _MIN = 0.7, 0.3
"""Share that is assumed without evidence, and the least one."""
_DEFICIT = 0.8
"""Acceleration over the predicted one, below which the robot does not reach it."""
_MIN_LOAD = 0.3
"""Least share of the limits of acceleration at which a deficit is evidence."""
_RISE, _REACTION, _FORGETTING_TIME = 0.04, 0.1, 20.0
"""Time constants in s: of rises, of reductions, and of the return to the assumed share."""
_FOLLOWED, _PROBING_TIME = 0.9, 1.0
"""Acceleration over the predicted one, from which on more is demanded again; and time constant of
this in s."""
_PROMPT, _DELAYED = 0.65, 0.55
"""Acceleration over the predicted one, from which on the response is prompt, and below which it is
delayed."""
_MIN_RESPONSE_RATIO, _DELAY_FORGETTING_TIME = 0.33, 10.0
"""Ratio of a delayed response, and time constant in s with which a delay is forgotten."""
_PUNCTUAL, _LATE = 0.35, 0.25
"""As :data:`_PROMPT` and :data:`_DELAYED`, for a response that a delay or a lag explains, but no
lower friction."""
_LATE_FORGETTING_TIME = 1.0
"""Time constant in s with which a late response is forgotten."""
_NOISE_RATIO = 25.0
"""Least square of the displacement by acceleration over the variance of the measured position."""


@compiled
def reached_share(state: Any) -> float:
    """Return the share of the limits of acceleration that the robot reaches, 0 to 1."""
    return _ASSUMED + float(state.response.excess_ratio)


@compiled
def limit_ratio(state: Any) -> float:
    """Return the factor of the limits of acceleration for plans: 1 without evidence for less."""
    return min(1.0, reached_share(state) / _ASSUMED)


@compiled
def response_ratio(state: Any) -> float:
    """Return the factor of speed per distance for a response that may be delayed, up to 1."""
    return 1.0 - (1.0 - _MIN_RESPONSE_RATIO) * float(state.response.delayed)


@compiled
def shows_no_delay(state: Any) -> float:
    """Return 1 where accelerations have been followed at once, 0 without or against evidence."""
    return float(state.response.prompt) * (1.0 - float(state.response.delayed))


@compiled
def is_late(state: Any) -> bool:
    """Return whether the robot has responded later than predicted within the last second or so."""
    return bool(state.response.late > 0.5)


@compiled
def update_reached(  # noqa: PLR0917
    model: DriveModel,
    faces: Float[Array, "faces 3"],
    state: Any,
    pose: Vector,
    twist: Vector,
    measured: Vector,
    dt: float,
) -> None:
    """Update the share of the limits of acceleration that the robot has reached.

    On a slippery floor the robot accelerates less than the model predicts as long as more is
    demanded. The share follows such deficits within a tenth of a second, and rises at once where
    the robot is seen to accelerate more: a motor lag is a deficit for a moment only. A large one
    shows a lag or a delay that the model does not have, and is remembered for seconds.

    Args:
        model: The model.
        faces: Limits of acceleration, ``|faces @ acceleration| <= 1`` in B.
        state: The prediction for the time of the measurement.
        pose: Estimated pose a sample before.
        twist: Estimated body twist a sample before.
        measured: Measured pose.
        dt: Time since then, in s.
    """
    vx, vy = arc_velocity(dt, pose[2], twist[0], twist[1], twist[2])
    free = (pose[0] + dt * vx, pose[1] + dt * vy, pose[2] + dt * twist[2])  # not accelerated
    missing, expected = 0.0, 0.0
    for a in range(3):
        change, error = state.pose[a] - free[a], state.pose[a] - measured[a]
        if a == 2:
            error = wrap_angle(error)
        missing += model.inertia[a] * change * error
        expected += model.inertia[a] * change * change
    if expected <= _NOISE_RATIO * model.inertia[0] * position_variance(state):
        return
    load = 0.0
    for j in range(len(faces)):
        change = 0.0
        for a in range(3):
            change += faces[j, a] * (state.twist[a] - twist[a])
        load = max(load, abs(change) / dt)
    share, response = 1.0 - missing / expected, state.response
    response.delayed *= 1.0 - dt / _DELAY_FORGETTING_TIME
    response.prompt *= 1.0 - dt / _DELAY_FORGETTING_TIME
    response.late *= max(1.0 - dt / _LATE_FORGETTING_TIME, 0.0)
    if load > _MIN_LOAD:
        delayed = min(max((_PROMPT - share) / (_PROMPT - _DELAYED), 0.0), 1.0)
        response.delayed = max(response.delayed, delayed)
        response.prompt = max(response.prompt, 1.0 - delayed)
        late = min(max((_PUNCTUAL - share) / (_PUNCTUAL - _LATE), 0.0), 1.0)
        response.late = max(response.late, late)
    reached = min(max(share, 0.0), 1.0) * min(load, 1.0)
    if load > _MIN_LOAD and share > _FOLLOWED and response.excess_ratio < 0.0:
        response.excess_ratio *= 1.0 - dt / (dt + _PROBING_TIME)
    change = max(reached, _MIN) - reached_share(state)
    if load > _MIN_LOAD and (change > 0.0 or share < _DEFICIT):
        response.excess_ratio += dt / (dt + (_RISE if change > 0.0 else _REACTION)) * change
    else:
        response.excess_ratio *= 1.0 - dt / _FORGETTING_TIME
