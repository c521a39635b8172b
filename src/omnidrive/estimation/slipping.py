"""How far wheels slip while they drag the robot along."""

from __future__ import annotations

from math import ceil, isfinite

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.motion_model import MotionModel, Odometry
from omnidrive.robot.slip import slip_velocity

_STEP = 1e-3
"""Of the integration, in s: well below the time in which a robot follows wheels that hold."""


@compiled
def slipped(
    velocity: Float[Array, " 3"], odometry: Odometry, model: MotionModel
) -> tuple[Float[Array, " wheels"], Float[Array, " 3"], Float[Array, " 3"]]:
    """Return each rim's slip in m, and the robot's mean and last body twist.

    The wheels follow their servos without delay, and friction accelerates the robot as in
    :func:`~omnidrive.robot.slip.slip_velocity`, with::

        forces_i = stiffness (rim speed_i - rim_jacobian_i b)
        limits_i = min(friction limit_i + load transfer_i rim_jacobian^T f, motor limit)

    where b is the body twist and f the wheel forces of the step before: acceleration transfers
    loads between the wheels. A wheel of unknown speed exerts no force.

    Args:
        velocity: Twist at first, in B.
        odometry: The wheels' ways; their speeds are taken to be even.
        model: With grips that are not finite no wheel ever slips.
    """
    wheels = len(odometry.ways)
    lost, mean, now = np.zeros(wheels), np.zeros(3), velocity.copy()
    if not isfinite(model.friction_limits[0]):
        return lost, mean, now
    steps = ceil(odometry.duration / _STEP)
    h = odometry.duration / steps
    forces, limits = np.zeros(wheels), np.zeros(wheels)
    twist, (fx, fy, _) = (now[0], now[1], now[2]), (0.0, 0.0, 0.0)
    for _ in range(steps):
        for i in range(wheels):
            if isfinite(odometry.ways[i]):
                gap = odometry.ways[i] / odometry.duration
                for a in range(3):
                    gap -= model.rim_jacobian[i, a] * twist[a]
                lost[i] += gap * h
                friction = (
                    model.friction_limits[i]
                    + model.load_transfer[i, 0] * fx
                    + model.load_transfer[i, 1] * fy
                )
                forces[i] = model.stiffness * gap
                limits[i] = min(max(friction, 0.0), model.motor)
        twist, (fx, fy, _) = slip_velocity(
            twist, forces, limits, model.rim_jacobian, model.inertia, h
        )
        for a in range(3):
            mean[a] += twist[a] / steps
    now[0], now[1], now[2] = twist
    return lost, mean, now
