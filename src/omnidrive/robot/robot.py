"""A robot: its wheels, its mass and its motors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from math import pi

import numpy as np
from jaxtyping import Float

from omnidrive.errors import InvalidInput
from omnidrive.robot.chassis import Chassis

Array = np.ndarray

GRAVITY = 9.81
"""In m/s^2."""


@dataclass(frozen=True, slots=True)
class OmniWheel:
    """A wheel with two staggered rows of passive rollers.

    Attributes:
        radius: From axle to ground, in m.
        mass: Hub and rim without rollers, in kg.
        rotor_inertia: Motor inertia reflected to the axle, in kg m^2.
        rollers_per_row: Rollers in each of the two rows.
        roller_radius: Largest radius of a roller, in m.
        roller_mass: Of one roller, in kg.
        row_gap: Distance between the centres of the rows, in m.
    """

    radius: float
    mass: float
    rotor_inertia: float
    rollers_per_row: int = 9
    roller_radius: float = 0.0125
    roller_mass: float = 0.012
    row_gap: float = 0.022

    @property
    def total_mass(self) -> float:
        """Hub, rim and rollers, in kg."""
        return self.mass + 2 * self.rollers_per_row * self.roller_mass


@dataclass(frozen=True, slots=True)
class Robot:
    """Everything about the robot that a plant or a planner needs.

    Attributes:
        name: What scenarios call it.
        wheel_angles: Bearing of each wheel in B, in rad; axles are radial.
        arm: Distance from the centre to each wheel's plane, in m.
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
        assumed_arm: The arm that the wheel controller believes in, in m; differs from ``arm`` on
            a miscalibrated robot, whose yaw then comes out at ``assumed_arm / arm`` of the command.
    """

    name: str
    wheel_angles: tuple[float, ...]
    arm: float
    wheel: OmniWheel
    mass: float
    com_height: float
    body_radius: float
    max_wheel_speed: float
    max_torque: float
    servo_gain: float
    friction: float
    lag: tuple[float, float]
    assumed_arm: float

    @property
    def chassis(self) -> Chassis:
        """The true wheel matrix."""
        return self._chassis(self.arm)

    @property
    def yaw_inertia(self) -> float:
        """About the centre, in kg m^2, the wheels as points."""
        wheels = len(self.wheel_angles) * self.wheel.total_mass
        return self.disc_inertia(self.mass - wheels) + wheels * self.arm**2

    def disc_inertia(self, mass: float) -> float:
        """Of all but the wheels, of this mass in kg: a disc of 0.8 arm, about its axis, kg m^2."""
        return 0.5 * mass * (0.8 * self.arm) ** 2

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
    def max_push(self) -> float:
        """What friction carries of a wheel's push, the load on all alike, or the motor gives; N."""
        load = self.mass * GRAVITY / len(self.wheel_angles)
        return min(self.friction * load, self.max_torque / self.wheel.radius)

    @property
    def traction(self) -> Float[Array, "faces 3"]:
        """``|traction @ (ax, ay, yaw acceleration)| <= 1``: what the wheels can push, in B.

        Every wheel pushes along its direction, up to :attr:`max_push`. All that they can do
        together is a zonotope of forces and torque; its faces are spanned by pairs of wheels
        (McMullen, "On zonotopes", Trans. AMS 159, 1971).
        Rows are in s^2/m, s^2/m and s^2/rad. Beyond, a wheel spins or falls behind.
        """
        pushes = self.rims  # force and torque per unit of push
        faces = np.array([np.cross(a, b) for a, b in combinations(pushes, 2)])
        faces = faces[np.linalg.norm(faces, axis=1) > 1e-9 * self.arm]
        reach = self.max_push * np.abs(faces @ pushes.T).sum(axis=1)
        rows: Float[Array, "faces 3"] = faces * self.inertia / reach[:, None]
        return rows

    @property
    def drive(self) -> Chassis:
        """The wheel matrix by which commands become wheel speeds."""
        return self._chassis(self.assumed_arm)

    def _chassis(self, arm: float) -> Chassis:
        return Chassis.omni(
            angles=self.wheel_angles,
            arm=arm,
            wheel_radius=self.wheel.radius,
            max_wheel_speed=self.max_wheel_speed,
        )


_CROSS = (0.25 * pi, 0.75 * pi, 1.25 * pi, 1.75 * pi)

# The robot of the paper's simulator scene: 75.7 kg, wheel centres at (+-0.5, +-0.5) m, 50 N m.
# The scene sets no top speed; 120 rad/s (6 m/s at the rim) is ours.
_PAPER = Robot(
    name="paper",
    wheel_angles=_CROSS,
    arm=0.5 * 2**0.5,
    wheel=OmniWheel(radius=0.05, mass=2.0, rotor_inertia=5e-3),
    mass=75.7,
    com_height=0.0975,
    body_radius=0.75,
    max_wheel_speed=120.0,
    max_torque=50.0,
    servo_gain=20.0,
    friction=1.0,
    lag=(0.0065, 0.0013),
    assumed_arm=0.5 * 2**0.5,
)
_SMALL = Robot(
    name="small",
    wheel_angles=_CROSS,
    arm=0.25,
    wheel=OmniWheel(radius=0.05, mass=0.35, rotor_inertia=1e-3),
    mass=10.0,
    com_height=0.06,
    body_radius=0.28,
    max_wheel_speed=50.0,
    max_torque=2.0,
    servo_gain=1.0,
    friction=0.8,
    lag=(0.018, 0.006),
    assumed_arm=0.25,
)
ROBOTS = {robot.name: robot for robot in (_PAPER, _SMALL)}


def named_robot(name: str, *, assumed_arm: float | None = None) -> Robot:
    """One of :data:`ROBOTS`, perhaps miscalibrated.

    Raises:
        InvalidInput: There is no robot of that name.
    """
    if name not in ROBOTS:
        raise InvalidInput(f"there is no robot '{name}'; there are {', '.join(ROBOTS)}")
    robot = ROBOTS[name]
    return robot if assumed_arm is None else replace(robot, assumed_arm=assumed_arm)
