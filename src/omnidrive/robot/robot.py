"""A robot: its wheels, its mass and its motors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, hypot, pi

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.robot.chassis import Chassis
from omnidrive.robot.checks import check_robot, check_wheel
from omnidrive.robot.mount import Mount, mecanum_rectangle, omni_ring
from omnidrive.robot.traction import traction_faces

GRAVITY = 9.81
"""In m/s^2."""


@dataclass(frozen=True, slots=True)
class OmniWheel:
    """A wheel with passive rollers: omni or mecanum, as its mount says.

    Attributes:
        radius: From axle to ground, in m.
        mass: Hub and rim without rollers, in kg.
        rotor_inertia: Motor inertia reflected to the axle, in kg m^2.
        rollers_per_row: Rollers in each row.
        roller_radius: Largest radius of a roller, in m.
        roller_mass: Of one roller, in kg.
        row_gap: Distance between the centres of the rows, in m; of one row, its width.
        rows: Rows of rollers, staggered: two of omni wheels, one of mecanum wheels.

    Raises:
        InvalidInput: It cannot be built: see :func:`omnidrive.robot.checks.check_wheel`.
    """

    radius: float
    mass: float
    rotor_inertia: float
    rollers_per_row: int = 9
    roller_radius: float = 0.0125
    roller_mass: float = 0.012
    row_gap: float = 0.022
    rows: int = 2

    def __post_init__(self) -> None:
        check_wheel(self)

    @property
    def total_mass(self) -> float:
        """Hub, rim and rollers, in kg."""
        return self.mass + self.rollers * self.roller_mass

    @property
    def rollers(self) -> int:
        """How many there are in all rows."""
        return self.rows * self.rollers_per_row

    @property
    def hub_inertia(self) -> float:
        """Of hub and rim about the axle, in kg m^2: most of their mass lies within 0.7 radii."""
        return 0.5 * self.mass * (0.7 * self.radius) ** 2


@dataclass(frozen=True, slots=True)
class Robot:
    """Everything about the robot that a plant or a planner needs.

    Attributes:
        name: What scenarios call it.
        mounts: Where each wheel stands in B, and which way it pushes.
        wheel: The wheels, all alike.
        mass: In total, in kg.
        com_height: Height of the centre of mass above the floor, in m.
        body_radius: Radius of the smallest circle around the robot, in m.
        max_wheel_speed: Speed that a motor reaches, in rad/s.
        max_torque: Torque that a motor gives at its wheel, in N m.
        servo_gain: Torque per unit of wheel-speed error, in N m s/rad.
        friction: Coulomb friction coefficient between roller and floor.
        lag: Time constants with which translation and rotation follow commands, in s, as
            :func:`omnidrive.simulation.identify_lag` finds them on physics with rollers.
        assumed_arm: The :attr:`arm` that the wheel controller believes in, in m; where it is not
            the true one, yaw comes out at ``assumed_arm / arm`` of the command. None: the true one.
        com: Where the centre of mass is in B, in m.
        body_inertia: Yaw inertia of all but the wheels about its centre of mass, in kg m^2; None:
            that of a disc of 0.8 times the wheels' distance from the centre.
        motor_lag: Time constant with which the servos' set points follow the command, in s.

    Raises:
        InvalidGeometry: Its wheels cannot push in every direction.
        InvalidInput: It could not stand or move: see
            :func:`omnidrive.robot.checks.check_robot`.
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
    assumed_arm: float | None = None
    com: tuple[float, float] = (0.0, 0.0)
    body_inertia: float | None = None
    motor_lag: float = 0.0

    def __post_init__(self) -> None:
        check_robot(self)

    @property
    def chassis(self) -> Chassis:
        """The true wheel matrix."""
        return Chassis.of_mounts(
            self.mounts, wheel_radius=self.wheel.radius, max_wheel_speed=self.max_wheel_speed
        )

    @property
    def drive(self) -> Chassis:
        """The wheel matrix by which commands become wheel speeds."""
        true = self.chassis
        if self.assumed_arm is None:
            return true
        believed = true.jacobian * [1.0, 1.0, self.assumed_arm / self.arm]
        return Chassis(believed, self.max_wheel_speed)

    @property
    def arm(self) -> float:
        """Mean speed of the rims per unit of yaw rate, in m/rad.

        Of a ring of omni wheels its radius, of mecanum wheels half their length and half width.
        """
        return float(np.abs(self.rims[:, 2]).mean())

    @property
    def reach(self) -> float:
        """Mean distance of the wheels from the centre, in m."""
        return float(np.mean([hypot(mount.x, mount.y) for mount in self.mounts]))

    @property
    def frame_mass(self) -> float:
        """Of all but the wheels, in kg."""
        return self.mass - len(self.mounts) * self.wheel.total_mass

    @property
    def frame_inertia(self) -> float:
        """Of all but the wheels, about its own centre of mass, in kg m^2."""
        if self.body_inertia is not None:
            return self.body_inertia
        return 0.5 * self.frame_mass * (0.8 * self.reach) ** 2

    @property
    def yaw_inertia(self) -> float:
        """About the centre, in kg m^2, the wheels as points."""
        wheels = sum(mount.x**2 + mount.y**2 for mount in self.mounts) * self.wheel.total_mass
        return self.frame_inertia + self.frame_mass * hypot(*self.frame_com) ** 2 + wheels

    @property
    def frame_com(self) -> tuple[float, float]:
        """Centre of mass of all but the wheels, in B, in m."""
        wheels = self.wheel.total_mass
        return (
            (self.mass * self.com[0] - wheels * sum(m.x for m in self.mounts)) / self.frame_mass,
            (self.mass * self.com[1] - wheels * sum(m.y for m in self.mounts)) / self.frame_mass,
        )

    @property
    def inertia(self) -> Float[Array, " 3"]:
        """Mass in kg, twice, and yaw inertia in kg m^2."""
        return np.array([self.mass, self.mass, self.yaw_inertia])

    @property
    def rims(self) -> Float[Array, "wheels 3"]:
        """Speed of every rim per unit of body twist, in 1, 1 and m/rad."""
        rows: Float[Array, "wheels 3"] = self.wheel.radius * self.chassis.jacobian
        return rows

    @property
    def loads(self) -> Float[Array, " wheels"]:
        """Weight that each wheel carries at rest, in N, on axles that are all as soft.

        Least squares: forces that balance the weight and vary linearly over the floor, as those
        of equal springs under a stiff frame do.
        """
        weight = self.mass * GRAVITY * np.array([1.0, *self.com])
        loads: Float[Array, " wheels"] = self._sharing @ weight
        return loads

    @property
    def _sharing(self) -> Float[Array, "wheels 3"]:
        """Loads per weight and per its moments about y and x, in 1, 1/m and 1/m."""
        shares: Float[Array, "wheels 3"] = np.linalg.pinv(
            np.array([[1.0, m.x, m.y] for m in self.mounts]).T
        )
        return shares

    @property
    def grips(self) -> Float[Array, " wheels"]:
        """What friction carries of each wheel's push at rest; at the rim, in N."""
        grips: Float[Array, " wheels"] = self._friction_along_push * self.loads
        return grips

    @property
    def grip_shifts(self) -> Float[Array, "wheels 2"]:
        """How much more :attr:`grips` are per push of the floor on the robot along x and y of B.

        In N/N. The floor pushes below the centre of mass, so that loads shift backwards.
        """
        leaning = -self.com_height * self._sharing[:, 1:]
        shifts: Float[Array, "wheels 2"] = self._friction_along_push[:, None] * leaning
        return shifts

    @property
    def _friction_along_push(self) -> Float[Array, " wheels"]:
        return self.friction * np.array([cos(m.roller) for m in self.mounts])

    @property
    def pushes(self) -> Float[Array, " wheels"]:
        """What friction carries of each wheel's push, or its motor gives; at the rim, in N."""
        most: Float[Array, " wheels"] = np.minimum(self.grips, self.max_torque / self.wheel.radius)
        return most

    @property
    def max_push(self) -> float:
        """The least of :attr:`pushes`, in N: what every wheel can do."""
        return float(self.pushes.min())

    @property
    def traction(self) -> Float[Array, "faces 3"]:
        """``|traction @ (ax, ay, yaw acceleration)| <= 1``: what the wheels can push, in B.

        Beyond, a wheel spins or falls behind; see :func:`traction_faces`.
        """
        return traction_faces(self.rims, self.pushes, self.inertia)


