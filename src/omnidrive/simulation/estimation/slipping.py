"""How far wheels slip while they drag the robot along."""

from __future__ import annotations

from math import ceil, isfinite

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.simulation.estimation.motion_model import MotionModel, Odometry

_STEP = 1e-3
"""Of the integration, in s: well below the time in which a robot follows wheels that hold."""


@compiled
def slipped(
    velocity: Float[Array, " 3"], odometry: Odometry, model: MotionModel
) -> tuple[Float[Array, " wheels"], Float[Array, " 3"], Float[Array, " 3"]]:
    """Ways in m by which the rims slip; the robot's mean and last twist.

    Servos turn wheels at once as they are told, and the robot follows by friction: each wheel
    pushes in proportion to the speed of its rim over the floor, and no more than it grips
    (Pacejka, "Tire and Vehicle Dynamics", 3rd ed. 2012, section 1.2)::

        f_i = clip(stiffness (rim_i - rims_i b), -push_i, push_i)
        push_i = min(grip_i + shift_i rims^T f, motor)
        inertia (db/dt + w x b) = rims^T f

    with the body twist b, of yaw rate w; what acceleration shifts of the loads, axles hand on at
    once. A wheel whose speed is not known does not push.

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
    pull = np.zeros(3)
    for _ in range(steps):
        fx, fy = pull[0], pull[1]
        pull[0], pull[1], pull[2] = 0.0, 0.0, 0.0
        for i in range(wheels):
            if isfinite(odometry.ways[i]):
                gap = odometry.ways[i] / odometry.duration
                for a in range(3):
                    gap -= model.rim_jacobian[i, a] * now[a]
                lost[i] += gap * h
                grip = (
                    model.friction_limits[i]
                    + model.load_transfer[i, 0] * fx
                    + model.load_transfer[i, 1] * fy
                )
                most = min(max(grip, 0.0), model.motor)
                push = min(max(model.stiffness * gap, -most), most)
                for a in range(3):
                    pull[a] += push * model.rim_jacobian[i, a]
        x, y, turn = now[0], now[1], now[2]
        now[0] = x + h * (pull[0] / model.inertia[0] + turn * y)
        now[1] = y + h * (pull[1] / model.inertia[1] - turn * x)
        now[2] = turn + h * pull[2] / model.inertia[2]
        for a in range(3):
            mean[a] += now[a] / steps
    return lost, mean, now
