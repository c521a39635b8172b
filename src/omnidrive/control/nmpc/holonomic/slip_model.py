"""Model of wheel slip, and the commanded twist that yields a desired motion in spite of it."""

from __future__ import annotations

from math import ceil, cos, inf, sin
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.lag_response import MIN_LAG, Sensitivity, lag_response
from omnidrive.control.nmpc.holonomic.motion import arc_twist
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Chassis, Robot
from omnidrive.robot.slip import Vector, slip_velocity

_FRICTION_SHARE = 0.95
"""Usable part of the friction limit: the load shifts between the wheels."""
_STEP_RATIO = 0.75
"""Length of an integration step over the shortest time constant."""
CORRECTIONS = (6, 6)
"""Corrections of the commanded twist, in translation and of the yaw rate: each leaves about
lag / dt of the error without slip."""
_SHORT_STEP = 2.0
"""Sample time over the longest lag up to which the command only compensates the lag: with a
shorter sample time the commands that reach the desired twist within one step oscillate."""
_BISECTIONS = 8
_MAX_RIM_SPEED = 1e6
"""In m/s; of a chassis without a limit."""


class SlipModel(NamedTuple):
    """Motion of a robot with slipping wheels under a commanded body twist c.

    The force of wheel i along its direction is proportional to its slip velocity and limited by
    friction::

        f_i = clip(rim_jacobian_i @ (stiffness (c - b)), -max_force, max_force)
        inertia (db/dt + w x b) = rim_jacobian^T f

    with the body twist b, of yaw rate w. Below the friction limit, b follows c with lags of
    ``inertia / (stiffness sum(rim_jacobian^2))``, for wheels whose columns of ``rim_jacobian`` are
    orthogonal, as those of every symmetric robot; at the friction limit the robot accelerates far
    less. The stiffness represents the creep of the rollers, the motor controllers and the inertia
    of the motors (Pacejka, "Tire and Vehicle Dynamics", 3rd ed. 2012, section 1.2: force in
    proportion to slip, up to friction).

    Infinite ``max_force``: b follows c in every axis of B with its lag alone.
    """

    rim_jacobian: Float[Array, "wheels 3"]
    """Rim velocities per unit of body twist; 1, 1 and m/rad."""
    inertia: Float[Array, " 3"]
    """Mass in kg, twice, and yaw inertia in kg m^2."""
    stiffness: Float[Array, " 3"]
    """Force per slip velocity in translation, twice, and in rotation, in N s/m."""
    max_force: float
    """Friction limit of a wheel, in N."""
    max_rim_speed: float
    """Largest rim speed of a commanded twist, in m/s."""
    may_spin: bool
    """Whether a wheel may still spin at the end of a step if the robot cannot reach the desired
    twist: the wheels then push during the whole step, but odometry accumulates errors."""

    @classmethod
    def of(cls, robot: Robot, *, may_spin: bool = True) -> SlipModel:
        """Return the model of a robot, with the stiffness that corresponds to its lags.

        Raises:
            InvalidInput: Mass or friction is not positive and finite, or a lag is below 0.1 ms.
        """
        rim_jacobian, inertia = np.ascontiguousarray(robot.rim_jacobian), robot.inertia
        lags = np.array([robot.lag[0], *robot.lag])
        for name, values in (("mass", inertia), ("maximum wheel force", robot.max_force)):
            if not (np.isfinite(values).all() and np.min(values) > 0.0):
                raise InvalidInput(f"a slip model needs a positive {name}, got {np.min(values):g}")
        if not (np.isfinite(lags).all() and lags.min() >= MIN_LAG):
            raise InvalidInput(f"a slip model needs lags of at least 0.1 ms, got {lags.min():g} s")
        return cls(
            rim_jacobian,
            inertia,
            inertia / (lags * (rim_jacobian**2).sum(axis=0)),
            _FRICTION_SHARE * robot.max_force,
            robot.wheel.radius * robot.max_wheel_speed,
            may_spin,
        )

    @classmethod
    def without_slip(cls, chassis: Chassis, lag: tuple[float, float]) -> SlipModel:
        """Return a model whose body twist follows the commanded one with lags only.

        Args:
            chassis: The wheels and their maximum speed.
            lag: Time constants of translation and rotation, in s; 0: without delay.
        """
        radius = 1.0 / np.abs(chassis.jacobian[:, :2]).max()  # any length: there are no forces
        jacobian = np.ascontiguousarray(radius * chassis.jacobian)
        squares = (jacobian**2).sum(axis=0)
        inertia = np.array([1.0, 1.0, 2.0 * squares[2] / (squares[0] + squares[1])])
        with np.errstate(divide="ignore"):
            stiffness = inertia / (np.array([lag[0], *lag]) * squares)
        max_rim_speed = min(radius * chassis.max_wheel_speed, _MAX_RIM_SPEED)
        return cls(jacobian, inertia, stiffness, inf, max_rim_speed, True)

    def command(
        self, desired: BodyTwist, initial: BodyTwist, dt: float
    ) -> tuple[BodyTwist, BodyTwist]:
        """Return the commanded twist that moves the robot for ``dt`` as the desired twist would.

        Args:
            desired: Constant twist that leads to the desired pose.
            initial: Twist at the start of the step.
            dt: In s.

        Returns:
            The commanded twist, as near as the wheels allow; and the twist at the end of the step.
        """
        commanded = compensate(self, _vector(desired), _vector(initial), float(dt), CORRECTIONS)
        _, final = slip_response(self, _vector(initial), commanded, float(dt))
        return BodyTwist(*commanded), BodyTwist(*final)


