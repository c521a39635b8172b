"""What surrounds the robot in MJCF: floor, light, obstacles; and what is only seen of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from xml.etree import ElementTree as ET

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco.mjcf_element import about_z, add, numbers
from omnidrive.simulation.mujoco.mjcf_wheels import CONTACT, floor_friction
from omnidrive.simulation.mujoco.walls import Walls

NEAR_WALLS = 8
"""Boxes of the map that stand in the physical world: those nearest to the robot."""
AHEAD = 5.0
"""From the robot's body to the end of the furthest part of such a box, in m, at most."""
PARKED = (0.0, 0.0, -1e4)
"""Where boxes are that are not needed."""
MOST_DRAWN = 5000
"""Boxes that are drawn, the largest first."""

_SEEN = {"contype": "0", "conaffinity": "0", "mass": "0", "group": "1"}
_FRAGILE = dict(CONTACT, friction="0.1 0.0005 0.0001", mass="0")
_WALL_COLOUR = ".42 .45 .5 1"
_DRAWN_HEIGHT = 0.2  # m


def add_surroundings(root: ET.Element, world: ET.Element, robot: Robot) -> None:
    """Floor with squares of 0.5 m, sky and light."""
    add(root, "statistic", center="0 0 0", extent="3")  # else walls put away count as far ends
    visual = add(root, "visual")
    add(visual, "global", offwidth="1920", offheight="1080")
    add(visual, "headlight", ambient=".3 .3 .3", diffuse=".25 .25 .25", specular="0 0 0")
    add(visual, "quality", shadowsize="2048")
    assets = add(root, "asset")
    add(
        assets, "texture", type="skybox", builtin="gradient", rgb1=".93 .95 .98",
        rgb2=".7 .78 .88", width="64", height="64",
    )  # fmt: skip
    add(
        assets, "texture", name="squares", type="2d", builtin="checker", rgb1=".86 .87 .89",
        rgb2=".79 .8 .83", width="256", height="256",
    )  # fmt: skip
    add(assets, "material", name="floor", texture="squares", texrepeat="1 1", texuniform="true")
    add(
        world, "light", pos="0 0 6", dir="-.25 .3 -1", directional="true", castshadow="false",
        diffuse=".4 .4 .4", specular=".1 .1 .1",
    )  # fmt: skip
    floor = dict(CONTACT, friction=floor_friction(robot), contype="1", conaffinity="0")
    add(world, "geom", name="floor", type="plane", size="50 50 1", material="floor", **floor)


def add_looks(base: ET.Element, robot: Robot) -> None:
    """A plate, a deck and a nose that shows forward: seen, not felt."""
    top = max(1.15 * robot.wheel.radius, 2.0 * robot.com_height - robot.wheel.radius)
    radius = robot.body_radius
    add(
        base, "geom", name="plate", type="cylinder",
        size=numbers(0.75 * robot.mean_wheel_distance, 0.1 * top),
        pos=numbers(0, 0, 0.6 * top), rgba=".17 .33 .58 1", **_SEEN,
    )  # fmt: skip
    add(
        base, "geom", name="deck", type="cylinder", size=numbers(0.97 * radius, 0.06 * top),
        pos=numbers(0, 0, 1.2 * top), rgba=".2 .4 .7 .45", **_SEEN,
    )  # fmt: skip
    add(
        base, "geom", name="nose", type="box",
        size=numbers(0.17 * radius, 0.05 * radius, 0.05 * top),
        pos=numbers(0.76 * radius, 0, 1.32 * top), rgba=".9 .3 .1 1", **_SEEN,
    )  # fmt: skip


def add_obstacles(
    root: ET.Element,
    base: ET.Element,
    robot: Robot,
    *,
    walls: Walls | None,
    moving: Sequence[MovingObstacle],
) -> None:
    """The robot's body, the boxes that are moved to where walls are near, and moving discs.

    The body is a sphere as wide as the robot and obstacles stand higher than it, so that it meets
    their upright faces and edges at the height of its centre: as a disc would on the floor, by the
    quickest of MuJoCo's collision functions. Only it and obstacles touch each other.
    """
    add(
        base, "geom", name="body", type="sphere", size=robot.body_radius, contype="2",
        conaffinity="0", rgba="1 0 0 .2", group="4", **_FRAGILE,
    )  # fmt: skip
    most = robot.body_radius + AHEAD
    height = most + 1.0  # a body within a wall gets out sideways
    world = root.find("worldbody")
    assert world is not None
    if walls is not None:
        origin, yaw = walls.frame
        stand = add(world, "body", name="walls", pos=numbers(*origin, 0), quat=about_z(yaw))
        for k in range(NEAR_WALLS):
            add(
                stand, "geom", name=f"wall{k}", type="box", size=numbers(most, most, height),
                pos=numbers(*PARKED), contype="0", conaffinity="2", group="3", **_FRAGILE,
            )  # fmt: skip
        _draw(root, stand, walls.boxes)
    for k, mover in enumerate(moving):
        body = add(world, "body", name=f"moving{k}", mocap="true", pos=numbers(*mover.at(0.0), 0))
        add(
            body, "geom", name=f"moving{k}", type="cylinder", size=numbers(mover.radius, height),
            contype="0", conaffinity="2", group="3", **_FRAGILE,
        )  # fmt: skip
        add(
            body, "geom", type="cylinder", size=numbers(mover.radius, 0.5 * _DRAWN_HEIGHT),
            pos=numbers(0, 0, 0.5 * _DRAWN_HEIGHT), rgba=".8 .45 .2 1", **_SEEN,
        )  # fmt: skip


def _draw(root: ET.Element, walls: ET.Element, boxes: Float[Array, "boxes 4"]) -> None:
    """All boxes in one mesh, which costs no more time than one box."""
    boxes = boxes[np.isfinite(boxes).all(axis=1)]
    if len(boxes) == 0:
        return
    sizes = (boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2])
    boxes = boxes[np.argsort(-sizes, kind="stable")[:MOST_DRAWN]]
    vertices = [
        (x, y, z)
        for left, right, bottom, top in boxes.tolist()
        for z in (0.0, _DRAWN_HEIGHT)
        for x, y in ((left, bottom), (right, bottom), (right, top), (left, top))
    ]
    faces = (np.array(_FACES)[None] + 8 * np.arange(len(boxes))[:, None, None]).reshape(-1)
    assets = root.find("asset")
    assert assets is not None
    add(
        assets, "mesh", name="walls", vertex=numbers(*chain.from_iterable(vertices)),
        face=" ".join(map(str, faces.tolist())), inertia="shell",
    )  # fmt: skip
    add(walls, "geom", type="mesh", mesh="walls", rgba=_WALL_COLOUR, **_SEEN)


_FACES = [
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
]  # fmt: skip
"""Of a box whose first four corners lie on the floor, counter-clockwise."""
