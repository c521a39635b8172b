"""MuJoCo models of robots with omni or mecanum wheels, written as MJCF.

Two wheel models: `rollers`, with rows of passive rollers on every wheel, and `ball`, one sphere per
wheel that is driven about a body-fixed axis and rolls freely about the others.

What the settings are for: the integrator `discrete` keeps the servo from leading its command
(`implicitfast` leads by 11 ms); the elliptic cone with impratio 10 and sprung axles share the load
evenly between the wheels; rollers carry almost no armature, or they would creep. All there is hangs
together, so looking for islands of it would only take time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal
from xml.etree import ElementTree as ET

from omnidrive.robot import OmniWheel, Robot
from omnidrive.simulation.mjcf_element import add, numbers
from omnidrive.simulation.mjcf_scene import add_looks, add_obstacles, add_surroundings
from omnidrive.simulation.mjcf_wheels import add_ball_wheel, add_roller_wheel
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.walls import Walls

WheelModel = Literal["rollers", "ball"]

TIMESTEP = 0.002
"""Longest physics step in s: short enough for the stiffest named servo, and for where a robot ends
whose wheels spin to be right; balls at 4 ms are a decimetre off after 4 s of hard jerks."""


def omni_model(
    robot: Robot,
    wheels: WheelModel,
    *,
    walls: Walls | None = None,
    moving: Sequence[MovingObstacle] = (),
) -> str:
    """MJCF of ``robot`` on an endless floor.

    The base body's frame is B, at the height of the axles. Actuator ``motor{i}`` is a velocity
    servo in rad/s; positive speed rolls along (-sin axle_i, cos axle_i).

    Args:
        robot: What drives.
        wheels: How its wheels are made.
        walls: The map that stands around it; None: nothing.
        moving: Obstacles that move.
    """
    root = ET.Element("mujoco", model=f"{robot.name}-{wheels}")
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = add(
        root, "option", timestep=TIMESTEP, integrator="discrete", cone="elliptic",
        impratio=10, solver="Newton", jacobian="sparse" if wheels == "rollers" else "dense",
    )  # fmt: skip
    some = walls is not None or bool(moving)
    # the tree of a body's geoms, by which MuJoCo skips pairs, does not know that walls are moved
    add(
        option, "flag", autoreset="disable", island="disable",
        midphase="disable" if some else "enable",
    )  # fmt: skip
    world = add(root, "worldbody")
    add_surroundings(root, world, robot)
    base = add(world, "body", name="base", pos=numbers(0, 0, robot.wheel.radius))
    add(base, "freejoint", name="base")
    _add_chassis(base, robot, wheels)
    add_looks(base, robot)
    if some:
        add_obstacles(root, base, robot, walls=walls, moving=moving)
    actuators = add(root, "actuator")
    add_wheel = {"rollers": add_roller_wheel, "ball": add_ball_wheel}[wheels]
    for i, mount in enumerate(robot.mounts):
        add_wheel(base, actuators, robot, i, mount)
    return ET.tostring(root, encoding="unicode")


def _wheel_mass(wheel: OmniWheel, wheels: WheelModel) -> float:
    return wheel.total_mass if wheels == "rollers" else wheel.mass


def _add_chassis(base: ET.Element, robot: Robot, wheels: WheelModel) -> None:
    one = _wheel_mass(robot.wheel, wheels)
    mass = robot.mass - len(robot.mounts) * one
    if robot.body_inertia is None:
        about_z = robot.frame_inertia * mass / robot.frame_mass
    else:  # the weight of rollers that are not there stays with the wheels
        rest = robot.wheel.total_mass - one
        about_z = robot.body_inertia + rest * sum(m.x**2 + m.y**2 for m in robot.mounts)
    place = (
        round((robot.mass * of_all - one * sum(wheels_at)) / mass, 12)  # without rounding's dust
        for of_all, wheels_at in zip(robot.com, zip(*robot.mounts, strict=True), strict=False)
    )
    about_x = 0.5 * about_z + mass * 0.08**2 / 12.0
    add(
        base, "inertial", pos=numbers(*place, robot.com_height - robot.wheel.radius), mass=mass,
        diaginertia=numbers(about_x, about_x, about_z),
    )  # fmt: skip