_CROSS = (0.25 * pi, 0.75 * pi, 1.25 * pi, 1.75 * pi)

# The robot of the paper's simulator scene: 75.7 kg, wheel centres at (+-0.5, +-0.5) m, 50 N m.
# The scene sets no top speed; 120 rad/s (6 m/s at the rim) is ours.
_PAPER = Robot(
    name="paper",
    mounts=omni_ring(_CROSS, 0.5 * 2**0.5),
    wheel=OmniWheel(radius=0.05, mass=2.0, rotor_inertia=5e-3),
    mass=75.7,
    com_height=0.0975,
    body_radius=0.75,
    max_wheel_speed=120.0,
    max_torque=50.0,
    servo_gain=20.0,
    friction=1.0,
    lag=(0.0065, 0.0013),
)
_SMALL = Robot(
    name="small",
    mounts=omni_ring(_CROSS, 0.25),
    wheel=OmniWheel(radius=0.05, mass=0.35, rotor_inertia=1e-3),
    mass=10.0,
    com_height=0.06,
    body_radius=0.28,
    max_wheel_speed=50.0,
    max_torque=2.0,
    servo_gain=1.0,
    friction=0.8,
    lag=(0.018, 0.006),
)
# Three wheels on a light plate, of the size of a room's robots.
_KIWI = Robot(
    name="kiwi",
    mounts=omni_ring((pi / 3.0, pi, -pi / 3.0), 0.17),
    wheel=OmniWheel(radius=0.04, mass=0.2, rotor_inertia=4e-4, roller_radius=0.01,
                    roller_mass=0.007, row_gap=0.018),
    mass=6.0,
    com_height=0.06,
    body_radius=0.21,
    max_wheel_speed=40.0,
    max_torque=1.5,
    servo_gain=1.2,
    friction=0.8,
    lag=(0.0088, 0.0038),
)  # fmt: skip
# Four wheels of 6 inches under a plate of about 0.5 m by 0.4 m: the size of usual research bases.
_MECANUM = Robot(
    name="mecanum",
    mounts=mecanum_rectangle(0.2, 0.22),
    wheel=OmniWheel(radius=0.0762, mass=0.9, rotor_inertia=4e-3, rollers_per_row=12,
                    roller_radius=0.011, roller_mass=0.03, row_gap=0.05, rows=1),
    mass=20.0,
    com_height=0.1,
    body_radius=0.36,
    max_wheel_speed=25.0,
    max_torque=6.0,
    servo_gain=4.0,
    friction=0.8,
    lag=(0.0126, 0.0042),
)  # fmt: skip
ROBOTS = {robot.name: robot for robot in (_PAPER, _SMALL, _KIWI, _MECANUM)}


def named_robot(name: str, *, assumed_arm: float | None = None) -> Robot:
    """One of :data:`ROBOTS`, perhaps miscalibrated.

    Raises:
        InvalidInput: There is no robot of that name.
    """
    if name not in ROBOTS:
        raise InvalidInput(f"there is no robot '{name}'; there are {', '.join(ROBOTS)}")
    robot = ROBOTS[name]
    return robot if assumed_arm is None else replace(robot, assumed_arm=assumed_arm)
