"""Observer of pose, body twist and disturbance, from measured poses and earlier commands."""

from __future__ import annotations

from math import ceil, copysign, cos, inf, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.motion.caution import cautious_drift
from omnidrive.estimation.motion.disturbance import disturbance_at, disturbance_scale
from omnidrive.estimation.motion.motion_memory import MotionMemory
from omnidrive.estimation.motion.pose_noise import (
    estimate_noise,
    noisy_share,
    pose_variance,
    position_variance,
)
from omnidrive.geometry.arc import arc_velocity
from omnidrive.geometry.kernels import wrap_angle
from omnidrive.robot.drive_model import DriveModel, axis_unit
from omnidrive.robot.lag_response import MIN_LAG, mean_decay
from omnidrive.robot.slip import Vector
from omnidrive.robot.slip_response import respond, slip_response

_DISPLACEMENT = 0.02
"""Standard deviation of the mean velocity of a sample that the model does not explain, m/s."""
_ACCELERATION = 0.3
"""Standard deviation of the acceleration that the model does not explain, m/s^2."""
_SLIP_ACCELERATION = 1.0
"""Likewise with all wheels at the friction limit, m/s^2."""
STEADY_SATURATION = 0.05
"""Share of wheels at the friction limit above which the disturbance is not corrected."""
_MAX_SLIP_TIME = 0.5
"""Time, s, of wheels that slip with the disturbance only, until it counts as wrong; half the time
where they would slip without it, too."""
_DRIFT = 0.04
"""Standard deviation of the change of the disturbance in a second, m/s."""
_NOISY_TRANSLATION, _NOISY_ROTATION = (0.01, 0.008, 1.0), (0.003, 0.001, 0.0)
"""Displacement and drift where poses are noisy, and the rate at which the disturbance decays there,
in 1/s. The model is trusted more than with exact poses, where distrust costs nothing."""
_NOISY_TIME = 0.8
"""Longest time constant with which the position follows noisy poses, s."""
_LARGEST = 0.1
"""Largest disturbance, as a share of the speed limit."""
_GATE = 6.0
"""Standard deviations beyond which a measured pose is one of a robot that was moved."""
_MOTOR_STEP = 0.025
"""Largest time in which the input of the model is the mean of the motors' twist, s."""
_ROUNDING = 1e-9
"""Share of a sample time that is taken for rounding."""


class SlipShares(NamedTuple):
    """Mean share of wheels at the friction limit, 0 to 1."""

    disturbed: float
    """With the estimated disturbance."""
    undisturbed: float
    """Without it."""


@compiled
def whole_periods(delay: float, period: float) -> int:
    """Return the number of whole sample times in a delay."""
    return int(delay / period + _ROUNDING)


@compiled
def predict(model: DriveModel, memory: MotionMemory, dt: float, period: float) -> SlipShares:
    """Predict the motion over ``dt`` (s), the time since the latest command.

    The sample time is ``period`` (s).
    """
    delay, shares = memory.state[0].drive.delay, SlipShares(0.0, 0.0)
    drift = _drift(memory.state[0], period)
    latest = whole_periods(delay, period)
    older = min(delay - latest * period, dt)
    if older > _ROUNDING * period:
        shares = _predict_one(model, memory, latest + 1, older, drift)
    if dt > older:
        newer = _predict_one(model, memory, latest, dt - older, drift)
        disturbed = max(shares.disturbed, newer.disturbed)
        shares = SlipShares(disturbed, max(shares.undisturbed, newer.undisturbed))
    return shares


@compiled
def _drift(state: Any, period: float) -> float:
    """Return the drift of the disturbance with exact poses, m/s in a second."""
    return float(_DRIFT + state.caution * (cautious_drift(_DRIFT, period) - _DRIFT))


@compiled
def _predict_one(
    model: DriveModel, memory: MotionMemory, command: int, dt: float, exact_drift: float
) -> SlipShares:
    """Predict state and covariance over ``dt`` (s) with one command, as :func:`predict`."""
    state, share, undisturbed = memory.state[0], 0.0, 0.0
    steps, h = _motor_steps(state.drive, dt)
    for _ in range(steps):
        mean, motors = _motor_response(memory, command, _vector(state.motors), h)
        for a in range(3):
            state.motors[a] = motors[a]
        held = _predict_held(model, state, mean, h, exact_drift)
        share, undisturbed = share + held.disturbed / steps, undisturbed + held.undisturbed / steps
    return SlipShares(share, undisturbed)


