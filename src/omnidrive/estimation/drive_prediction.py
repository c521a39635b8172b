"""Prediction of motion, covariances and sensitivities for one delay, over one sample."""

from __future__ import annotations

from math import cos, inf, sin, sqrt

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.drive_memory import LAG, PARAMETERS, YAW_LAG, Hypothesis
from omnidrive.estimation.drive_response import (
    LINEAR,
    SLIPPING,
    WATCHED,
    DriveModel,
    Motion,
    axis_slopes,
    respond,
    unit_of,
)
from omnidrive.robot.slip import Vector

_LEAST_LAG_STEP, _LEAST_GAIN_STEP = 0.005, 1e-6
"""Least steps of the difference quotients by the lag, s, and by a gain."""
_VELOCITY = 0.0005
"""Standard deviation of the velocity that the model does not explain, m/s."""
_RIPPLE, _TURN_RIPPLE = 0.0008, 0.008
"""Likewise per unit of speed and of yaw rate times the radius of gyration: rollers and their rows
change the effective radii."""
_RIPPLE_TIME = 0.05
"""Time for which such an error lasts, s."""
_ACCELERATION = 0.025
"""Standard deviation of the acceleration that the model does not explain, m/s^2."""
_SLIP_ACCELERATION = 8.0
"""Likewise with all wheels at the friction limit, m/s^2."""
_DRIFT = 0.0008
"""Standard deviation of the change of the disturbance in a second, m/s."""


@compiled
def _step(h: Hypothesis, parameter: int) -> float:
    """Return the step of the difference quotients by a parameter: its standard error."""
    least = _LEAST_LAG_STEP if parameter >= LAG else _LEAST_GAIN_STEP
    return max(sqrt(h.covariance[parameter, parameter]), least)


@compiled
def predict(
    model: DriveModel,
    rates: Vector,
    h: Hypothesis,
    commands: Float[Array, "commands 4"],
    dt: float,
) -> None:
    """Predict pose, states, their covariances and their sensitivities over ``dt`` (s).

    The rates are the :func:`inverse_lags` of the model.
    """
    p, pose = h.parameters, h.pose
    start, gains = _motion(h, 0, 0.0), (p[0], p[1], p[2])
    mode = WATCHED if model.max_force < inf else LINEAR
    while True:
        end = respond(
            model, rates, gains, p[LAG], p[LAG] + p[YAW_LAG], h.delay, start, commands, dt, mode
        )
        if mode != WATCHED or end.saturation == 0.0:
            break
        mode = SLIPPING
    if mode == WATCHED:
        mode = LINEAR
    _predict_covariances(model, rates, h, end, dt)
    for i in range(PARAMETERS):
        _predict_sensitivities(model, rates, h, commands, i, end, dt, mode)
    pose[0] += end.displacement[0]
    pose[1] += end.displacement[1]
    pose[2] = end.displacement[2]
    for a in range(3):
        h.states[0, a] = end.motors[a]
        h.states[1, a] = end.twist[a]
        h.states[2, a] = end.disturbance[a]
    h.figures[3] = end.saturation


@compiled
def _motion(h: Hypothesis, parameter: int, delta: float) -> Motion:
    """Return the estimated motion for a parameter that is larger by ``delta``."""
    states, sens, i = h.states, h.sensitivity, parameter
    return Motion(
        (0.0, 0.0, h.pose[2] + delta * sens[0, 2, i]),
        (
            states[0, 0] + delta * sens[1, 0, i],
            states[0, 1] + delta * sens[1, 1, i],
            states[0, 2] + delta * sens[1, 2, i],
        ),
        (
            states[1, 0] + delta * sens[2, 0, i],
            states[1, 1] + delta * sens[2, 1, i],
            states[1, 2] + delta * sens[2, 2, i],
        ),
        (
            states[2, 0] + delta * sens[3, 0, i],
            states[2, 1] + delta * sens[3, 1, i],
            states[2, 2] + delta * sens[3, 2, i],
        ),
        0.0,
    )


