"""Response of a robot to commanded body twists: delay, first-order lag and slip."""

from __future__ import annotations

from math import ceil, cos, exp, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.robot import Robot
from omnidrive.robot.slip import Vector, friction_limit, slip_velocity

_STEP = 0.001  # s; longest integration step


def response(
    robot: Robot,
    t: Float[Array, " rows"],
    commands: Float[Array, "rows 3"],
    lag: tuple[float, float],
    delay: float,
    *,
    friction: float | None = None,
    coupling: float = 1.0,
) -> tuple[Float[Array, "rows 3"], Float[Array, "rows 3"]]:
    """Return twists and displacements of a robot that is at rest before the first command.

    The body twist b, of yaw rate w, follows the delayed command c with first-order lags,
    ``db/dt = (c - b) / lag - coupling w x b``. With friction, the forces of the wheels that this
    takes are limited as in :class:`~omnidrive.robot.drive_model.DriveModel`, to the
    friction coefficient times the load, which shifts against the acceleration.

    Args:
        robot: Masses, mounts, loads and motors.
        t: Times, s.
        commands: Command from each time to the next, in B; m/s, m/s, rad/s.
        lag: Time constants of translation and rotation, s.
        delay: Time until a command acts, s.
        friction: Coulomb coefficient; None: wheels do not slip.
        coupling: Share of the robot's mass in the inertia that the motors accelerate; the rest is
            that of the wheels about their axles. Wheels that slip do not take part.

    Returns:
        Twist at every time; displacement from every time to the next, in B at its start (m, m,
        rad), whose last row is zero.
    """
    intervals = np.diff(t)[:, None] * commands[:-1]
    integral = np.vstack([np.zeros(3), np.cumsum(intervals, axis=0)])
    share = 0.0 if friction is None else friction / robot.friction
    motor = robot.max_torque / robot.wheel.radius
    twists, moves = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    _respond(
        np.ascontiguousarray(t, dtype=float),
        np.nan_to_num(np.ascontiguousarray(commands, dtype=float)),
        integral,
        np.array([lag[0], *lag]),
        float(delay),
        np.ascontiguousarray(robot.rim_jacobian),
        robot.inertia,
        share * robot.friction_limits,
        share * robot.load_transfer,
        motor,
        friction is not None,
        float(coupling),
        twists,
        moves,
    )
    return twists, moves


@compiled
def _respond(  # noqa: PLR0917
    t: Float[Array, " rows"],
    commands: Float[Array, "rows 3"],
    integral: Float[Array, "rows 3"],
    lags: Float[Array, " 3"],
    delay: float,
    rim_jacobian: Float[Array, "wheels 3"],
    inertia: Float[Array, " 3"],
    limits: Float[Array, " wheels"],
    transfer: Float[Array, "wheels 2"],
    motor: float,
    slips: bool,
    coupling: float,
    twists: Float[Array, "rows 3"],
    moves: Float[Array, "rows 3"],
) -> None:
    squares = (rim_jacobian**2).sum(axis=0)
    b, change, before, after = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    wheels, wrench = np.zeros((2, len(rim_jacobian))), (0.0, 0.0, 0.0)
    at = -1  # interval of the command that acts
    for k in range(len(t) - 1):
        steps = max(ceil((t[k + 1] - t[k]) / _STEP - 1e-9), 1)
        h = (t[k + 1] - t[k]) / steps
        turn = 0.0
        for j in range(steps):
            time = t[k] + j * h - delay
            at = _integral(t, commands, integral, time, at, before)
            at = _integral(t, commands, integral, time + h, at, after)
            for i in range(3):
                change[i] = ((after[i] - before[i]) / h - b[i]) * (1.0 - exp(-h / lags[i]))
            slipped = slips and _wheel_forces(
                change, h, rim_jacobian, inertia, squares, limits, transfer, motor, wrench, wheels
            )
            vx, vy, rate = b[0], b[1], b[2]
            if slipped:
                (b[0], b[1], b[2]), wrench = slip_velocity(
                    (vx, vy, rate), wheels[0], wheels[1], rim_jacobian, inertia, h
                )
            else:
                b[0] += change[0] + h * coupling * rate * vy
                b[1] += change[1] - h * coupling * rate * vx
                b[2] += change[2]
                wrench = (inertia[0] * change[0] / h, inertia[1] * change[1] / h, 0.0)
            middle = turn + 0.25 * h * (rate + b[2])
            mx, my = 0.5 * h * (vx + b[0]), 0.5 * h * (vy + b[1])
            moves[k, 0] += cos(middle) * mx - sin(middle) * my
            moves[k, 1] += sin(middle) * mx + cos(middle) * my
            turn += 0.5 * h * (rate + b[2])
        moves[k, 2] = turn
        twists[k + 1] = b


@compiled
def _integral(  # noqa: PLR0917
    t: Float[Array, " rows"],
    commands: Float[Array, "rows 3"],
    integral: Float[Array, "rows 3"],
    time: float,
    at: int,
    out: Float[Array, " 3"],
) -> int:
    """Set ``out`` to the integral of the commands up to ``time``; return the interval of it."""
    if time <= t[0]:
        out[:] = 0.0
        return -1
    while at + 1 < len(t) - 1 and t[at + 1] <= time:
        at += 1
    at = max(at, 0)
    for i in range(3):
        out[i] = integral[at, i] + commands[at, i] * (time - t[at])
    return at


@compiled
def _wheel_forces(  # noqa: PLR0917
    change: Float[Array, " 3"],
    h: float,
    rim_jacobian: Float[Array, "wheels 3"],
    inertia: Float[Array, " 3"],
    squares: Float[Array, " 3"],
    limits: Float[Array, " wheels"],
    transfer: Float[Array, "wheels 2"],
    motor: float,
    wrench: Vector,
    wheels: Float[Array, "2 wheels"],
) -> bool:
    """Set the force of every wheel that a change of twist in one step needs, and its limit.

    Returns:
        Whether a wheel slips or its motor saturates.
    """
    forces, allowed, slips = wheels[0], wheels[1], False
    for i in range(len(rim_jacobian)):
        forces[i] = 0.0
        for k in range(3):
            forces[i] += rim_jacobian[i, k] * inertia[k] * change[k] / (h * squares[k])
        allowed[i] = friction_limit(limits[i], transfer[i], wrench, motor)
        slips = slips or abs(forces[i]) > allowed[i]
    return slips
