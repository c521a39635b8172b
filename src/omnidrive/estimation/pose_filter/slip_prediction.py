"""Prediction of wheel slip while the wheels accelerate the robot."""

from __future__ import annotations

from math import ceil, isfinite

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry
from omnidrive.robot.slip import friction_limit, slip_velocity

_STEP = 1e-3
"""Integration step, s; well below the time constant with which a robot follows its wheels."""


@compiled
def predict_slip(
    velocity: Float[Array, " 3"],
    odometry: Odometry,
    jacobian: Float[Array, "wheels 3"],
    model: MotionModel,
) -> tuple[Float[Array, " wheels"], Float[Array, " 3"], Float[Array, " 3"]]:
    """Return each rim's slip displacement (m), the mean body twist and the last one.

    The wheels follow their servos without delay, and friction accelerates the robot as in
    :func:`~omnidrive.robot.slip.slip_velocity`, with::

        forces_i = stiffness (rim speed_i - rim_jacobian_i b)
        limits_i = min(friction limit_i + load transfer_i jacobian^T f, motor limit)

    where b is the body twist and f are the wheel forces of the previous step: acceleration
    transfers load between the wheels. A wheel of unknown speed exerts no force.

    Args:
        velocity: Twist of B in B at the start of the interval; m/s, m/s, rad/s.
        odometry: Wheel displacements; the rim speeds are taken as constant over the interval.
        jacobian: Rim speed of each wheel per unit of body twist; 1, 1 and m/rad.
        model: If its friction limits are not finite, no wheel slips: the slip and the mean twist
            are zero, and the last twist is ``velocity``.
    """
    wheels = len(odometry.displacements)
    slip, mean, last = np.zeros(wheels), np.zeros(3), velocity.copy()
    if not isfinite(model.friction_limits[0]):
        return slip, mean, last
    steps = ceil(odometry.duration / _STEP)
    h = odometry.duration / steps
    forces, limits = np.zeros(wheels), np.zeros(wheels)
    twist, wrench = (last[0], last[1], last[2]), (0.0, 0.0, 0.0)
    for _ in range(steps):
        for i in range(wheels):
            if isfinite(odometry.displacements[i]):
                slip_speed = odometry.displacements[i] / odometry.duration
                for a in range(3):
                    slip_speed -= jacobian[i, a] * twist[a]
                slip[i] += slip_speed * h
                forces[i] = model.stiffness * slip_speed
                limits[i] = friction_limit(
                    model.friction_limits[i], model.load_transfer[i], wrench, model.motor_limit
                )
        twist, wrench = slip_velocity(twist, forces, limits, jacobian, model.inertia, h)
        for a in range(3):
            mean[a] += twist[a] / steps
    last[0], last[1], last[2] = twist
    return slip, mean, last
