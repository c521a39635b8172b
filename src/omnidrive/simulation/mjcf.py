"""MuJoCo models of omni-wheel robots, written as MJCF.

Two wheel models: `rollers`, with two staggered rows of passive rollers per wheel, and `ball`, one
sphere per wheel that is driven about a body-fixed axis and rolls freely about the others.

What the settings are for: the integrator `discrete` keeps the servo from leading its command
(`implicitfast` leads by 11 ms); the elliptic cone with impratio 10 and sprung axles share the load
evenly between the wheels; rollers carry almost no armature, or they would creep.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt
from typing import Literal
from xml.etree import ElementTree as ET

from omnidrive.robot import GRAVITY, Mount, OmniWheel, Robot

WheelModel = Literal["rollers", "ball"]

TIMESTEP = 0.002
"""Longest physics step in s: short enough for the stiffest named servo."""


_SAG = 0.002  # m that a sprung axle gives under the robot's weight
_SPRING_DAMPING_RATIO = 0.7
_ROLLER_ARMATURE = 1e-6  # kg m^2; more makes the robot creep
_ROLLER_DAMPING = 2e-6  # N m s/rad
_CONTACT = {"condim": "3", "solref": "0.005 1", "solimp": "0.95 0.99 0.0005"}


def omni_model(robot: Robot, wheels: WheelModel) -> str:
    """MJCF of ``robot`` on an endless floor.

    The base body's frame is B, at the height of the axles. Actuator ``motor{i}`` is a velocity
    servo in rad/s; positive speed rolls along (-sin axle_i, cos axle_i).
    """
    root = ET.Element("mujoco", model=f"{robot.name}-{wheels}")
    _add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = _add(
        root, "option", timestep=TIMESTEP, integrator="discrete", cone="elliptic", impratio=10,
        solver="Newton", jacobian="sparse" if wheels == "rollers" else "dense",
    )  # fmt: skip
    _add(option, "flag", autoreset="disable")
    world = _add(root, "worldbody")
    floor = dict(_CONTACT, friction=_friction(robot), contype="1", conaffinity="0")
    _add(world, "geom", name="floor", type="plane", size="50 50 1", **floor)
    base = _add(world, "body", name="base", pos=_numbers(0, 0, robot.wheel.radius))
    _add(base, "freejoint", name="base")
    _add_chassis(base, robot, wheels)
    actuators = _add(root, "actuator")
    add_wheel = {"rollers": _add_roller_wheel, "ball": _add_ball_wheel}[wheels]
    for i, mount in enumerate(robot.mounts):
        add_wheel(base, actuators, robot, i, mount)
    return ET.tostring(root, encoding="unicode")


def _add(parent: ET.Element, tag: str, **attributes: object) -> ET.Element:
    return ET.SubElement(parent, tag, {k: str(v) for k, v in attributes.items()})


def _numbers(*values: float) -> str:
    return " ".join(f"{v:.9g}" for v in values)


def _friction(robot: Robot) -> str:
    return _numbers(robot.friction, 0.0005, 0.0001)  # the last two are unused at condim 3


def _wheel_mass(wheel: OmniWheel, wheels: WheelModel) -> float:
    return wheel.total_mass if wheels == "rollers" else wheel.mass


def _add_chassis(base: ET.Element, robot: Robot, wheels: WheelModel) -> None:
    mass = robot.mass - len(robot.mounts) * _wheel_mass(robot.wheel, wheels)
    about_z = robot.frame_inertia * mass / robot.frame_mass
    about_x = 0.5 * about_z + mass * 0.08**2 / 12.0
    _add(
        base, "inertial", pos=_numbers(0, 0, robot.com_height - robot.wheel.radius), mass=mass,
        diaginertia=_numbers(about_x, about_x, about_z),
    )  # fmt: skip


def _add_wheel_body(base: ET.Element, robot: Robot, i: int, mount: Mount) -> ET.Element:
    """Body of wheel i on its sprung axle; x along the axle, outwards."""
    pos = _numbers(mount.x, mount.y, 0.0)
    body = _add(base, "body", name=f"wheel{i}", pos=pos, quat=_about_z(mount.axle))
    load = robot.mass / len(robot.mounts)
    stiffness = load * GRAVITY / _SAG
    _add(
        body, "joint", name=f"spring{i}", type="slide", axis="0 0 1", armature=0.02,
        stiffness=stiffness, springref=-_SAG,
        damping=2.0 * _SPRING_DAMPING_RATIO * sqrt(stiffness * load),
    )  # fmt: skip
    return body


def _about_z(angle: float) -> str:
    return _numbers(cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle))


def _servo(robot: Robot, i: int) -> dict[str, object]:
    return {
        "name": f"motor{i}",
        "kv": robot.servo_gain,
        "forcerange": _numbers(-robot.max_torque, robot.max_torque),
    }


def _tyre(robot: Robot) -> dict[str, str]:
    return dict(_CONTACT, friction=_friction(robot), contype="0", conaffinity="1", mass="0")


def _hub_inertia(wheel: OmniWheel) -> float:
    return 0.5 * wheel.mass * (0.7 * wheel.radius) ** 2  # most of the mass lies within 0.7 r


def _add_ball_wheel(
    base: ET.Element, actuators: ET.Element, robot: Robot, i: int, mount: Mount
) -> None:
    wheel = robot.wheel
    pos = _numbers(mount.x, mount.y, 0.0)
    _add(base, "site", name=f"drive{i}", pos=pos, quat=_about_z(mount.axle))
    body = _add_wheel_body(base, robot, i, mount)
    _add(body, "joint", name=f"wheel{i}", type="ball", armature=wheel.rotor_inertia)
    inertia = _hub_inertia(wheel)
    _add(body, "inertial", pos="0 0 0", mass=wheel.mass, diaginertia=_numbers(*[inertia] * 3))
    _add(body, "site", name=f"hub{i}")
    _add(body, "geom", type="sphere", size=wheel.radius, **_tyre(robot))
    _add(
        actuators, "velocity", site=f"hub{i}", refsite=f"drive{i}", gear="0 0 0 -1 0 0",
        **_servo(robot, i),
    )  # fmt: skip


def _add_roller_wheel(
    base: ET.Element, actuators: ET.Element, robot: Robot, i: int, mount: Mount
) -> None:
    wheel = robot.wheel
    body = _add_wheel_body(base, robot, i, mount)
    _add(body, "joint", name=f"wheel{i}", type="hinge", axis="-1 0 0", armature=wheel.rotor_inertia)
    about_axle = _hub_inertia(wheel)
    across = 0.5 * about_axle + wheel.mass * wheel.row_gap**2 / 12.0
    _add(
        body, "inertial", pos="0 0 0", mass=wheel.mass,
        diaginertia=_numbers(about_axle, across, across),
    )  # fmt: skip
    for row in range(2):
        for k in range(wheel.rollers_per_row):
            phase = 2.0 * pi * (k + 0.5 * row) / wheel.rollers_per_row
            _add_roller(body, robot, (row - 0.5) * wheel.row_gap, phase)
    _add(actuators, "velocity", joint=f"wheel{i}", **_servo(robot, i))


def _add_roller(wheel_body: ET.Element, robot: Robot, offset: float, phase: float) -> None:
    """A free ellipsoid whose middle has the wheel's curvature: half-length sqrt(r_roller r)."""
    wheel = robot.wheel
    b = wheel.roller_radius
    reach = wheel.radius - b
    body = _add(
        wheel_body, "body", pos=_numbers(offset, reach * cos(phase), reach * sin(phase)),
        zaxis=_numbers(0.0, -sin(phase), cos(phase)),
    )  # fmt: skip
    _add(
        body, "joint", type="hinge", axis="0 0 1", damping=_ROLLER_DAMPING,
        armature=_ROLLER_ARMATURE,
    )  # fmt: skip
    about_axis = 0.5 * wheel.roller_mass * b**2
    inertia = _numbers(2.0 * about_axis, 2.0 * about_axis, about_axis)
    _add(body, "inertial", pos="0 0 0", mass=wheel.roller_mass, diaginertia=inertia)
    size = _numbers(b, b, sqrt(b * wheel.radius))
    _add(body, "geom", type="ellipsoid", size=size, **_tyre(robot))
