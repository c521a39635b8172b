"""Robot model: mounts, wheels, mass properties, motor and friction limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import cos, hypot, isfinite
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.notebook import facts_html
from omnidrive.robot.acceleration_polytope import acceleration_polytope
from omnidrive.robot.chassis import Chassis
from omnidrive.robot.checks import check_no_faults, negative, not_positive
from omnidrive.robot.drawing import robot_svg
from omnidrive.robot.mount import Mount
from omnidrive.robot.outline import Outline, outline_faults
from omnidrive.robot.wheel import OmniWheel

GRAVITY = 9.81
"""Gravitational acceleration, in m/s^2."""

MAX_WHEELS = 16
"""Largest number of wheels of a robot."""

_MIN_ROLLER_COSINE = 0.1  # cosine of the roller angle: angles up to 84 degrees


@dataclass(frozen=True, slots=True)
class Robot:
    """Geometry, mass properties, motors and friction of a robot.

    Attributes:
        name: Name of the robot in scenario files.
        mounts: Position and orientation of each wheel in B.
        wheel: Properties of the wheels; all wheels are equal.
        mass: Total mass, in kg.
        com_height: Height of the centre of mass above the floor, in m.
        body_radius: Radius of the smallest circle around the robot, in m.
        max_wheel_speed: Largest speed of a motor, in rad/s at the wheel.
        max_torque: Largest torque of a motor, in N m at the wheel.
        servo_gain: Motor torque per unit of wheel-speed error, in N m s/rad.
        friction: Coulomb friction coefficient between roller and floor.
        lag: Time constants of translation and rotation in response to commands, in s;
            :func:`omnidrive.simulation.identify_lag` identifies them on a simulated plant.
        assumed_effective_radius: Value of :attr:`effective_radius` that the wheel controller uses,
            in m. A value that differs from the true one scales the yaw rate by
            ``assumed_effective_radius / effective_radius``. None: the true value.
        com: Centre of mass in B, in m.
        body_inertia: Yaw inertia of the frame (the robot without its wheels) about the frame's
            centre of mass, in kg m^2. None: that of a disc whose radius is 0.8 times
            :attr:`mean_wheel_distance`.
        motor_lag: Time constant with which the servos' set points follow the command, in s; in
            addition to :attr:`lag`.
        drive_gain: Ratio of the steady body twist to the commanded one along x, y and yaw of B, of
            a wheel controller that assumes wrong radii, in addition to
            :attr:`assumed_effective_radius`.
        outline: Corners (x, y) of the robot seen from above in B, in m: a simple polygon, convex
            or not, that contains the origin and lies within :attr:`body_radius`. None: the robot
            is taken to fill the circle.

    Raises:
        InvalidGeometry: The wheels cannot produce every twist.
        InvalidInput: A number is outside its domain, the wheels weigh more than the robot, or a
            wheel carries no load.
    """

    name: str
    mounts: tuple[Mount, ...]
    wheel: OmniWheel
    mass: float
    com_height: float
    body_radius: float
    max_wheel_speed: float
    max_torque: float
    servo_gain: float
    friction: float
    lag: tuple[float, float]
    assumed_effective_radius: float | None = None
    com: tuple[float, float] = (0.0, 0.0)
    body_inertia: float | None = None
    motor_lag: float = 0.0
    drive_gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    outline: Outline | None = None

    def __post_init__(self) -> None:
        check_no_faults(
            robot_faults({each.name: getattr(self, each.name) for each in fields(self)})
        )
        _check_mounts(self)
        _check_loads(self)

    @property
    def chassis(self) -> Chassis:
        """True kinematics of the wheels."""
        return Chassis.of_mounts(
            self.mounts, wheel_radius=self.wheel.radius, max_wheel_speed=self.max_wheel_speed
        )

    @property
    def drive(self) -> Chassis:
        """Kinematics by which the wheel controller converts twist commands to wheel speeds."""
        true = self.chassis
        if self.assumed_effective_radius is None and self.drive_gain == (1.0, 1.0, 1.0):
            return true
        x, y, yaw = self.drive_gain
        if self.assumed_effective_radius is not None:
            yaw *= self.assumed_effective_radius / self.effective_radius
        return Chassis(true.jacobian * [x, y, yaw], self.max_wheel_speed)

    @property
    def effective_radius(self) -> float:
        """Mean rim speed per unit of yaw rate, in m/rad.

        For omni wheels on a ring the ring's radius, for a mecanum rectangle half its length plus
        half its width.
        """
        return float(np.abs(self.rim_jacobian[:, 2]).mean())

    @property
    def mean_wheel_distance(self) -> float:
        """Mean distance of the wheels from the centre, in m."""
        return float(np.mean([hypot(mount.x, mount.y) for mount in self.mounts]))

    @property
    def frame_mass(self) -> float:
        """Mass without the wheels, in kg."""
        return self.mass - len(self.mounts) * self.wheel.total_mass

    @property
    def frame_inertia(self) -> float:
        """Yaw inertia without the wheels, about :attr:`frame_com`, in kg m^2."""
        if self.body_inertia is not None:
            return self.body_inertia
        return 0.5 * self.frame_mass * (0.8 * self.mean_wheel_distance) ** 2

    @property
    def yaw_inertia(self) -> float:
        """Yaw inertia about the centre of B, in kg m^2, with the wheels as point masses."""
        wheels = sum(mount.x**2 + mount.y**2 for mount in self.mounts) * self.wheel.total_mass
        return self.frame_inertia + self.frame_mass * hypot(*self.frame_com) ** 2 + wheels

    @property
    def frame_com(self) -> tuple[float, float]:
        """Centre of mass of the frame (the robot without its wheels), in B, in m."""
        wheels = self.wheel.total_mass
        return (
            (self.mass * self.com[0] - wheels * sum(m.x for m in self.mounts)) / self.frame_mass,
            (self.mass * self.com[1] - wheels * sum(m.y for m in self.mounts)) / self.frame_mass,
        )

    @property
    def inertia(self) -> Float[Array, " 3"]:
        """Mass, mass and yaw inertia, in kg, kg and kg m^2."""
        return np.array([self.mass, self.mass, self.yaw_inertia])

    @property
    def rim_jacobian(self) -> Float[Array, "wheels 3"]:
        """Rim speed of each wheel per unit of body twist, in 1, 1 and m/rad."""
        rows: Float[Array, "wheels 3"] = self.wheel.radius * self.chassis.jacobian
        return rows

    @property
    def loads(self) -> Float[Array, " wheels"]:
        """Static normal force of each wheel, in N.

        The least-squares solution of the static equilibrium: the forces vary linearly over the
        floor, as those of equal springs under a rigid frame.
        """
        weight = self.mass * GRAVITY * np.array([1.0, *self.com])
        loads: Float[Array, " wheels"] = self._load_distribution @ weight
        return loads

    @property
    def _load_distribution(self) -> Float[Array, "wheels 3"]:
        """Loads per unit of weight and of its moments about y and x, in 1, 1/m and 1/m."""
        shares: Float[Array, "wheels 3"] = np.linalg.pinv(
            np.array([[1.0, m.x, m.y] for m in self.mounts]).T
        )
        return shares

    @property
    def friction_limits(self) -> Float[Array, " wheels"]:
        """Largest rim force of each wheel that friction transmits at the static loads, in N."""
        limits: Float[Array, " wheels"] = self._drive_friction * self.loads
        return limits

    @property
    def load_transfer(self) -> Float[Array, "wheels 2"]:
        """Change of :attr:`friction_limits` per horizontal floor force on the robot, in N/N.

        The columns are for a force along x and along y of B. The floor acts below the centre of
        mass, so that loads shift against the direction of the force.
        """
        moments = -self.com_height * self._load_distribution[:, 1:]
        transfer: Float[Array, "wheels 2"] = self._drive_friction[:, None] * moments
        return transfer

    @property
    def _drive_friction(self) -> Float[Array, " wheels"]:
        """Rim force per normal force of each wheel."""
        return self.friction * np.array([cos(m.roller_angle) for m in self.mounts])

    @property
    def force_limits(self) -> Float[Array, " wheels"]:
        """Largest rim force of each wheel, in N: the lower of friction limit and motor limit."""
        limits: Float[Array, " wheels"] = np.minimum(
            self.friction_limits, self.max_torque / self.wheel.radius
        )
        return limits

    @property
    def max_force(self) -> float:
        """Rim force that every wheel can exert, in N: the least of :attr:`force_limits`."""
        return float(self.force_limits.min())

    @property
    def acceleration_faces(self) -> Float[Array, "faces 3"]:
        """Faces of the polytope of accelerations that the wheels can produce, in B.

        ``|acceleration_faces @ (ax, ay, yaw acceleration)| <= 1``, in s^2/m, s^2/m and s^2/rad.
        Beyond it a wheel slips or its motor saturates; see :func:`acceleration_polytope`.
        """
        return acceleration_polytope(self.rim_jacobian, self.force_limits, self.inertia)

    @property
    def top_speeds(self) -> tuple[float, float]:
        """Largest speed, m/s, and yaw rate, rad/s, that the wheels reach in every direction.

        Wheel i turns at ``J_i u v`` for the speed v along the unit vector u. In its worst direction
        that is the length of the first two entries of J_i (Cauchy-Schwarz inequality), so that
        ``v = w_max / max_i |(J_i1, J_i2)|`` and ``yaw rate = w_max / max_i |J_i3|``; one at a time.
        """
        return _min_radii(self.chassis.jacobian / self.max_wheel_speed)

    @property
    def top_accelerations(self) -> tuple[float, float]:
        """Largest acceleration, m/s^2, and yaw acceleration, rad/s^2, in every direction.

        As :attr:`top_speeds`, of the polytope :attr:`acceleration_faces`; one at a time.
        """
        return _min_radii(self.acceleration_faces) if self.max_force > 0.0 else (0.0, 0.0)

    def _repr_html_(self) -> str:
        """Return drawing and main properties for notebooks."""
        kinds = sorted({"mecanum" if mount.is_mecanum else "omni" for mount in self.mounts})
        facts = {
            "wheels": f"{len(self.mounts)} {' and '.join(kinds)}, radius {self.wheel.radius:g} m",
            "body": f"radius {self.body_radius:g} m, {self.mass:g} kg",
            "motors": f"{self.max_wheel_speed:g} rad/s, {self.max_torque:g} N m",
            "friction": f"{self.friction:g}",
        }
        drawing = robot_svg(self.mounts, self.wheel.radius, self.body_radius, self.outline)
        return facts_html(f"Robot {self.name}", facts, drawing)


def _min_radii(faces: Float[Array, "faces 3"]) -> tuple[float, float]:
    """Return the largest translation in every direction, and yaw, with ``|faces @ v| <= 1``."""
    plane, yaw = np.hypot(faces[:, 0], faces[:, 1]), np.abs(faces[:, 2])
    return float(1.0 / plane.max()), float(1.0 / yaw.max())


def robot_faults(values: Mapping[str, Any]) -> list[str]:
    """Return all faults of the numbers and of the outline of a :class:`Robot`.

    Args:
        values: Values by name of the field, SI units. Missing ones and None are not checked.
    """
    faults = []
    for name, unit in (
        ("mass", "kg"), ("body_radius", "m"), ("max_wheel_speed", "rad/s"), ("max_torque", "N m"),
        ("servo_gain", "N m s/rad"), ("com_height", "m"), ("body_inertia", "kg m^2"),
        ("assumed_effective_radius", "m"),
    ):  # fmt: skip
        if values.get(name) is not None:
            faults += not_positive(f"the robot's {name}", values[name], unit)
    if "friction" in values:
        faults += negative("the robot's friction", values["friction"], "")
    for gain in values.get("drive_gain", ()):
        faults += not_positive("a drive_gain of the robot", gain, "")
    if values.get("outline") is not None:
        faults += outline_faults(values["outline"], values.get("body_radius"))
    for seconds in (values.get("motor_lag", 0.0), *values.get("lag", ())):
        faults += negative("a lag of the robot", seconds, "s")
    return faults


def _check_mounts(robot: Robot) -> None:
    """Check the number, positions and roller angles of the wheels, and the rank of the chassis."""
    if not len(robot.mounts) <= MAX_WHEELS:
        raise InvalidInput(f"the robot has {len(robot.mounts)} wheels, need at most {MAX_WHEELS}")
    for i, mount in enumerate(robot.mounts):
        if not all(map(isfinite, mount)):
            raise InvalidInput(f"wheel {i} is mounted at {tuple(mount)}: need finite numbers")
        if not cos(mount.roller_angle) >= _MIN_ROLLER_COSINE:
            raise InvalidInput(
                f"wheel {i} has a roller angle of {mount.roller_angle:g} rad, (almost) along its "
                "axle, and cannot drive the robot; mecanum wheels have 0.785 or -0.785 rad, omni "
                "wheels 0"
            )
    _ = robot.chassis  # raises InvalidGeometry


def _check_loads(robot: Robot) -> None:
    """Check that the frame has a positive mass and that every wheel carries a load."""
    if not robot.frame_mass > 0.0:
        wheels = robot.mass - robot.frame_mass
        raise InvalidInput(
            f"the robot's mass is {robot.mass:g} kg and its wheels alone weigh {wheels:g} kg: "
            "raise the mass or make the wheels lighter"
        )
    if not all(map(isfinite, robot.com)):
        raise InvalidInput(f"the robot's com must be finite, got {tuple(robot.com)} m")
    least = int(robot.loads.argmin())
    if not robot.loads[least] > 0.0:
        raise InvalidInput(
            f"with the centre of mass at ({robot.com[0]:g}, {robot.com[1]:g}) m wheel {least} "
            f"would lift off (load {robot.loads[least]:.3g} N): move com between the wheels"
        )
