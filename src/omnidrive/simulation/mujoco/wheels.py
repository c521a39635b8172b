"""Wheels in MJCF: with rollers, or as one ball each.

Rollers are ellipsoids on free hinges. With the wheel turned by d from the angle at which its lowest
roller is parallel to the floor, the height of the axle is the support function of an ellipsoid,
``h(d) = (r - b) cos d + sqrt(b^2 + (a^2 - b^2) sin^2 d cos^2 roller)``, with a and b the roller's
half-length and largest radius. Its terms of second order in d cancel for ``a^2 = b r`` at
roller = 0, which is the shape for omni wheels. A single row of mecanum rollers has fewer rollers
per turn, so that d becomes larger: there a is chosen so that the height at the change from one
roller to the next equals the height in between.

The axis of a mecanum roller is inclined to the floor while the wheel turns, so that its angle
seen from above exceeds its tilt: ``tan(projected) = tan(tilt) / cos(d)``. The tilt is chosen so
that the mean of the projected angle is the mount's angle; otherwise the robot would move sideways
1 % slower than its wheel speeds imply.
"""

from __future__ import annotations

from math import asinh, atan, cos, pi, sin, sqrt, tan
from xml.etree import ElementTree as ET

from omnidrive.robot import GRAVITY, Mount, OmniWheel, Robot
from omnidrive.simulation.mujoco.mjcf import (
    CONTACT,
    VISUAL,
    add,
    floor_friction,
    numbers,
    yaw_quaternion,
)

_SAG = 0.002  # m; deflection of a sprung axle under the robot's weight
_SPRING_DAMPING_RATIO = 0.7
ROLLER_ARMATURE = 1e-6  # kg m^2; larger values make the robot creep
ROLLER_DAMPING = 2e-6  # N m s/rad
ROLLING_FRICTION_RATIO = 1e-4
"""Friction of a ball along its axis, where a wheel has rollers, over that along its force.

MuJoCo makes the second tangent of a contact stiffer than the first by the inverse square of this
ratio; the model therefore softens the first by the same factor. With a larger ratio, balls would be
on their friction cones whenever they roll, which costs computing time.
"""
_TILT = 0.02  # rad; inclination of a ball's axis, so that one end of its capsule touches


def add_ball_wheel(
    base: ET.Element, actuators: ET.Element, robot: Robot, i: int, mount: Mount
) -> None:
    """Add a wheel as a round cap, the end of a capsule, that turns about one axis.

    The axis is perpendicular to the direction p of the mount's force. The motor turns
    ``1 / cos(roller)`` times as fast as the cap: its torque is multiplied by this gear ratio, and
    inertia about the axle by its square, so that ``r w cos(roller) = p . v``, without loss.
    """
    wheel, gear = robot.wheel, cos(_TILT) / cos(mount.roller_angle)
    body = _add_sprung_body(base, robot, i, mount, mount.axle_angle - mount.roller_angle)
    axis = (-cos(_TILT), 0.0, sin(_TILT))
    add(
        body, "joint", name=f"wheel{i}", type="hinge", axis=numbers(*axis),
        armature=gear**2 * wheel.rotor_inertia,
    )  # fmt: skip
    about_axis = gear**2 * (wheel.hub_inertia + _rollers_inertia(wheel))
    across = 0.5 * about_axis + wheel.total_mass * wheel.row_gap**2 / 12.0
    add(
        body, "inertial", pos="0 0 0", mass=wheel.total_mass,
        diaginertia=numbers(about_axis, across, across),
    )  # fmt: skip
    add(
        body, "geom", name=f"tyre{i}", type="capsule", size=wheel.radius,
        fromto=numbers(0, 0, 0, *(0.4 * wheel.radius * part for part in axis)),
        **(_tyre(robot) | {"conaffinity": "0"}),
    )  # fmt: skip
    _add_servo(actuators, robot, i, joint=f"wheel{i}", gear=gear)


def add_ball_contacts(root: ET.Element, robot: Robot) -> None:
    """Add the contacts of balls with the floor, with friction along the force directions only.

    MuJoCo turns the frame of a contact between capsule and plane so that its first tangent is
    parallel to the capsule. Slip has less damping than normal motion; otherwise spinning wheels
    would bounce.
    """
    contacts = add(root, "contact")
    for i in range(len(robot.mounts)):
        add(
            contacts, "pair", name=f"contact{i}", geom1="floor", geom2=f"tyre{i}",
            friction=numbers(*ball_friction(robot.friction), 0.0005, 0.0001, 0.0001),
            solreffriction="0.01 1", **CONTACT,
        )  # fmt: skip


def ball_friction(friction: float) -> tuple[float, float]:
    """Return the friction of a ball's contact along its axis and along its force."""
    return ROLLING_FRICTION_RATIO * friction, friction


