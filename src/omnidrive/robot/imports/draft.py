"""What is known about a robot from another format, and typical values for the rest."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import hypot, pi

import numpy as np

from omnidrive.errors import InvalidInput, InvalidRobot
from omnidrive.robot.mount import Mount
from omnidrive.robot.robot import GRAVITY, Robot
from omnidrive.robot.wheel import MAX_ROLLERS, OmniWheel

_MASS = 15.0  # kg
_WHEEL_SHARE = 0.05  # mass of a wheel over that of the robot
_RIM_SPEED = 1.5  # m/s
_FRICTION = 0.8
_LAG = 0.02  # s


@dataclass(frozen=True, slots=True)
class ImportedRobot:
    """Robot from a description in another format.

    Attributes:
        robot: The robot.
        read: Facts that the description states.
        guessed: Facts that are concluded from names and positions.
        missing: Parameters that the description does not hold, with the typical values used.
        warnings: What may be wrong: bold guesses, and parts of the description that are not read.
    """

    robot: Robot
    read: tuple[str, ...]
    guessed: tuple[str, ...]
    missing: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What to check, as comments of the robot file."""
        parts = {"guessed": self.guessed, "missing": self.missing, "warning": self.warnings}
        return tuple(f"{name}: {fact}" for name, facts in parts.items() for fact in facts)