@compiled
def _motor_steps(drive: Any, dt: float) -> tuple[int, float]:
    """Return the number and the length (s) of the steps in ``dt`` (s) with a constant input."""
    steps = 1 if max(drive.lag, drive.yaw_lag) < MIN_LAG else ceil(dt / _MOTOR_STEP - _ROUNDING)
    return steps, dt / steps


@compiled
def _motor_response(
    memory: MotionMemory, command: int, motors: Vector, dt: float
) -> tuple[Vector, Vector]:
    """Return mean and final value of the motors' twist over ``dt`` (s) with one command."""
    sent, drive = memory.commands[command], memory.state[0].drive
    share, decay = mean_decay(drive.lag, dt)
    yaw_share, yaw_decay = mean_decay(drive.yaw_lag, dt)
    gains = drive.gains
    x, y, yaw = gains[0] * sent[0], gains[1] * sent[1], gains[2] * sent[2]
    dx, dy, dw = motors[0] - x, motors[1] - y, motors[2] - yaw
    mean = (x + share * dx, y + share * dy, yaw + yaw_share * dw)
    return mean, (x + decay * dx, y + decay * dy, yaw + yaw_decay * dw)


@compiled
def _predict_held(
    model: DriveModel, state: Any, motors: Vector, dt: float, exact_drift: float
) -> SlipShares:
    """Predict state and covariance over ``dt`` (s) with a constant twist of the motors.

    The drift of the disturbance with exact poses is ``exact_drift``, m/s in a second.
    """
    initial, commanded = _vector(state.twist), _disturbed(model, state, motors)
    mean, final, derivatives = respond(model, initial, commanded, dt)
    _move(state.pose, mean, dt)
    acceleration = _ACCELERATION + _SLIP_ACCELERATION * derivatives.saturation
    for a in range(3):
        unit, noisy = axis_unit(model, a), noisy_share(model, state, a)
        displacement, drift, decay = _NOISY_ROTATION if a == 2 else _NOISY_TRANSLATION
        displacement = _DISPLACEMENT + noisy * (displacement - _DISPLACEMENT)
        drift, kept = exact_drift + noisy * (drift - exact_drift), 1.0 / (1.0 + noisy * decay * dt)
        free = unit * acceleration * dt  # the lag removes part of it
        by_pose = 0.5 * dt * (1.0 - derivatives.mean_by_input[a]) * free
        by_twist = (1.0 - derivatives.final_by_input[a]) * free
        scale = disturbance_scale(model, state, motors[a], a)
        m, n = dt * derivatives.mean_by_initial[a], scale * dt * derivatives.mean_by_input[a]
        f, g = derivatives.final_by_initial[a], scale * derivatives.final_by_input[a]
        p = state.covariance[a]
        # F P F^T with F = [[1, m, n], [0, f, g], [0, 0, kept]], from the columns of F P
        pp, pb, pd, bb, bd, dd = p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2]
        p_d = pd + m * bd + n * dd
        p_b = pb + m * bb + n * bd
        b_d = f * bd + g * dd
        p[0, 0] = pp + m * pb + n * pd + m * p_b + n * p_d + by_pose * by_pose
        p[0, 0] += (unit * displacement * dt) ** 2
        if a < 2:
            p[0, 0] += noisy * position_variance(state) * (dt / _NOISY_TIME) ** 2
        p[0, 1] = f * p_b + g * p_d + by_pose * by_twist
        p[0, 2] = kept * p_d
        p[1, 1] = f * (f * bb + g * bd) + g * b_d + by_twist * by_twist
        p[1, 2] = kept * b_d
        p[2, 2] = kept * kept * dd + (unit * drift) ** 2 * dt
        p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]
        state.disturbance[a] *= kept
    for a in range(3):
        state.twist[a] = final[a]
    if derivatives.saturation <= STEADY_SATURATION:
        return SlipShares(derivatives.saturation, derivatives.saturation)
    _, _, undisturbed = respond(model, initial, motors, dt)
    return SlipShares(derivatives.saturation, undisturbed.saturation)


