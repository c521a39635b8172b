"""Floor, lights and obstacles in MJCF (MuJoCo's model format), and visual geoms of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from xml.etree import ElementTree as ET

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry.polygon import Polygon
from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco.mjcf import (
    CONTACT,
    VISUAL,
    add,
    floor_friction,
    numbers,
    yaw_quaternion,
)
from omnidrive.simulation.mujoco.obstacle_boxes import ObstacleBoxes
from omnidrive.simulation.mujoco.outline import add_prisms

MAX_NEAR_BOXES = 8
"""Largest number of boxes of the map that are simulated at a time: those nearest to the robot."""
MAX_REACH = 5.0
"""Largest distance from the robot's body to which these boxes are simulated, m; clipped there."""
PARKED = (0.0, 0.0, -1e4)
"""Position of unused boxes, far below the floor, m."""
MAX_DRAWN_BOXES = 5000
"""Largest number of drawn boxes of the map: those with the largest areas."""

_SMOOTH_CONTACT = dict(CONTACT, friction="0.1 0.0005 0.0001", mass="0")
_WALL_COLOUR = ".42 .45 .5 1"
_DRAWN_HEIGHT = 0.2  # m
_HALF_THICKNESS = 0.01  # m, of the collision body of an outline


def add_floor(root: ET.Element, world: ET.Element, robot: Robot) -> None:
    """Add the floor with squares of 0.5 m, the sky, the lights and the settings of the renderer."""
    add(root, "statistic", center="0 0 0", extent="3")  # not computed: parked boxes would count
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


def add_visuals(root: ET.Element, base: ET.Element, robot: Robot) -> None:
    """Add a plate, a deck and a nose that points forward, all without mass and contacts."""
    top = max(1.15 * robot.wheel.radius, 2.0 * robot.com_height - robot.wheel.radius)
    radius = robot.body_radius
    add(
        base, "geom", name="plate", type="cylinder",
        size=numbers(0.75 * robot.mean_wheel_distance, 0.1 * top),
        pos=numbers(0, 0, 0.6 * top), rgba=".17 .33 .58 1", **VISUAL,
    )  # fmt: skip
    deck = {"rgba": ".2 .4 .7 .45", **VISUAL}
    if robot.outline is None:
        add(
            base, "geom", name="deck", type="cylinder", size=numbers(0.97 * radius, 0.06 * top),
            pos=numbers(0, 0, 1.2 * top), **deck,
        )  # fmt: skip
    else:
        polygon = Polygon.of(np.array(robot.outline))
        add_prisms(root, base, "deck", polygon, (1.14 * top, 1.26 * top), deck)
    add(
        base, "geom", name="nose", type="box",
        size=numbers(0.17 * radius, 0.05 * radius, 0.05 * top),
        pos=numbers(0.76 * radius, 0, 1.32 * top), rgba=".9 .3 .1 1", **VISUAL,
    )  # fmt: skip


def add_obstacles(
    root: ET.Element,
    base: ET.Element,
    robot: Robot,
    *,
    walls: ObstacleBoxes | None,
    moving: Sequence[MovingObstacle],
) -> None:
    """Add the robot's collision body, the boxes for near obstacles, and the moving obstacles.

    The collision body is a sphere with the robot's radius, and obstacles are higher than it. It
    therefore touches their vertical faces and edges at the height of its centre, as a disc on the
    floor would, with the fastest of MuJoCo's collision functions. With an outline it is a flat
    prism at that height. It collides only with obstacles, and obstacles collide only with it.

    Args:
        root: Element ``mujoco`` with the elements ``worldbody`` and ``asset``.
        base: Element ``body`` of the robot.
        robot: The robot.
        walls: Boxes of the map; None: no map.
        moving: Moving obstacles, at their positions at t = 0.
    """
    shape = {"contype": "2", "conaffinity": "0", "rgba": "1 0 0 .2", "group": "4"} | _SMOOTH_CONTACT
    if robot.outline is None:
        add(base, "geom", name="body", type="sphere", size=robot.body_radius, **shape)
    else:
        polygon = Polygon.of(np.array(robot.outline))
        add_prisms(root, base, "body", polygon, (-_HALF_THICKNESS, _HALF_THICKNESS), shape)
    reach = robot.body_radius + MAX_REACH  # half the side of the largest clipped box
    height = reach + 1.0  # the greatest half size: a body inside is pushed out sideways
    world = root.find("worldbody")
    assert world is not None
    if walls is not None:
        origin, yaw = walls.frame
        walls_body = add(
            world, "body", name="walls", pos=numbers(*origin, 0), quat=yaw_quaternion(yaw)
        )
        for k in range(MAX_NEAR_BOXES):
            add(
                walls_body, "geom", name=f"wall{k}", type="box", size=numbers(reach, reach, height),
                pos=numbers(*PARKED), contype="0", conaffinity="2", group="3", **_SMOOTH_CONTACT,
            )  # fmt: skip
        _add_mesh(root, walls_body, walls.boxes)
    for k, obstacle in enumerate(moving):
        body = add(
            world, "body", name=f"moving{k}", mocap="true", pos=numbers(*obstacle.position(0.0), 0)
        )
        add(
            body, "geom", name=f"moving{k}", type="cylinder", size=numbers(obstacle.radius, height),
            contype="0", conaffinity="2", group="3", **_SMOOTH_CONTACT,
        )  # fmt: skip
        add(
            body, "geom", type="cylinder", size=numbers(obstacle.radius, 0.5 * _DRAWN_HEIGHT),
            pos=numbers(0, 0, 0.5 * _DRAWN_HEIGHT), rgba=".8 .45 .2 1", **VISUAL,
        )  # fmt: skip


def _add_mesh(root: ET.Element, walls: ET.Element, boxes: Float[Array, "boxes 4"]) -> None:
    """Draw boxes as one mesh, which is drawn as fast as one box.

    Args:
        root: Element ``mujoco`` with the element ``asset``.
        walls: Element ``body`` to which the mesh belongs.
        boxes: (left, right, bottom, top) of each box in the frame of ``walls``, m. Infinite boxes
            are not drawn.
    """
    boxes = boxes[np.isfinite(boxes).all(axis=1)]
    if len(boxes) == 0:
        return
    areas = (boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2])
    boxes = boxes[np.argsort(-areas, kind="stable")[:MAX_DRAWN_BOXES]]
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
    add(walls, "geom", type="mesh", mesh="walls", rgba=_WALL_COLOUR, **VISUAL)


_FACES = [
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
]  # fmt: skip
"""Corners of the triangles of a box, counter-clockwise seen from outside.

Corners 0 to 3 are on the floor, counter-clockwise seen from above; 4 to 7 are above them.
"""