@dataclass(slots=True)
class RobotDraft:
    """Parameters of a robot as far as a description holds them; None: unknown.

    Attributes are those of :class:`~omnidrive.robot.Robot` and of its wheels, and the lists of
    :class:`ImportedRobot`.
    """

    name: str
    mounts: tuple[Mount, ...]
    radius: float
    mass: float | None = None
    wheel_mass: float | None = None
    com: tuple[float, float] | None = None
    com_height: float | None = None
    body_inertia: float | None = None
    body_radius: float | None = None
    max_wheel_speed: float | None = None
    max_torque: float | None = None
    servo_gain: float | None = None
    rotor_inertia: float | None = None
    friction: float | None = None
    rollers: int | None = None
    roller_radius: float | None = None
    roller_mass: float | None = None
    read: list[str] = field(default_factory=list)
    guessed: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def finish(self) -> ImportedRobot:
        """Return the robot, with typical values for missing parameters.

        Raises:
            InvalidRobot: The parameters are not those of a possible robot.
        """
        try:
            with np.errstate(all="ignore"):  # a robot refuses numbers that are not finite
                robot = self._robot()
        except InvalidInput as error:
            raise InvalidRobot(str(error)) from None
        facts = (tuple(each) for each in (self.read, self.guessed, self.missing, self.warnings))
        return ImportedRobot(robot, *facts)

    def _robot(self) -> Robot:
        mass = self._known("mass", self.mass, _MASS, "kg")
        wheel = self._wheel(mass)
        friction = self._known("friction", self.friction, _FRICTION, "")
        speed = self._known(
            "max_wheel_speed", self.max_wheel_speed, _RIM_SPEED / self.radius, "rad/s",
            f"{_RIM_SPEED:g} m/s at the rim",
        )  # fmt: skip
        force = friction * mass * GRAVITY / max(len(self.mounts), 1)
        torque = self._known(
            "max_torque", self.max_torque, force * self.radius, "N m", "that of the friction limit"
        )
        reach = max((hypot(m.x, m.y) for m in self.mounts), default=0.0) + self.radius
        robot = Robot(
            name=self.name,
            mounts=self.mounts,
            wheel=wheel,
            mass=mass,
            com=(0.0, 0.0) if self.com is None else self.com,
            com_height=self._known(
                "com_height", self.com_height, 2.0 * self.radius, "m", "the diameter of a wheel"
            ),
            body_inertia=self.body_inertia,
            body_radius=self._known(
                "body_radius", self.body_radius, reach, "m", "up to the outer ends of the wheels"
            ),
            max_wheel_speed=speed,
            max_torque=torque,
            servo_gain=1.0,
            friction=friction,
            lag=(_LAG, _LAG),
        )
        return self._with_response(robot)

    def _with_response(self, robot: Robot) -> Robot:
        """Return the robot with a servo gain and the lags that follow from it without slip.

        The wheels accelerate the robot by ``servo_gain J^T J`` per velocity error, with the wheel
        matrix J, so that each lag is the inertia over this damping.
        """
        damping = (robot.chassis.jacobian**2).sum(axis=0)
        per_gain = robot.inertia / damping
        gain = self._known(
            "servo_gain", self.servo_gain, float(per_gain[:2].mean()) / _LAG, "N m s/rad",
            f"for a lag of {1e3 * _LAG:g} ms",
        )  # fmt: skip
        lags = per_gain / gain
        values = (float(f"{np.mean(lags[:2]):.3g}"), float(f"{lags[2]:.3g}"))
        self.missing.append(
            f"lag: [{values[0]:g}, {values[1]:g}] s, computed from mass, inertia and servo_gain; "
            "`omnidrive robot identify` measures it"
        )
        return replace(robot, servo_gain=gain, lag=values)

    def _wheel(self, mass: float) -> OmniWheel:
        radius, mecanum = self.radius, any(m.is_mecanum for m in self.mounts)
        whole = self._known("wheel.mass", self.wheel_mass, _WHEEL_SHARE * mass, "kg", "5 % of mass")
        rows = 1 if mecanum else 2
        count = 12 if mecanum else 9
        known = self.rollers is not None and self.rollers % rows == 0
        if known and 3 <= (self.rollers or 0) // rows <= MAX_ROLLERS:
            count = (self.rollers or 0) // rows
        roller_radius = self.roller_radius or (0.15 if mecanum else 0.25) * radius
        roller_mass = self.roller_mass or 0.2 * whole / (rows * count)
        hub = whole - rows * count * roller_mass
        if self.rollers is None:
            self.missing.append(
                f"rollers: {rows} row{'s' if rows > 1 else ''} of {count}, radius "
                f"{roller_radius:.3g} m, a fifth of the mass of the wheel"
            )
        inertia = self._known(
            "wheel.rotor_inertia", self.rotor_inertia, 0.5 * hub * (0.7 * radius) ** 2, "kg m^2",
            "that of the hub",
        )  # fmt: skip
        return OmniWheel(
            radius=radius,
            mass=hub,
            rotor_inertia=inertia,
            rollers_per_row=count,
            roller_radius=roller_radius,
            roller_mass=roller_mass,
            row_gap=(0.65 if mecanum else 0.44) * radius,
            rows=rows,
        )

    def _known(
        self, key: str, value: float | None, typical: float, unit: str, why: str = "typical"
    ) -> float:
        """Return ``value``; if it is None, the typical value, which is noted as missing."""
        if value is not None:
            return value
        short = float(f"{typical:.4g}")
        self.missing.append(f"{key}: {short:g} {unit}".rstrip() + f" ({why})")
        return short


def mecanum_roller(x: float, y: float, axle_angle: float) -> float:
    """Return the roller angle of a mecanum wheel in the usual arrangement, rad.

    Seen from above, the axes of the rollers on the floor form a diamond: they are perpendicular to
    the diagonals on which the wheels are. The wheels roll along x of the frame of x and y.

    Args:
        x: Position of the wheel along the rolling direction, m.
        y: Position of the wheel along the axle, m.
        axle_angle: Bearing of the axle in this frame, rad.
    """
    return roller_angle(-0.25 * pi if x * y > 0.0 else 0.25 * pi, axle_angle)


def roller_angle(bearing: float, axle_angle: float) -> float:
    """Return the angle of :attr:`Mount.roller_angle`, rad, in [-pi/2, pi/2).

    Args:
        bearing: Bearing of the axis of the roller on the floor, rad; its sign does not matter.
        axle_angle: Bearing of the axle in the same frame, rad.
    """
    return (axle_angle + 0.5 * pi - bearing + 0.5 * pi) % pi - 0.5 * pi