@compiled
def correct(  # noqa: PLR0917
    model: DriveModel,
    state: Any,
    pose: Vector,
    variances: Vector,
    dt: float,
    shares: SlipShares,
    steady: bool,
) -> None:
    """Correct the prediction by a measured pose: a Kalman filter for every axis of B.

    The disturbance is that of Pannocchia & Rawlings, AIChE J. 49, 2003, here of the input.

    Args:
        model: The model.
        state: The prediction; corrected in place.
        pose: Measured pose in W.
        variances: Of the measured displacements along the axes of B, m^2, m^2 and rad^2;
            negative: unknown, estimated from the innovations.
        dt: Sample time, in s.
        shares: Of wheels at the friction limit, as :func:`predict` returns them. While wheels slip,
            the disturbance is constant; if they go on to slip, it may decrease.
        steady: Whether the disturbance may be corrected; otherwise it may decrease.
    """
    yaw = state.pose[2]
    c, s = cos(yaw), sin(yaw)
    dx, dy = pose[0] - state.pose[0], pose[1] - state.pose[1]
    innovation = (c * dx + s * dy, c * dy - s * dx, wrap_angle(pose[2] - yaw))
    moved, change = _is_moved(model, state, innovation, variances, dt), np.zeros(3)
    is_repeated = moved and _is_repeated_displacement(model, state, innovation, dt)
    if not moved:
        estimate_noise(model, state, innovation)
    _count_slips(state, shares, dt if steady else 0.0)
    for a in range(3):
        p, variance = state.covariance[a], pose_variance(model, state, variances, a)
        total = p[0, 0] + variance
        state.noise.residual[a], state.jump[a] = 0.0, 0.0
        if moved:
            change[a] = state.jump[a] = innovation[a]
            if is_repeated:
                state.twist[a] += innovation[a] / dt
                inflate_twist_variance(model, state, a, dt)
            continue
        gain = _disturbance_gain(state, a, innovation[a], total, shares, steady)
        gains = (p[0, 0] / total, p[1, 0] / total, gain)
        change[a] = gains[0] * innovation[a]
        state.noise.residual[a] = innovation[a] - change[a]
        state.twist[a] += gains[1] * innovation[a]
        disturbance = state.disturbance[a] + gains[2] * innovation[a]
        max_disturbance = _LARGEST * model.max_rim_speed * axis_unit(model, a)
        state.disturbance[a] = min(max(disturbance, -max_disturbance), max_disturbance)
        _reduce(p, gains, variance)
    state.pose[0] += c * change[0] - s * change[1]
    state.pose[1] += s * change[0] + c * change[1]
    state.pose[2] += change[2]


@compiled
def _disturbance_gain(  # noqa: PLR0917
    state: Any, axis: int, innovation: float, total: float, shares: SlipShares, steady: bool
) -> float:
    """Return the gain of the disturbance, at most to zero where the motion is not steady.

    See :func:`correct`; ``total`` is the variance of the innovation.
    """
    gain, disturbance = state.covariance[axis, 2, 0] / total, state.disturbance[axis]
    to_zero = gain * innovation * disturbance < 0.0
    wrong = state.slip_time > _MAX_SLIP_TIME and to_zero
    if not (shares.disturbed <= STEADY_SATURATION or wrong) or not (steady or to_zero):
        return 0.0
    if steady:
        return float(gain)
    return copysign(min(abs(gain), abs(disturbance / innovation)), gain)


@compiled
def _is_moved(
    model: DriveModel, state: Any, innovation: Vector, variances: Vector, dt: float
) -> bool:
    """Return whether a measured pose is an outlier, or that of a robot that was moved."""
    for a in range(3):
        total = state.covariance[a, 0, 0] + pose_variance(model, state, variances, a)
        gate = _GATE * sqrt(total) + _max_unmodelled_displacement(model, dt, a)
        if abs(innovation[a]) > gate:
            return True
    return False


@compiled
def _count_slips(state: Any, shares: SlipShares, dt: float) -> None:
    """Count the time for which wheels slip, half where they would slip without the disturbance.

    A time of 0 sets it to zero.
    """
    if shares.disturbed <= STEADY_SATURATION or dt == 0.0:
        state.slip_time = 0.0
    else:
        state.slip_time += dt if shares.undisturbed <= STEADY_SATURATION else 0.5 * dt


