"""Model of a drive: masses, friction, and the lags with which a robot follows its motors."""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.robot.chassis import Chassis
from omnidrive.robot.lag_response import MIN_LAG
from omnidrive.robot.robot import Robot
from omnidrive.robot.slip import Vector

_FRICTION_SHARE = 0.95
"""Usable part of the friction limit: the load shifts between the wheels."""
_MAX_RIM_SPEED = 1e6
"""In m/s; of a chassis without a limit."""
_SHORTEST_LAG = 1e-5
"""In s; shorter lags have the same effect."""


class DriveModel(NamedTuple):
    """Motion of a robot with slipping wheels under the twist c that its motors follow.

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

    @classmethod
    def of(cls, robot: Robot) -> DriveModel:
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
        )

    @classmethod
    def without_slip(cls, chassis: Chassis, lag: tuple[float, float]) -> DriveModel:
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
        return cls(jacobian, inertia, stiffness, inf, max_rim_speed)


@compiled
def axis_unit(model: DriveModel, axis: int) -> float:
    """Return 1, for the yaw axis the inverse radius of gyration, in rad/m."""
    return sqrt(model.inertia[0] / model.inertia[2]) if axis == 2 else 1.0


@compiled
def _squares(jacobian: Float[Array, "wheels 3"]) -> Vector:
    x, y, yaw = 0.0, 0.0, 0.0
    for i in range(len(jacobian)):
        x += jacobian[i, 0] ** 2
        y += jacobian[i, 1] ** 2
        yaw += jacobian[i, 2] ** 2
    return x, y, yaw


@compiled
def lags(model: DriveModel) -> Vector:
    """Return the time constants of the three axes below the friction limit, in s."""
    x, y, yaw = _squares(model.rim_jacobian)
    inertia, stiffness = model.inertia, model.stiffness
    return (
        inertia[0] / (stiffness[0] * x),
        inertia[1] / (stiffness[1] * y),
        inertia[2] / (stiffness[2] * yaw),
    )


@compiled
def inverse_lags(model: DriveModel) -> Vector:
    """Return the inverse time constants below the friction limit, 1/s; finite without a lag."""
    x, y, yaw = _squares(model.rim_jacobian)
    stiffness, inertia = model.stiffness, model.inertia
    fastest = 1.0 / _SHORTEST_LAG
    return (
        min(stiffness[0] * x / inertia[0], fastest),
        min(stiffness[1] * y / inertia[1], fastest),
        min(stiffness[2] * yaw / inertia[2], fastest),
    )


@compiled
def at_rim(rim_jacobian: Float[Array, "wheels 3"], wheel: int, vector: Vector) -> float:
    """Return the component of a twist or a wrench along the rim of a wheel."""
    x, y, yaw = vector
    return float(
        rim_jacobian[wheel, 0] * x + rim_jacobian[wheel, 1] * y + rim_jacobian[wheel, 2] * yaw
    )


@compiled
def peak_at_rim(rim_jacobian: Float[Array, "wheels 3"], vector: Vector) -> float:
    """Return the largest absolute component of a twist or a wrench along any rim."""
    peak = 0.0
    for i in range(len(rim_jacobian)):
        peak = max(peak, abs(at_rim(rim_jacobian, i, vector)))
    return peak


@compiled
def slip_wrench(model: DriveModel, commanded: Vector, twist: Vector) -> Vector:
    """Return ``stiffness (c - b)``, whose components along the rims are unlimited forces."""
    stiffness = model.stiffness
    return (
        stiffness[0] * (commanded[0] - twist[0]),
        stiffness[1] * (commanded[1] - twist[1]),
        stiffness[2] * (commanded[2] - twist[2]),
    )


@compiled
def slips(model: DriveModel, commanded: Vector, twist: Vector) -> bool:
    """Return whether any wheel is at its friction limit."""
    if model.max_force == inf:  # the stiffness may be infinite, too
        return False
    return peak_at_rim(model.rim_jacobian, slip_wrench(model, commanded, twist)) >= model.max_force


class LimitedWrench(NamedTuple):
    """Effect of all wheels on the robot."""

    wrench: Vector
    """In B; N, N, N m."""
    slipping: int
    """Number of wheels at their friction limit."""
    gripping: Vector
    """Sums of the squares of the others' columns of the rim Jacobian; 1, 1, m^2/rad^2."""


@compiled
def limited_wrench(model: DriveModel, commanded: Vector, twist: Vector) -> LimitedWrench:
    """Return the wrench of the wheels, limited as by :func:`~.slip.slip_velocity`."""
    jacobian, limit = model.rim_jacobian, model.max_force
    unlimited = slip_wrench(model, commanded, twist)
    slipping, fx, fy, torque = 0, 0.0, 0.0, 0.0
    sx, sy, sw = 0.0, 0.0, 0.0
    for i in range(len(jacobian)):
        x, y, yaw = jacobian[i, 0], jacobian[i, 1], jacobian[i, 2]
        force = at_rim(jacobian, i, unlimited)
        if abs(force) >= limit:
            force = limit if force > 0.0 else -limit
            slipping += 1
        else:
            sx, sy, sw = sx + x * x, sy + y * y, sw + yaw * yaw
        fx, fy, torque = fx + x * force, fy + y * force, torque + yaw * force
    return LimitedWrench((fx, fy, torque), slipping, (sx, sy, sw))
