"""Ratio of the robot's acceleration to the planned one, and of its response in time."""

from __future__ import annotations

from math import cos, isfinite, isnan, nan, sin
from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.motion.pose_noise import position_variance
from omnidrive.geometry.arc import arc_velocity
from omnidrive.geometry.kernels import wrap_angle
from omnidrive.robot.drive_model import DriveModel
from omnidrive.robot.slip import Vector

_ASSUMED, _MIN, _MIN_IN_APPROACH = 0.7, 0.2, 0.3
"""Share that is assumed without evidence, the least one, and that of approaches, in which a delay
that is not identified yet looks like little friction."""
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
_DELAYED_RATIO, _ABSENT_RATIO, _DELAY_FORGETTING_TIME = 0.6, 0.3, 10.0
"""Factors of the speed per distance for a delayed and for an absent response, and time constant in
s with which both are forgotten."""
_PRESENT, _ABSENT = 0.1, 0.05
"""As :data:`_PROMPT` and :data:`_DELAYED`, for a response in the sample of a command at all."""
_ONSET = 0.1
"""Acceleration over the next one, up to which the next one is the first."""
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
def approach_share(state: Any) -> float:
    """Return the share of the limits of acceleration with which an approach brakes, 0 to 1."""
    return max(reached_share(state), _MIN_IN_APPROACH)


@compiled
def limit_ratio(state: Any) -> float:
    """Return the factor of the limits of acceleration for plans: 1 without evidence for less."""
    return min(1.0, reached_share(state) / _ASSUMED)


@compiled
def response_ratio(state: Any) -> float:
    """Return the factor of speed per distance for a response that may be delayed, up to 1."""
    delayed, absent = float(state.response.delayed), float(state.response.absent)
    return 1.0 - (1.0 - _DELAYED_RATIO) * delayed - (_DELAYED_RATIO - _ABSENT_RATIO) * absent


@compiled
def shows_no_delay(state: Any) -> float:
    """Return 1 where accelerations have been followed at once, 0 without or against evidence."""
    return float(state.response.prompt) * (1.0 - float(state.response.delayed))


@compiled
def is_late(state: Any) -> bool:
    """Return whether the robot has responded later than predicted within the last second or so."""
    return bool(state.response.late > 0.5)


@compiled
def acceleration_load(faces: Float[Array, "faces 3"], vector: Vector) -> float:
    """Return the largest component of a vector in B along the normals of the limits.

    Of an acceleration, that over its limit: ``|faces @ acceleration| <= 1``.
    """
    load = 0.0
    for j in range(len(faces)):
        component = faces[j, 0] * vector[0] + faces[j, 1] * vector[1] + faces[j, 2] * vector[2]
        load = max(load, abs(component))
    return load


@compiled
def update_reached(  # noqa: PLR0917
    model: DriveModel,
    faces: Float[Array, "faces 3"],
    state: Any,
    pose: Vector,
    twist: Vector,
    measured: Vector,
    dt: float,
    steady: bool,
) -> None:
    """Update the share of the limits of acceleration that the robot has reached.

    On a slippery floor the robot accelerates less than the model predicts as long as more is
    demanded. The share follows such deficits within a tenth of a second, and rises at once where
    the robot is seen to accelerate more. A displacement that is smaller than predicted by one
    sample shows a lag or a delay that the model does not have, and is remembered for seconds.

    Args:
        model: The model.
        faces: Limits of acceleration, ``|faces @ acceleration| <= 1`` in B.
        state: The prediction for the time of the measurement.
        pose: Estimated pose a sample before.
        twist: Estimated body twist a sample before.
        measured: Measured pose.
        dt: Time since then, in s.
        steady: Whether no distant target is approached.
    """
    change = (
        (state.twist[0] - twist[0]) / dt,
        (state.twist[1] - twist[1]) / dt,
        (state.twist[2] - twist[2]) / dt,
    )
    response, load = state.response, acceleration_load(faces, change)
    share = _displacement_ratio(model, state, pose, twist, measured, dt)
    ratio, mean_load = _acceleration_ratio(model, faces, state, pose, twist, measured, dt)
    is_first, response.load = response.load <= _ONSET * load, load
    if isnan(share):
        return
    _update_delay(response, share, load, is_first, dt)
    reached = min(max(ratio, 0.0), 1.0) * min(mean_load, 1.0)
    if mean_load > _MIN_LOAD and ratio > _FOLLOWED and response.excess_ratio < 0.0:
        response.excess_ratio *= 1.0 - dt / (dt + _PROBING_TIME)
    excess = max(reached, _MIN if steady else _MIN_IN_APPROACH) - reached_share(state)
    if mean_load > _MIN_LOAD and (excess > 0.0 or ratio < _DEFICIT):
        response.excess_ratio += dt / (dt + (_RISE if excess > 0.0 else _REACTION)) * excess
    else:
        response.excess_ratio *= 1.0 - dt / _FORGETTING_TIME


