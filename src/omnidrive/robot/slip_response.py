"""Response of a :class:`~.drive_model.DriveModel` to a constant command, with its derivatives."""

from __future__ import annotations

from math import ceil, cos, inf, sin

import numpy as np

from omnidrive.compiled import compiled
from omnidrive.geometry.arc import arc_twist
from omnidrive.robot.drive_model import DriveModel, lags, limited_wrench
from omnidrive.robot.lag_response import Sensitivity, lag_response
from omnidrive.robot.slip import Vector, accelerate

_STEP_RATIO = 0.75
"""Length of an integration step over the shortest time constant."""


@compiled
def slip_response(
    model: DriveModel, initial: Vector, commanded: Vector, dt: float
) -> tuple[Vector, Vector]:
    """Return the motion of the model in ``dt`` seconds with a constant commanded twist.

    Args:
        model: The model.
        initial: Body twist at the start.
        commanded: Commanded body twist.
        dt: In s.

    Returns:
        The constant twist that leads to the same pose; and the twist at the end.
    """
    mean, final, _ = _response(model, initial, commanded, dt, False)
    return mean, final


@compiled
def respond(
    model: DriveModel, initial: Vector, commanded: Vector, dt: float
) -> tuple[Vector, Vector, Sensitivity]:
    """As :func:`slip_response`, with the derivatives."""
    return _response(model, initial, commanded, dt, True)


@compiled
def _response(
    model: DriveModel, initial: Vector, commanded: Vector, dt: float, sensitive: bool
) -> tuple[Vector, Vector, Sensitivity]:
    """Return the response, and its derivatives if ``sensitive``."""
    if model.max_force == inf:
        return lag_response(lags(model), initial, commanded, dt)
    return _slipping_response(model, initial, commanded, dt, sensitive)


@compiled
def _slipping_response(
    model: DriveModel, initial: Vector, commanded: Vector, dt: float, sensitive: bool
) -> tuple[Vector, Vector, Sensitivity]:
    """Integrate the model by the explicit Euler method, and its derivatives if ``sensitive``.

    The method loses the same distance as a lag, for any length of its steps.
    """
    inertia, stiffness, wheels = model.inertia, model.stiffness, len(model.rim_jacobian)
    tau = lags(model)
    steps = ceil(dt / (_STEP_RATIO * min(tau[0], tau[1], tau[2])))
    h = dt / steps
    axes = np.zeros((4, 3))  # one allocation
    by_initial, by_input, final_by_initial, final_by_input = axes[0], axes[1], axes[2], axes[3]
    final_by_initial[:] = 1.0
    velocity, saturated = initial, 0
    x, y, yaw = 0.0, 0.0, 0.0
    for _ in range(steps):
        wrench, slipping, gripping = limited_wrench(model, commanded, velocity)
        saturated += slipping
        if sensitive:
            for a in range(3):
                decay = h * gripping[a] * stiffness[a] / inertia[a]
                by_initial[a] += final_by_initial[a] / steps
                by_input[a] += final_by_input[a] / steps
                final_by_initial[a] -= decay * final_by_initial[a]
                final_by_input[a] += decay * (1.0 - final_by_input[a])
        vx, vy, w = velocity
        turn = h * w
        c, s = cos(yaw + 0.5 * turn), sin(yaw + 0.5 * turn)
        x, y, yaw = x + h * (c * vx - s * vy), y + h * (s * vx + c * vy), yaw + turn
        velocity = accelerate(velocity, wrench, inertia, h)
    ahead, left = arc_twist(dt, 0.0, x / dt, y / dt, yaw / dt)
    sensitivity = Sensitivity(
        (by_initial[0], by_initial[1], by_initial[2]),
        (by_input[0], by_input[1], by_input[2]),
        (final_by_initial[0], final_by_initial[1], final_by_initial[2]),
        (final_by_input[0], final_by_input[1], final_by_input[2]),
        saturated / (steps * wheels),
    )
    return (ahead, left, yaw / dt), velocity, sensitivity