def _vector(twist: BodyTwist) -> Vector:
    return float(twist.vx), float(twist.vy), float(twist.yaw_rate)


@compiled
def compensate(
    model: SlipModel, desired: Vector, initial: Vector, dt: float, corrections: tuple[int, int]
) -> Vector:
    """Return the commanded twist of :meth:`SlipModel.command`.

    It is found by corrections with the remaining error of the motion.

    Args:
        model: The model.
        desired: Constant twist that leads to the desired pose.
        initial: Twist at the start of the step.
        dt: In s.
        corrections: Their number, in translation and of the yaw rate; the latter is not larger.
    """
    commanded = desired
    tau = lags(model)
    if dt < _SHORT_STEP * max(tau[0], tau[1], tau[2]):
        # of the centripetal acceleration; a lag alone is one of the body twist, see lag_response
        rate = desired[2] if model.max_force < inf else 0.0
        commanded = (
            desired[0] + tau[0] * ((desired[0] - initial[0]) / dt - rate * desired[1]),
            desired[1] + tau[1] * ((desired[1] - initial[1]) / dt + rate * desired[0]),
            desired[2] + tau[2] * (desired[2] - initial[2]) / dt,
        )
        commanded = _saturate(model, commanded)
    else:
        for k in range(corrections[0]):
            mean, _ = slip_response(model, initial, commanded, dt)
            commanded = (
                commanded[0] + desired[0] - mean[0],
                commanded[1] + desired[1] - mean[1],
                commanded[2] + (desired[2] - mean[2] if k < corrections[1] else 0.0),
            )
            commanded = _saturate(model, commanded)
    if model.may_spin:
        return commanded
    _, final = slip_response(model, initial, commanded, dt)
    if not _spins(model, commanded, final):
        return commanded
    return _without_spin(model, commanded, initial, dt)


@compiled
def predict_change(
    model: SlipModel, change: Vector, initial: Vector, dt: float
) -> tuple[Vector, Vector]:
    """Return what a command that differs from the initial twist by ``change`` causes in ``dt`` (s).

    Returns:
        The desired twist for which :func:`compensate` returns this command, and the final twist.
    """
    commanded = (initial[0] + change[0], initial[1] + change[1], initial[2] + change[2])
    mean, final = slip_response(model, initial, commanded, dt)
    tau = lags(model)
    if dt < _SHORT_STEP * max(tau[0], tau[1], tau[2]):
        mean = (
            initial[0] + change[0] / (1.0 + tau[0] / dt),
            initial[1] + change[1] / (1.0 + tau[1] / dt),
            initial[2] + change[2] / (1.0 + tau[2] / dt),
        )
    return mean, final


@compiled
def _without_spin(model: SlipModel, commanded: Vector, initial: Vector, dt: float) -> Vector:
    """Reduce the commanded change by bisection until no wheel spins at the end of the step.

    Where wheels spin even without a change, because the twist itself needs more centripetal force
    than friction, the command is returned as it is: nothing but the change ends such a motion.
    """
    low, high = 0.0, 1.0
    for k in range(_BISECTIONS + 1):
        middle = 0.5 * (low + high) if k > 0 else 0.0
        reduced = _interpolate(initial, commanded, middle)
        _, final = slip_response(model, initial, reduced, dt)
        if not _spins(model, reduced, final):
            low = middle
        elif k > 0:
            high = middle
        else:
            return commanded
    return _interpolate(initial, commanded, low)


@compiled
def _interpolate(start: Vector, end: Vector, fraction: float) -> Vector:
    x, y, yaw = start
    return (
        x + fraction * (end[0] - x),
        y + fraction * (end[1] - y),
        yaw + fraction * (end[2] - yaw),
    )


@compiled
def _slip_wrench(stiffness: Float[Array, " 3"], commanded: Vector, twist: Vector) -> Vector:
    """Return ``stiffness (c - b)``."""
    return (
        stiffness[0] * (commanded[0] - twist[0]),
        stiffness[1] * (commanded[1] - twist[1]),
        stiffness[2] * (commanded[2] - twist[2]),
    )


@compiled
def _at_rim(rim_jacobian: Float[Array, "wheels 3"], wheel: int, vector: Vector) -> float:
    """Return the component of a twist or a wrench along the rim of a wheel."""
    x, y, yaw = vector
    return float(
        rim_jacobian[wheel, 0] * x + rim_jacobian[wheel, 1] * y + rim_jacobian[wheel, 2] * yaw
    )