@compiled
def _is_repeated_displacement(model: DriveModel, state: Any, innovation: Vector, dt: float) -> bool:
    """Return whether the robot is moved about as far as before: its twist is wrong.

    An outlier, in contrast, is followed by the same displacement back, or is too far away.
    """
    x, y, yaw = state.jump[0], state.jump[1], state.jump[2]
    turned = (0.5 * (abs(x) + abs(y)), 0.5 * (abs(x) + abs(y)), 0.5 * abs(yaw))
    for a in range(3):
        farthest = 2.0 * dt * model.max_rim_speed * axis_unit(model, a)
        change = abs(innovation[a] - state.jump[a])
        if (
            abs(innovation[a]) > farthest
            or change > _max_unmodelled_displacement(model, dt, a) + turned[a]
        ):
            return False
    return True


@compiled
def correct_twist(model: DriveModel, state: Any, twist: Vector, dt: float) -> None:
    """Replace the twist by an estimated one, unless the robot cannot have changed to it.

    Such a twist is an outlier, or that after a collision, which the next poses show.

    Args:
        model: The model.
        state: The state, after the correction by the pose; changed in place.
        twist: Estimated body twist.
        dt: Sample time, in s.
    """
    for a in range(3):
        max_change = (
            _GATE * sqrt(state.covariance[a, 1, 1])
            + _max_unmodelled_displacement(model, dt, a) / dt
        )
        if abs(twist[a] - state.twist[a]) > max_change:
            return
    for a in range(3):
        p = state.covariance[a]
        state.twist[a] = twist[a]
        p[0, 1] = p[1, 0] = p[1, 1] = p[1, 2] = p[2, 1] = 0.0


@compiled
def inflate_twist_variance(model: DriveModel, state: Any, axis: int, dt: float) -> None:
    """Raise the standard deviation of the twist to the change that is possible in ``dt`` (s)."""
    sigma, p = _max_unmodelled_displacement(model, dt, axis) / dt, state.covariance[axis]
    p[1, 1] = max(p[1, 1], sigma * sigma)


@compiled
def _reduce(p: Float[Array, "3 3"], gains: Vector, variance: float) -> None:
    """Correct a covariance: Joseph's form, for gains that need not be optimal."""
    row = (p[0, 0], p[0, 1], p[0, 2])
    for i in range(3):
        for j in range(i, 3):
            p[i, j] += gains[i] * gains[j] * (row[0] + variance)
            p[i, j] -= gains[i] * row[j] + gains[j] * row[i]
            p[j, i] = p[i, j]


@compiled
def predict_delayed(
    model: DriveModel, memory: MotionMemory, period: float
) -> tuple[Vector, Vector, Vector]:
    """Return pose, body twist and twist of the motors when the next command takes effect.

    Delay compensation: the motion that the commands already sent cause within the delay.
    """
    state = memory.state[0]
    pose, twist, motors = state.pose.copy(), _vector(state.twist), _vector(state.motors)
    delay = state.drive.delay
    count = whole_periods(delay, period)
    for k in range(count, -1, -1):
        dt = delay - count * period if k == count else period
        if dt > _ROUNDING * period:
            steps, h = _motor_steps(state.drive, dt)
            for _ in range(steps):
                held, motors = _motor_response(memory, k, motors, h)
                mean, twist = slip_response(model, twist, _disturbed(model, state, held), h)
                _move(pose, mean, h)
    return _vector(pose), twist, motors


@compiled
def _disturbed(model: DriveModel, state: Any, motors: Vector) -> Vector:
    """Return a twist of the motors plus the disturbance."""
    disturbance = disturbance_at(model, state, motors)
    return motors[0] + disturbance[0], motors[1] + disturbance[1], motors[2] + disturbance[2]


@compiled
def _move(pose: Float[Array, " 3"], twist: Vector, dt: float) -> None:
    """Move a pose by a constant body twist over ``dt`` (s), in place."""
    vx, vy = arc_velocity(dt, pose[2], twist[0], twist[1], twist[2])
    pose[0] += dt * vx
    pose[1] += dt * vy
    pose[2] += dt * twist[2]


@compiled
def _vector(values: Float[Array, " 3"]) -> Vector:
    return values[0], values[1], values[2]


@compiled
def _max_unmodelled_displacement(model: DriveModel, dt: float, axis: int) -> float:
    """Return the largest displacement, m or rad, in ``dt`` (s) that the model may not explain.

    It is that of twice the acceleration at the friction limit; without forces, that of the speed.
    """
    distance = 2.0 * dt * model.max_rim_speed
    if model.max_force < inf:
        acceleration = len(model.rim_jacobian) * model.max_force / model.inertia[0]
        distance = min(distance, acceleration * dt * dt)
    return distance * axis_unit(model, axis)