def add_roller_wheel(
    base: ET.Element, actuators: ET.Element, robot: Robot, i: int, mount: Mount
) -> None:
    """Add a wheel with rows of rollers; several rows are staggered."""
    wheel = robot.wheel
    body = _add_sprung_body(base, robot, i, mount, mount.axle_angle)
    add(body, "joint", name=f"wheel{i}", type="hinge", axis="-1 0 0", armature=wheel.rotor_inertia)
    about_axle = wheel.hub_inertia
    across = 0.5 * about_axle + wheel.mass * wheel.row_gap**2 / 12.0
    add(
        body, "inertial", pos="0 0 0", mass=wheel.mass,
        diaginertia=numbers(about_axle, across, across),
    )  # fmt: skip
    half = 0.8 * wheel.row_gap
    add(
        body, "geom", type="cylinder", size=numbers(wheel.radius - 1.7 * wheel.roller_radius),
        fromto=numbers(-half, 0, 0, half, 0, 0), rgba=".66 .68 .72 1", **VISUAL,
    )  # fmt: skip
    for row in range(wheel.rows):
        for k in range(wheel.rollers_per_row):
            phase = 2.0 * pi * (k + row / wheel.rows) / wheel.rollers_per_row
            _add_roller(body, robot, mount, (row - 0.5 * (wheel.rows - 1)) * wheel.row_gap, phase)
    _add_servo(actuators, robot, i, joint=f"wheel{i}")


def _add_sprung_body(
    base: ET.Element, robot: Robot, i: int, mount: Mount, yaw: float
) -> ET.Element:
    """Add the body of wheel i on its sprung axle; x points outwards along the axle."""
    pos = numbers(mount.x, mount.y, 0.0)
    body = add(base, "body", name=f"wheel{i}", pos=pos, quat=yaw_quaternion(yaw))
    load = robot.mass / len(robot.mounts)
    stiffness = load * GRAVITY / _SAG
    add(
        body, "joint", name=f"spring{i}", type="slide", axis="0 0 1", armature=0.02,
        stiffness=stiffness, springref=-_SAG,
        damping=2.0 * _SPRING_DAMPING_RATIO * sqrt(stiffness * load),
    )  # fmt: skip
    return body


def _add_servo(actuators: ET.Element, robot: Robot, i: int, **transmission: object) -> None:
    """Add a velocity servo: torque proportional to the speed error, with a lagged set point."""
    limits = numbers(-robot.max_torque, robot.max_torque)
    if robot.motor_lag == 0.0:
        add(
            actuators,
            "velocity",
            name=f"motor{i}",
            kv=robot.servo_gain,
            forcerange=limits,
            **transmission,
        )
        return
    add(
        actuators, "general", name=f"motor{i}", forcerange=limits, **transmission,
        dyntype="filterexact", dynprm=robot.motor_lag, gainprm=robot.servo_gain,
        biastype="affine", biasprm=numbers(0, 0, -robot.servo_gain),
    )  # fmt: skip


def _tyre(robot: Robot) -> dict[str, str]:
    tyre = {"contype": "0", "conaffinity": "1", "mass": "0", "rgba": ".16 .16 .19 1"}
    return dict(CONTACT, friction=floor_friction(robot), **tyre)


def _rollers_inertia(wheel: OmniWheel) -> float:
    """Return the inertia of all rollers about the axle."""
    return wheel.rollers * wheel.roller_mass * (wheel.radius - wheel.roller_radius) ** 2


def _add_roller(
    wheel_body: ET.Element, robot: Robot, mount: Mount, offset: float, phase: float
) -> None:
    """Add a free ellipsoid whose axis is tilted towards the axle."""
    wheel = robot.wheel
    b = wheel.roller_radius
    reach = wheel.radius - b
    tilt, half_length = roller_shape(wheel, mount.roller_angle)
    body = add(
        wheel_body, "body", pos=numbers(offset, reach * cos(phase), reach * sin(phase)),
        zaxis=numbers(sin(tilt), -sin(phase) * cos(tilt), cos(phase) * cos(tilt)),
    )  # fmt: skip
    add(
        body, "joint", type="hinge", axis="0 0 1", damping=ROLLER_DAMPING,
        armature=ROLLER_ARMATURE,
    )  # fmt: skip
    about_axis = 0.5 * wheel.roller_mass * b**2
    inertia = numbers(2.0 * about_axis, 2.0 * about_axis, about_axis)
    add(body, "inertial", pos="0 0 0", mass=wheel.roller_mass, diaginertia=inertia)
    add(body, "geom", type="ellipsoid", size=numbers(b, b, half_length), **_tyre(robot))


def roller_shape(wheel: OmniWheel, projected: float) -> tuple[float, float]:
    """Return tilt (rad) and half-length (m) of rollers with this mean projected angle (rad)."""
    r, b = wheel.radius, wheel.roller_radius
    if projected == 0.0:
        return 0.0, sqrt(b * r)
    last = pi / wheel.rollers  # d at the change to the next roller
    tilt = atan(tan(projected) * last / asinh(tan(last)))  # by the mean of 1 / cos d
    height = r - (r - b) * cos(last)
    stretch = (height**2 - b**2) / (sin(last) * cos(tilt)) ** 2
    return tilt, sqrt(b**2 + stretch)