@compiled
def forget_response(state: Any) -> None:
    """Forget what has been seen of accelerations."""
    response = state.response
    response.excess_ratio = response.delayed = response.absent = 0.0
    response.late = response.prompt = 0.0


@compiled
def _update_delay(response: Any, share: float, load: float, is_first: bool, dt: float) -> None:
    """Update how much the response is delayed, absent, late or prompt.

    Args:
        response: A record of :data:`~.motion_memory.RESPONSE`; changed in place.
        share: :func:`_displacement_ratio` of the sample.
        load: Predicted acceleration of the sample over its limits.
        is_first: Whether the robot did not accelerate before.
        dt: Length of the sample, s.
    """
    kept = 1.0 - dt / _DELAY_FORGETTING_TIME
    response.delayed *= kept
    response.absent *= kept
    response.prompt *= kept
    response.late *= max(1.0 - dt / _LATE_FORGETTING_TIME, 0.0)
    if load <= _MIN_LOAD:
        return
    delayed = _between(share, _PROMPT, _DELAYED)
    response.delayed = max(response.delayed, delayed)
    response.prompt = max(response.prompt, 1.0 - delayed)
    response.late = max(response.late, _between(share, _PUNCTUAL, _LATE))
    if is_first:
        response.absent = max(response.absent, _between(share, _PRESENT, _ABSENT))


@compiled
def _between(share: float, high: float, low: float) -> float:
    """Return 0 at ``high`` or above to 1 at ``low`` or below."""
    return float(min(max((high - share) / (high - low), 0.0), 1.0))


@compiled
def _displacement_ratio(  # noqa: PLR0917
    model: DriveModel, state: Any, pose: Vector, twist: Vector, measured: Vector, dt: float
) -> float:
    """Return the displacement by acceleration in a sample over the predicted one.

    NaN where it is no larger than the noise of the poses. Arguments as of :func:`update_reached`.
    """
    changes = _accelerated_displacement(state, pose, twist, dt)
    missing, expected = 0.0, 0.0
    for a in range(3):
        error = state.pose[a] - measured[a]
        if a == 2:
            error = wrap_angle(error)
        missing += model.inertia[a] * changes[a] * error
        expected += model.inertia[a] * changes[a] * changes[a]
    if expected <= _NOISE_RATIO * model.inertia[0] * position_variance(state):
        return nan
    return 1.0 - missing / expected


@compiled
def _accelerated_displacement(state: Any, pose: Vector, twist: Vector, dt: float) -> Vector:
    """Return the predicted displacement in W minus that with a constant body twist; m, m, rad."""
    vx, vy = arc_velocity(dt, pose[2], twist[0], twist[1], twist[2])
    x, y, yaw = state.pose[0] - pose[0], state.pose[1] - pose[1], state.pose[2] - pose[2]
    return x - dt * vx, y - dt * vy, yaw - dt * twist[2]


@compiled
def _acceleration_ratio(  # noqa: PLR0917
    model: DriveModel,
    faces: Float[Array, "faces 3"],
    state: Any,
    pose: Vector,
    twist: Vector,
    measured: Vector,
    dt: float,
) -> tuple[float, float]:
    """Return the measured over the predicted acceleration, and the load of the latter.

    Both are differences of the mean velocities of the last two samples in W, which a constant delay
    does not change. The predicted one is the change of the velocity within the last sample as far
    as it moved the robot in this sample, and that of the one before as far as it did not.
    Arguments as of :func:`update_reached`.
    """
    response, after = state.response, state.twist
    c0, s0 = cos(pose[2]), sin(pose[2])
    c, s = cos(state.pose[2]), sin(state.pose[2])
    changes = (
        c * after[0] - s * after[1] - c0 * twist[0] + s0 * twist[1],
        s * after[0] + c * after[1] - s0 * twist[0] - c0 * twist[1],
        after[2] - twist[2],
    )
    accelerated = _accelerated_displacement(state, pose, twist, dt)
    moved = (measured[0] - pose[0], measured[1] - pose[1], wrap_angle(measured[2] - pose[2]))
    reached, demanded, predicted = 0.0, 0.0, response.change
    for a in range(3):
        predicted[a] += accelerated[a] / dt
        reached += model.inertia[a] * predicted[a] * (moved[a] / dt - response.velocity[a])
        demanded += model.inertia[a] * predicted[a] * predicted[a]
        response.velocity[a] = moved[a] / dt
    x, y, yaw = predicted
    load = acceleration_load(faces, ((c * x + s * y) / dt, (c * y - s * x) / dt, yaw / dt))
    for a in range(3):
        predicted[a] = changes[a] - accelerated[a] / dt  # by what the next sample will be faster
    ratio = reached / demanded if demanded > 0.0 else 0.0
    return (ratio, load) if isfinite(ratio + load) else (0.0, 0.0)  # of an outlier
