"""MuJoCo models of robots with omni or mecanum wheels, written as MJCF.

Two wheel models: `rollers`, with rows of passive rollers on every wheel, and `ball`, one round cap
per wheel with friction along the wheel's force direction and almost none across it.

Reasons for the settings: with the integrator `discrete` the servo does not lead its command
(`implicitfast` leads by 11 ms); the elliptic cone with impratio 10 and sprung axles distribute the
load evenly over the wheels; rollers have almost no armature, because armature makes the robot
creep. The whole model is one constraint island, so that the search for islands is disabled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal
from xml.etree import ElementTree as ET

from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco.mjcf import add, numbers
from omnidrive.simulation.mujoco.obstacle_boxes import ObstacleBoxes
from omnidrive.simulation.mujoco.wheels import (
    ROLLING_FRICTION_RATIO,
    add_ball_contacts,
    add_ball_wheel,
    add_roller_wheel,
)
from omnidrive.simulation.mujoco.world import add_floor, add_obstacles, add_visuals

WheelModel = Literal["rollers", "ball"]

TIMESTEPS: dict[WheelModel, float] = {"rollers": 0.002, "ball": 1.0 / 300.0}
"""Longest physics step, s. Balls roll evenly and permit a longer one than rollers."""


def robot_mjcf(
    robot: Robot,
    wheels: WheelModel,
    *,
    walls: ObstacleBoxes | None = None,
    moving: Sequence[MovingObstacle] = (),
) -> str:
    """Return the MJCF of ``robot`` on an infinite floor.

    The frame of the body ``base`` is B, at the height of the axles. Actuator ``motor{i}`` is a
    velocity servo in rad/s; a positive speed rolls along (-sin axle_i, cos axle_i).

    Args:
        robot: The robot.
        wheels: Model of its wheels.
        walls: Boxes of the map's obstacles; None: no map.
        moving: Moving obstacles.
    """
    rollers = wheels == "rollers"
    root = ET.Element("mujoco", model=f"{robot.name}-{wheels}")
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = add(
        root, "option", timestep=TIMESTEPS[wheels], integrator="discrete", cone="elliptic",
        impratio=10 if rollers else 10 * ROLLING_FRICTION_RATIO**2, solver="Newton",
        jacobian="sparse" if rollers else "dense",
    )  # fmt: skip
    has_obstacles = walls is not None or bool(moving)
    # the bounding volumes of the midphase are constant, but the boxes of the map move
    add(
        option, "flag", autoreset="disable", island="disable",
        midphase="disable" if has_obstacles else "enable",
    )  # fmt: skip
    world = add(root, "worldbody")
    add_floor(root, world, robot)
    base = add(world, "body", name="base", pos=numbers(0, 0, robot.wheel.radius))
    add(base, "freejoint", name="base")
    _add_chassis(base, robot)
    add_visuals(root, base, robot)
    if has_obstacles:
        add_obstacles(root, base, robot, walls=walls, moving=moving)
    actuators = add(root, "actuator")
    add_wheel = add_roller_wheel if rollers else add_ball_wheel
    for i, mount in enumerate(robot.mounts):
        add_wheel(base, actuators, robot, i, mount)
    if not rollers:
        add_ball_contacts(root, robot)
    return ET.tostring(root, encoding="unicode")


def _add_chassis(base: ET.Element, robot: Robot) -> None:
    mass = robot.frame_mass
    about_z = robot.frame_inertia
    com = (round(x, 12) for x in robot.frame_com)  # removes rounding errors
    about_x = 0.5 * about_z + mass * 0.08**2 / 12.0
    add(
        base, "inertial", pos=numbers(*com, robot.com_height - robot.wheel.radius), mass=mass,
        diaginertia=numbers(about_x, about_x, about_z),
    )  # fmt: skip
