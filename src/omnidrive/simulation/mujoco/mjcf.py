"""MuJoCo models of robots with omni or mecanum wheels, written as MJCF.

Two wheel models: `rollers`, with rows of passive rollers on every wheel, and `ball`, one round cap
per wheel that grips the floor along the wheel's push and slides freely across it.

What the settings are for: the integrator `discrete` keeps the servo from leading its command
(`implicitfast` leads by 11 ms); the elliptic cone with impratio 10 and sprung axles share the load
evenly between the wheels; rollers carry almost no armature, or they would creep. All there is hangs
together, so looking for islands of it would only take time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal
from xml.etree import ElementTree as ET

from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco.mjcf_element import add, numbers
from omnidrive.simulation.mujoco.mjcf_scene import add_looks, add_obstacles, add_surroundings
from omnidrive.simulation.mujoco.mjcf_wheels import (
    FREE,
    add_ball_wheel,
    add_grips,
    add_roller_wheel,
)
from omnidrive.simulation.mujoco.walls import Walls

WheelModel = Literal["rollers", "ball"]

TIMESTEPS: dict[WheelModel, float] = {"rollers": 0.002, "ball": 1.0 / 300.0}
"""Longest physics step in s: rollers take turns on the floor, balls roll evenly."""


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
    rollers = wheels == "rollers"
    root = ET.Element("mujoco", model=f"{robot.name}-{wheels}")
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = add(
        root, "option", timestep=TIMESTEPS[wheels], integrator="discrete", cone="elliptic",
        impratio=10 if rollers else 10 * FREE**2, solver="Newton",
        jacobian="sparse" if rollers else "dense",
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
    _add_chassis(base, robot)
    add_looks(base, robot)
    if some:
        add_obstacles(root, base, robot, walls=walls, moving=moving)
    actuators = add(root, "actuator")
    add_wheel = add_roller_wheel if rollers else add_ball_wheel
    for i, mount in enumerate(robot.mounts):
        add_wheel(base, actuators, robot, i, mount)
    if not rollers:
        add_grips(root, robot)
    return ET.tostring(root, encoding="unicode")


def _add_chassis(base: ET.Element, robot: Robot) -> None:
    mass = robot.frame_mass
    about_z = robot.frame_inertia
    place = (round(x, 12) for x in robot.frame_com)  # without rounding's dust
    about_x = 0.5 * about_z + mass * 0.08**2 / 12.0
    add(
        base, "inertial", pos=numbers(*place, robot.com_height - robot.wheel.radius), mass=mass,
        diaginertia=numbers(about_x, about_x, about_z),
    )  # fmt: skip
