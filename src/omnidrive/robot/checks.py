"""What a robot must be to stand on the floor and go where it is told."""

from __future__ import annotations

from math import cos, isfinite
from typing import TYPE_CHECKING

from omnidrive.errors import InvalidInput

if TYPE_CHECKING:
    from omnidrive.robot.robot import OmniWheel, Robot

MOST_WHEELS = 16
MOST_ROLLERS = 100
"""Of one row."""

_LEAST_PART = 0.1  # of a mecanum wheel's push that goes into rolling: rollers up to 84 degrees


def check_wheel(wheel: OmniWheel) -> None:
    """Refuse a wheel that cannot be built.

    Raises:
        InvalidInput: A length, mass or inertia is not positive and finite, the rollers are larger
            than the wheel, or there are too few or too many.
    """
    for name, value, unit in (
        ("radius", wheel.radius, "m"),
        ("mass", wheel.mass, "kg"),
        ("roller_radius", wheel.roller_radius, "m"),
        ("roller_mass", wheel.roller_mass, "kg"),
    ):
        _positive(f"the wheels' {name}", value, unit)
    _not_negative("the wheels' rotor_inertia", wheel.rotor_inertia, "kg m^2")
    _not_negative("the wheels' row_gap", wheel.row_gap, "m")
    if not wheel.roller_radius < wheel.radius:
        raise InvalidInput(
            f"rollers of radius {wheel.roller_radius:g} m do not fit a wheel of radius "
            f"{wheel.radius:g} m: make the rollers smaller"
        )
    if not (3 <= wheel.rollers_per_row <= MOST_ROLLERS and 1 <= wheel.rows <= 4):
        raise InvalidInput(
            f"a wheel has {wheel.rows} rows of {wheel.rollers_per_row} rollers, "
            f"need 1 to 4 rows of 3 to {MOST_ROLLERS}"
        )


def check_robot(robot: Robot) -> None:
    """Refuse a robot that could not stand or move.

    Raises:
        InvalidGeometry: Its wheels cannot push in every direction.
        InvalidInput: A number is out of its domain, the wheels weigh more than all, or one of them
            would lift off.
    """
    for name, value, unit in (
        ("mass", robot.mass, "kg"),
        ("body_radius", robot.body_radius, "m"),
        ("max_wheel_speed", robot.max_wheel_speed, "rad/s"),
        ("max_torque", robot.max_torque, "N m"),
        ("servo_gain", robot.servo_gain, "N m s/rad"),
        ("com_height", robot.com_height, "m"),
    ):
        _positive(f"the robot's {name}", value, unit)
    _not_negative("the robot's friction", robot.friction, "")
    for seconds in (robot.motor_lag, *robot.lag):
        _not_negative("a lag of the robot", seconds, "s")
    if robot.body_inertia is not None:
        _positive("the robot's body_inertia", robot.body_inertia, "kg m^2")
    if robot.assumed_arm is not None:
        _positive("the robot's assumed_arm", robot.assumed_arm, "m")
    _check_mounts(robot)
    _check_balance(robot)


def _check_mounts(robot: Robot) -> None:
    """Wheels in finite number, at finite places, that roll where they push."""
    if not len(robot.mounts) <= MOST_WHEELS:
        raise InvalidInput(f"the robot has {len(robot.mounts)} wheels, need at most {MOST_WHEELS}")
    for i, mount in enumerate(robot.mounts):
        if not all(map(isfinite, mount)):
            raise InvalidInput(f"wheel {i} is mounted at {tuple(mount)}: need finite numbers")
        if not cos(mount.roller) >= _LEAST_PART:
            raise InvalidInput(
                f"wheel {i} has rollers at {mount.roller:g} rad, along its axle or nearly so: it "
                "could not push; mecanum wheels have them at 0.785 or -0.785 rad, omni wheels at 0"
            )
    _ = robot.chassis  # checks the rank


def _check_balance(robot: Robot) -> None:
    """There is a frame, and every wheel carries some of the weight."""
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
            f"would lift off (load {robot.loads[least]:.3g} N): put com between the wheels"
        )


def _positive(name: str, value: float, unit: str) -> None:
    if not (isfinite(value) and value > 0.0):
        raise InvalidInput(f"{name} must be positive, got {value:g} {unit}".rstrip())


def _not_negative(name: str, value: float, unit: str) -> None:
    if not (isfinite(value) and value >= 0.0):
        raise InvalidInput(f"{name} must not be negative, got {value:g} {unit}".rstrip())
