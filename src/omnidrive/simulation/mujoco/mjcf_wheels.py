"""Wheels in MJCF: with real rollers, or as one ball each.

Rollers: ellipsoids on free hinges. A wheel turned by d from where its lowest roller lies across the
floor stands ``h(d) = (r - b) cos d + sqrt(b^2 + (a^2 - b^2) sin^2 d cos^2 roller)`` high, with a
and b the roller's half-length and largest radius: the support function of an ellipsoid. Its two
first terms in d cancel for ``a^2 = b r`` at roller = 0, which is what omni wheels have. One row of
mecanum rollers has fewer of them in one turn, so that d reaches further: there a is such that the
wheel is as high where one roller takes over from the next as in between.

A mecanum roller leaves the floor's plane while it rolls by, so that seen from above its axis is
turned by more than it is tilted: ``tan(seen) = tan(tilt) / cos(d)``. It is built with the tilt with
which this is on average the mount's angle; else a robot would slide sideways 1 % slower than its
wheels say.
"""

from __future__ import annotations

from math import asinh, atan, cos, pi, sin, sqrt, tan
from xml.etree import ElementTree as ET

from omnidrive.robot import GRAVITY, Mount, OmniWheel, Robot
from omnidrive.simulation.mujoco.mjcf_element import about_z, add, numbers

_SAG = 0.002  # m that a sprung axle gives under the robot's weight
_SPRING_DAMPING_RATIO = 0.7
ROLLER_ARMATURE = 1e-6  # kg m^2; more makes the robot creep
ROLLER_DAMPING = 2e-6  # N m s/rad
FREE = 1e-4
"""Friction of a ball along its axis, where it has rollers, over that along its push.

MuJoCo makes a contact's second tangent harder than the first by the inverse square of this; so a
model of balls makes the first softer by as much. If it were larger, balls would be on the cone of
their friction whenever they roll, which costs time.
"""
_TILT = 0.02  # rad by which a ball's axis rises inwards, so that one end of its capsule touches
CONTACT = {"condim": "3", "solref": "0.005 1", "solimp": "0.95 0.99 0.0005"}
"""How wheels and the floor press on each other."""

_VISIBLE = {"contype": "0", "conaffinity": "0", "mass": "0", "group": "1"}


def floor_friction(robot: Robot) -> str:
    """Friction of the floor and of tyres: sliding; the last two are unused at condim 3."""
    return numbers(robot.friction, 0.0005, 0.0001)


def add_ball_wheel(
    base: ET.Element, actuators: ET.Element, robot: Robot, i: int, mount: Mount
) -> None:
    """A round cap, the end of a capsule, that turns about an axis across the mount's push.

    The motor turns ``1 / cos(roller)`` times as fast as the cap does about that axis, its torque is
    as much greater there, and inertia about the axle weighs the square of that:
    ``r w cos(roller) = push . v``, without loss.
    """
    wheel, gear = robot.wheel, cos(_TILT) / cos(mount.roller_angle)
    body = _sprung(base, robot, i, mount, mount.axle_angle - mount.roller_angle)
    axis = (-cos(_TILT), 0.0, sin(_TILT))
    add(
        body, "joint", name=f"wheel{i}", type="hinge", axis=numbers(*axis),
        armature=gear**2 * wheel.rotor_inertia,
    )  # fmt: skip
    turned = gear**2 * (wheel.hub_inertia + _rollers_inertia(wheel))
    across = 0.5 * turned + wheel.total_mass * wheel.row_gap**2 / 12.0
    add(
        body, "inertial", pos="0 0 0", mass=wheel.total_mass,
        diaginertia=numbers(turned, across, across),
    )  # fmt: skip
    add(
        body, "geom", name=f"tyre{i}", type="capsule", size=wheel.radius,
        fromto=numbers(0, 0, 0, *(0.4 * wheel.radius * part for part in axis)),
        **(_tyre(robot) | {"conaffinity": "0"}),
    )  # fmt: skip
    _add_servo(actuators, robot, i, joint=f"wheel{i}", gear=gear)


