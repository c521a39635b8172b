"""Prediction of wheel slip while the wheels accelerate the robot."""

from __future__ import annotations

from math import ceil, exp, isfinite

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry
from omnidrive.robot.slip import friction_limit, slip_velocity

_STEP = 1e-3
"""Integration step, s; well below the time constant with which servos accelerate a robot."""


@compiled
def predict_slip(
    velocity: Float[Array, " 3"],
    odometry: Odometry,
    jacobian: Float[Array, "wheels 3"],
    model: MotionModel,
) -> tuple[Float[Array, " wheels"], Float[Array, " 3"], Float[Array, " 3"]]:
    """Return each rim's slip displacement (m), the mean body twist and the last one.

    Servos accelerate wheels and robot towards constant set points, and friction limits their forces
    as in :func:`~omnidrive.robot.slip.slip_velocity`, with::

        forces_i = stiffness (set point_i - rim_jacobian_i b)
        limits_i = min(friction limit_i + load transfer_i jacobian^T f, motor limit)
        rim speed_i = set point_i - clip(forces_i) / stiffness

    where b is the body twist and f are the wheel forces of the previous step: acceleration
    transfers load between the wheels. A wheel below its limit thus rolls without slip; its inertia
    is neglected. A wheel of unknown speed exerts no force.

    Args:
        velocity: Twist of B in B at the start of the interval; m/s, m/s, rad/s.
        odometry: Wheel displacements, from which the set points follow, see :func:`_set_points`.
        jacobian: Rim speed of each wheel per unit of body twist; 1, 1 and m/rad.
        model: If its friction limits are not finite, no wheel slips: the slip and the mean twist
            are zero, and the last twist is ``velocity``.
    """
    wheels = len(odometry.displacements)
    slip, mean, last = np.zeros(wheels), np.zeros(3), velocity.copy()
    if not isfinite(model.friction_limits[0]):
        return slip, mean, last
    set_points = _set_points(velocity, odometry, jacobian, model)
    steps = ceil(odometry.duration / _STEP)
    h = odometry.duration / steps
    forces, limits = np.zeros(wheels), np.zeros(wheels)
    twist, wrench = (last[0], last[1], last[2]), (0.0, 0.0, 0.0)
    for _ in range(steps):
        for i in range(wheels):
            if isfinite(set_points[i]):
                lag = set_points[i]
                for a in range(3):
                    lag -= jacobian[i, a] * twist[a]
                forces[i] = model.stiffness * lag
                limits[i] = friction_limit(
                    model.friction_limits[i], model.load_transfer[i], wrench, model.motor_limit
                )
                held = limits[i] / model.stiffness
                slip[i] += (lag - min(max(lag, -held), held)) * h
        twist, wrench = slip_velocity(twist, forces, limits, jacobian, model.inertia, h)
        for a in range(3):
            mean[a] += twist[a] / steps
    last[0], last[1], last[2] = twist
    return slip, mean, last


@inlined
def _set_points(
    velocity: Float[Array, " 3"],
    odometry: Odometry,
    jacobian: Float[Array, "wheels 3"],
    model: MotionModel,
) -> Float[Array, " wheels"]:
    """Return the speeds of the rims that the servos track, m/s; NaN if unknown.

    A robot that follows with the time constant T reaches the mean speed of an interval before its
    end: the change of the set point is ``1 / (1 - T (1 - exp(-dt / T)) / dt)`` times that of the
    mean, with dt the time between two readings.
    """
    ratio = odometry.duration / odometry.fraction / model.following_time
    gain = 1.0 / (1.0 - (1.0 - exp(-ratio)) / ratio)
    set_points = np.empty(len(jacobian))
    for i in range(len(jacobian)):
        before = 0.0
        for a in range(3):
            before += jacobian[i, a] * velocity[a]
        mean = odometry.displacements[i] / odometry.duration
        set_points[i] = before + gain * (mean - before)
    return set_points
