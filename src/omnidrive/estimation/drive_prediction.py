"""Prediction of motion, covariances and sensitivities for one delay, over one sample."""

from __future__ import annotations

from math import cos, sin, sqrt

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.drive_response import (
    DriveModel,
    axis_slopes,
    respond,
    unit_of,
)
from omnidrive.estimation.identification_state import LAG, PARAMETERS, YAW_LAG, Hypothesis
from omnidrive.robot.slip import Vector

_MIN_LAG_STEP, _MIN_GAIN_STEP = 0.005, 1e-6
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
    least = _MIN_LAG_STEP if parameter >= LAG else _MIN_GAIN_STEP
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

    The rates are the :func:`inverse_lags` of the model. The first variant is the motion for the
    estimates, variant i + 1 that for parameter i larger by a step.
    """
    motions = h.motions
    _set_variants(h)
    saturation = respond(model, rates, motions, h.delay, commands, dt)
    _predict_covariances(model, rates, h, saturation, dt)
    x, y, yaw = motions.poses[0]
    _, _, c, s = motions.headings[0]
    for i in range(PARAMETERS):
        sens, delta = h.sensitivity[:, :, i], _step(h, i)
        dx = sens[0, 0] + (motions.poses[i + 1, 0] - x) / delta
        dy = sens[0, 1] + (motions.poses[i + 1, 1] - y) / delta
        sens[0, 0], sens[0, 1] = c * dx + s * dy, c * dy - s * dx
        sens[0, 2] = (motions.poses[i + 1, 2] - yaw) / delta
        for a in range(3):
            sens[1, a] = (motions.motors[i + 1, a] - motions.motors[0, a]) / delta
            sens[2, a] = (motions.twists[i + 1, a] - motions.twists[0, a]) / delta
            sens[3, a] = (motions.disturbances[i + 1, a] - motions.disturbances[0, a]) / delta
    pose = h.pose
    c, s = cos(pose[2]), sin(pose[2])
    pose[0] += c * x - s * y
    pose[1] += s * x + c * y
    pose[2] += yaw
    for a in range(3):
        h.states[0, a] = motions.motors[0, a]
        h.states[1, a] = motions.twists[0, a]
        h.states[2, a] = motions.disturbances[0, a]
    h.figures[3] = saturation


@compiled
def _set_variants(h: Hypothesis) -> None:
    """Set drives and initial motions of all variants."""
    motions, states, sens, p = h.motions, h.states, h.sensitivity, h.parameters
    for k in range(len(motions.drives)):
        i, delta, drive = max(k - 1, 0), 0.0, motions.drives[k]
        for j in range(LAG + 1):
            drive[j] = p[j]
        drive[YAW_LAG] = p[LAG] + p[YAW_LAG]
        if k > 0:
            delta = _step(h, i)
            drive[i] += delta
            if i == LAG:
                drive[YAW_LAG] += delta
        for a in range(3):
            motions.poses[k, a] = 0.0
            motions.motors[k, a] = states[0, a] + delta * sens[1, a, i]
            motions.twists[k, a] = states[1, a] + delta * sens[2, a, i]
            motions.disturbances[k, a] = states[2, a] + delta * sens[3, a, i]
        turn = delta * sens[0, 2, i]
        motions.poses[k, 2] = turn
        motions.headings[k, 0] = motions.headings[k, 2] = cos(turn)
        motions.headings[k, 1] = motions.headings[k, 3] = sin(turn)


@compiled
def _predict_covariances(
    model: DriveModel, rates: Vector, h: Hypothesis, saturation: float, dt: float
) -> None:
    """Predict the covariance of the states of every axis.

    An acceleration that changes within the sample, with the variance q over the sample, adds
    q dt^2 / 3, q dt / 2 and q to the variance of displacement and twist. One that is constant in
    the sample would add q dt^2 / 4: exact poses would then make the estimated twist oscillate.
    """
    bx, by, bw = h.motions.twists[0]
    turning = abs(bw) / unit_of(model, 2)
    velocity = _VELOCITY + _RIPPLE * sqrt(bx * bx + by * by) + _TURN_RIPPLE * turning
    time = sqrt(dt * _RIPPLE_TIME)
    acceleration = _ACCELERATION + _SLIP_ACCELERATION * saturation
    slipping = _SLIP_ACCELERATION * saturation * time
    for a in range(3):
        p, unit = h.state_covariance[a], unit_of(model, a)
        m, n, f, g = axis_slopes(rates[a], saturation, dt)
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