@compiled
def _predict_sensitivities(  # noqa: PLR0917
    model: DriveModel,
    rates: Vector,
    h: Hypothesis,
    commands: Float[Array, "commands 4"],
    parameter: int,
    end: Motion,
    dt: float,
    mode: int,
) -> None:
    """Predict the sensitivities to a parameter; ``end`` is the motion for the estimates."""
    p, sens, i = h.parameters, h.sensitivity, parameter
    delta = _step(h, i)
    gains = (
        p[0] + (delta if i == 0 else 0.0),
        p[1] + (delta if i == 1 else 0.0),
        p[2] + (delta if i == 2 else 0.0),
    )
    lag = p[LAG] + (delta if i == LAG else 0.0)
    start = _motion(h, i, delta)
    yaw_lag = lag + p[YAW_LAG] + (delta if i == YAW_LAG else 0.0)
    other = respond(model, rates, gains, lag, yaw_lag, h.delay, start, commands, dt, mode)
    c, s = cos(h.pose[2]), sin(h.pose[2])
    x, y = sens[0, 0, i], sens[0, 1, i]
    dx = c * x - s * y + (other.displacement[0] - end.displacement[0]) / delta
    dy = s * x + c * y + (other.displacement[1] - end.displacement[1]) / delta
    c, s = cos(end.displacement[2]), sin(end.displacement[2])
    sens[0, 0, i], sens[0, 1, i] = c * dx + s * dy, c * dy - s * dx
    sens[0, 2, i] = (other.displacement[2] - end.displacement[2]) / delta
    for a in range(3):
        sens[1, a, i] = (other.motors[a] - end.motors[a]) / delta
        sens[2, a, i] = (other.twist[a] - end.twist[a]) / delta
        sens[3, a, i] = (other.disturbance[a] - end.disturbance[a]) / delta


@compiled
def _predict_covariances(
    model: DriveModel, rates: Vector, h: Hypothesis, end: Motion, dt: float
) -> None:
    """Predict the covariance of the states of every axis.

    An acceleration that changes within the sample, with the variance q over the sample, adds
    q dt^2 / 3, q dt / 2 and q to the variance of displacement and twist. One that is constant in
    the sample would add q dt^2 / 4: exact poses would then make the estimated twist oscillate.
    """
    bx, by, bw = end.twist
    turning = abs(bw) / unit_of(model, 2)
    velocity = _VELOCITY + _RIPPLE * sqrt(bx * bx + by * by) + _TURN_RIPPLE * turning
    time = sqrt(dt * _RIPPLE_TIME)
    acceleration = _ACCELERATION + _SLIP_ACCELERATION * end.saturation
    slipping = _SLIP_ACCELERATION * end.saturation * time
    for a in range(3):
        p, unit = h.state_covariance[a], unit_of(model, a)
        m, n, f, g = axis_slopes(rates[a], end.saturation, dt)
        # F P F^T with F = [[1, m, n], [0, f, g], [0, 0, 1]], from the columns of F P
        pp, pb, pd, bb, bd, dd = p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2]
        p_d = pd + m * bd + n * dd
        p_b = pb + m * bb + n * bd
        b_d = f * bd + g * dd
        free = acceleration * time  # the lag removes part of it
        by_pose = unit * (0.5 * n * free + 0.5 * dt * slipping)
        by_twist = unit * (g * free + slipping)
        p[0, 0] = pp + m * pb + n * pd + m * p_b + n * p_d + 4.0 / 3.0 * by_pose * by_pose
        p[0, 0] += (unit * velocity * time) ** 2
        p[0, 1] = f * p_b + g * p_d + by_pose * by_twist
        p[0, 2] = p_d
        p[1, 1] = f * (f * bb + g * bd) + g * b_d + by_twist * by_twist
        p[1, 2] = b_d
        p[2, 2] = dd + (unit * _DRIFT) ** 2 * dt
        p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]
