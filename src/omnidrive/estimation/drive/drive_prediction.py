"""Prediction of motion, covariances and sensitivities for one delay, over one sample."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.drive.identification_state import PARAMETERS, FilterParameters, named
from omnidrive.robot.drive_model import DriveModel, axis_unit
from omnidrive.robot.drive_variants import axis_slopes, respond_variants
from omnidrive.robot.slip import Vector

_MIN_STEPS = FilterParameters(1e-6, 1e-6, 1e-6, 0.005, 0.005)
"""Least steps of the difference quotients by the parameters."""
_LAG_SLOPES = FilterParameters(0.0, 0.0, 0.0, 1.0, 0.0)
"""Derivatives of the lag in x and y by the parameters."""
_YAW_LAG_SLOPES = FilterParameters(0.0, 0.0, 0.0, 1.0, 1.0)
"""Likewise of the lag in yaw."""
_VELOCITY = 0.0005
"""Standard deviation of the velocity that the model does not explain, m/s."""
_RIPPLE, _TURN_RIPPLE = 0.0008, 0.008
"""Likewise per unit of speed and of yaw rate times the radius of gyration: rollers and their rows
change the effective radii."""
_RIPPLE_TIME = 0.05
"""Time for which such an error lasts, s."""
_ACCELERATION = 0.025
"""Standard deviation of the acceleration that the model does not explain, m/s^2."""
_SLIP_ACCELERATION = 2.0
"""Likewise with all wheels at the friction limit, m/s^2."""
_DRIFT = 0.0008
"""Standard deviation of the change of the disturbance in a second, m/s."""


@compiled
def _step(h: Any, parameter: int) -> float:
    """Return the step of the difference quotients by a parameter: its standard error."""
    return max(sqrt(h.covariance[parameter, parameter]), _MIN_STEPS[parameter])


@compiled
def predict(  # noqa: PLR0917
    model: DriveModel, rates: Vector, h: Any, variants: Any, commands: Any, dt: float
) -> None:
    """Predict pose, states, their covariances and their sensitivities over ``dt`` (s).

    The rates are the :func:`inverse_lags` of the model. The first variant is the motion for the
    estimates, variant i + 1 that for parameter i larger by a step.
    """
    _set_variants(h, variants)
    h.saturation = respond_variants(model, rates, variants, h.delay, commands, dt)
    first, sens = variants[0], h.sensitivity
    _predict_covariances(model, rates, h, first.twist, dt)
    x, y, yaw = first.pose
    c, s = first.heading.cos, first.heading.sin
    for i in range(PARAMETERS):
        v, delta = variants[i + 1], _step(h, i)
        moved = sens.displacement
        dx, dy = moved[0, i] + (v.pose[0] - x) / delta, moved[1, i] + (v.pose[1] - y) / delta
        moved[0, i], moved[1, i] = c * dx + s * dy, c * dy - s * dx
        moved[2, i] = (v.pose[2] - yaw) / delta
        for a in range(3):
            sens.motors[a, i] = (v.motors[a] - first.motors[a]) / delta
            sens.twist[a, i] = (v.twist[a] - first.twist[a]) / delta
            sens.disturbance[a, i] = (v.disturbance[a] - first.disturbance[a]) / delta
    pose = h.pose
    c, s = cos(pose[2]), sin(pose[2])
    pose[0] += c * x - s * y
    pose[1] += s * x + c * y
    pose[2] += yaw
    for a in range(3):
        h.motors[a], h.twist[a] = first.motors[a], first.twist[a]
        h.disturbance[a] = first.disturbance[a]


@compiled
def _set_variants(h: Any, variants: Any) -> None:
    """Set drives and initial motions of all variants."""
    p, sens = named(h.parameters), h.sensitivity
    for k in range(len(variants)):
        v, i = variants[k], max(k - 1, 0)
        delta = _step(h, i) if k > 0 else 0.0
        for a in range(3):
            v.gains[a] = p[a] + delta if i == a else p[a]
        v.lag = p.lag + _LAG_SLOPES[i] * delta
        v.yaw_lag = p.lag + p.excess + _YAW_LAG_SLOPES[i] * delta
        for a in range(3):
            v.pose[a] = 0.0
            v.motors[a] = h.motors[a] + delta * sens.motors[a, i]
            v.twist[a] = h.twist[a] + delta * sens.twist[a, i]
            v.disturbance[a] = h.disturbance[a] + delta * sens.disturbance[a, i]
        turn = delta * sens.displacement[2, i]
        v.pose[2] = turn
        v.start.cos = v.heading.cos = cos(turn)
        v.start.sin = v.heading.sin = sin(turn)


@compiled
def _predict_covariances(
    model: DriveModel, rates: Vector, h: Any, twist: Float[Array, " 3"], dt: float
) -> None:
    """Predict the covariance of the states of every axis, for a body twist at the end.

    An acceleration that changes within the sample, with the variance q over the sample, adds
    q dt^2 / 3, q dt / 2 and q to the variance of displacement and twist. One that is constant in
    the sample would add q dt^2 / 4: exact poses would then make the estimated twist oscillate.
    """
    (bx, by, bw), saturation = twist, h.saturation
    turning = abs(bw) / axis_unit(model, 2)
    velocity = _VELOCITY + _RIPPLE * sqrt(bx * bx + by * by) + _TURN_RIPPLE * turning
    time = sqrt(dt * _RIPPLE_TIME)
    acceleration = _ACCELERATION + _SLIP_ACCELERATION * saturation
    slipping = _SLIP_ACCELERATION * saturation * time
    for a in range(3):
        p, unit = h.state_covariance[a], axis_unit(model, a)
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