@compiled
def _peak(rim_jacobian: Float[Array, "wheels 3"], vector: Vector) -> float:
    """Return the largest absolute component of a twist or a wrench along any rim."""
    peak = 0.0
    for i in range(len(rim_jacobian)):
        peak = max(peak, abs(_at_rim(rim_jacobian, i, vector)))
    return peak


@compiled
def _spins(model: SlipModel, commanded: Vector, final: Vector) -> bool:
    """Return whether any wheel is at its friction limit."""
    wrench = _slip_wrench(model.stiffness, commanded, final)
    return _peak(model.rim_jacobian, wrench) >= model.max_force


@compiled
def _saturate(model: SlipModel, commanded: Vector) -> Vector:
    """Return the largest multiple of a twist, at most 1, within the maximum rim speed."""
    factor = model.max_rim_speed / max(model.max_rim_speed, _peak(model.rim_jacobian, commanded))
    return factor * commanded[0], factor * commanded[1], factor * commanded[2]


@compiled
def lags(model: SlipModel) -> Vector:
    """Return the time constants of the three axes below the friction limit, in s."""
    jacobian = model.rim_jacobian
    x, y, yaw = 0.0, 0.0, 0.0
    for i in range(len(jacobian)):
        x += jacobian[i, 0] ** 2
        y += jacobian[i, 1] ** 2
        yaw += jacobian[i, 2] ** 2
    inertia, stiffness = model.inertia, model.stiffness
    return (
        inertia[0] / (stiffness[0] * x),
        inertia[1] / (stiffness[1] * y),
        inertia[2] / (stiffness[2] * yaw),
    )


@compiled
def slip_response(
    model: SlipModel, initial: Vector, commanded: Vector, dt: float
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
    model: SlipModel, initial: Vector, commanded: Vector, dt: float
) -> tuple[Vector, Vector, Sensitivity]:
    """As :func:`slip_response`, with the derivatives."""
    return _response(model, initial, commanded, dt, True)


@compiled
def _response(
    model: SlipModel, initial: Vector, commanded: Vector, dt: float, sensitive: bool
) -> tuple[Vector, Vector, Sensitivity]:
    """Return the response, and its derivatives if ``sensitive``."""
    if model.max_force == inf:
        return lag_response(lags(model), initial, commanded, dt)
    return _slipping_response(model, initial, commanded, dt, sensitive)


@compiled
def _slipping_response(
    model: SlipModel, initial: Vector, commanded: Vector, dt: float, sensitive: bool
) -> tuple[Vector, Vector, Sensitivity]:
    """Integrate the model by the explicit Euler method, and its derivatives if ``sensitive``.

    The method loses the same distance as a lag, for any length of its steps.
    """
    jacobian, inertia, stiffness = model.rim_jacobian, model.inertia, model.stiffness
    tau = lags(model)
    steps = ceil(dt / (_STEP_RATIO * min(tau[0], tau[1], tau[2])))
    h = dt / steps
    wheels, axes = np.empty((5, len(jacobian))), np.zeros((5, 3))  # few allocations
    forces, limits, shares = wheels[0], wheels[1], wheels[2:]
    by_initial, by_input, final_by_initial, final_by_input = axes[0], axes[1], axes[2], axes[3]
    rates = axes[4]  # of decay; below the friction limit the inverse lags
    limits[:], final_by_initial[:] = model.max_force, 1.0
    for a in range(3):
        for i in range(len(jacobian)):
            shares[a, i] = jacobian[i, a] ** 2 * stiffness[a] / inertia[a]
    velocity, saturated = initial, 0
    x, y, yaw = 0.0, 0.0, 0.0
    for _ in range(steps):
        wrench = _slip_wrench(stiffness, commanded, velocity)
        for i in range(len(jacobian)):
            forces[i] = _at_rim(jacobian, i, wrench)
        if sensitive:
            rates[:] = 0.0
            for i in range(len(jacobian)):
                if abs(forces[i]) >= model.max_force:
                    saturated += 1
                else:
                    for a in range(3):
                        rates[a] += shares[a, i]
            for a in range(3):
                by_initial[a] += final_by_initial[a] / steps
                by_input[a] += final_by_input[a] / steps
                final_by_initial[a] -= h * rates[a] * final_by_initial[a]
                final_by_input[a] += h * rates[a] * (1.0 - final_by_input[a])
        vx, vy, w = velocity
        turn = h * w
        c, s = cos(yaw + 0.5 * turn), sin(yaw + 0.5 * turn)
        x, y, yaw = x + h * (c * vx - s * vy), y + h * (s * vx + c * vy), yaw + turn
        velocity, _ = slip_velocity(velocity, forces, limits, jacobian, inertia, h)
    ahead, left = arc_twist(dt, 0.0, x / dt, y / dt, yaw / dt)
    sensitivity = Sensitivity(
        (by_initial[0], by_initial[1], by_initial[2]),
        (by_input[0], by_input[1], by_input[2]),
        (final_by_initial[0], final_by_initial[1], final_by_initial[2]),
        (final_by_input[0], final_by_input[1], final_by_input[2]),
        saturated / (steps * len(jacobian)),
    )
    return (ahead, left, yaw / dt), velocity, sensitivity