def add_grips(root: ET.Element, robot: Robot) -> None:
    """Contacts of balls with the floor: they hold along their pushes only.

    MuJoCo turns the frame of a capsule's contact with a plane so that its first tangent lies along
    the capsule. Slip is damped less than the load's motion, or a wheel that spins would hop.
    """
    contacts = add(root, "contact")
    for i in range(len(robot.mounts)):
        add(
            contacts, "pair", name=f"grip{i}", geom1="floor", geom2=f"tyre{i}",
            friction=numbers(*ball_friction(robot.friction), 0.0005, 0.0001, 0.0001),
            solreffriction="0.01 1", **CONTACT,
        )  # fmt: skip


def ball_friction(friction: float) -> tuple[float, float]:
    """Of a ball's contact with the floor: along its axis and along its push."""
    return FREE * friction, friction


def add_roller_wheel(
    base: ET.Element, actuators: ET.Element, robot: Robot, i: int, mount: Mount
) -> None:
    """A wheel with rows of rollers, staggered where there are several."""
    wheel = robot.wheel
    body = _sprung(base, robot, i, mount, mount.axle_angle)
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
        fromto=numbers(-half, 0, 0, half, 0, 0), rgba=".66 .68 .72 1", **_VISIBLE,
    )  # fmt: skip
    for row in range(wheel.rows):
        for k in range(wheel.rollers_per_row):
            phase = 2.0 * pi * (k + row / wheel.rows) / wheel.rollers_per_row
            _add_roller(body, robot, mount, (row - 0.5 * (wheel.rows - 1)) * wheel.row_gap, phase)
    _add_servo(actuators, robot, i, joint=f"wheel{i}")


def _sprung(base: ET.Element, robot: Robot, i: int, mount: Mount, yaw: float) -> ET.Element:
    """Body of wheel i on its sprung axle; x along the axle, outwards."""
    pos = numbers(mount.x, mount.y, 0.0)
    body = add(base, "body", name=f"wheel{i}", pos=pos, quat=about_z(yaw))
    load = robot.mass / len(robot.mounts)
    stiffness = load * GRAVITY / _SAG
    add(
        body, "joint", name=f"spring{i}", type="slide", axis="0 0 1", armature=0.02,
        stiffness=stiffness, springref=-_SAG,
        damping=2.0 * _SPRING_DAMPING_RATIO * sqrt(stiffness * load),
    )  # fmt: skip
    return body


def _add_servo(actuators: ET.Element, robot: Robot, i: int, **place: object) -> None:
    """Torque in proportion to the error of speed; a lag delays the set point."""
    limits = numbers(-robot.max_torque, robot.max_torque)
    if robot.motor_lag == 0.0:
        add(
            actuators, "velocity", name=f"motor{i}", kv=robot.servo_gain, forcerange=limits, **place
        )
        return
    add(
        actuators, "general", name=f"motor{i}", forcerange=limits, **place,
        dyntype="filterexact", dynprm=robot.motor_lag, gainprm=robot.servo_gain,
        biastype="affine", biasprm=numbers(0, 0, -robot.servo_gain),
    )  # fmt: skip


def _tyre(robot: Robot) -> dict[str, str]:
    tyre = {"contype": "0", "conaffinity": "1", "mass": "0", "rgba": ".16 .16 .19 1"}
    return dict(CONTACT, friction=floor_friction(robot), **tyre)


def _rollers_inertia(wheel: OmniWheel) -> float:
    """Of all rollers about the axle."""
    return wheel.rollers * wheel.roller_mass * (wheel.radius - wheel.roller_radius) ** 2


def _add_roller(
    wheel_body: ET.Element, robot: Robot, mount: Mount, offset: float, phase: float
) -> None:
    """A free ellipsoid, its axis tilted towards the axle."""
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


def roller_shape(wheel: OmniWheel, seen: float) -> tuple[float, float]:
    """Tilt in rad and half-length in m of rollers whose axes are ``seen`` at that angle."""
    r, b = wheel.radius, wheel.roller_radius
    if seen == 0.0:
        return 0.0, sqrt(b * r)
    furthest = pi / wheel.rollers  # d where the next roller takes over
    tilt = atan(tan(seen) * furthest / asinh(tan(furthest)))  # by the mean of 1 / cos d
    left = r - (r - b) * cos(furthest)
    stretch = (left**2 - b**2) / (sin(furthest) * cos(tilt)) ** 2
    return tilt, sqrt(b**2 + stretch)
