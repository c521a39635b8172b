"""What the robot's body can run into in MuJoCo, and how often it did."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MOST_MOVING, MovingObstacle
from omnidrive.simulation.mujoco.mjcf_scene import AHEAD, NEAR_WALLS, PARKED
from omnidrive.simulation.mujoco.walls import Walls, distances

_LOOK_AHEAD = 0.1  # s for which the boxes that are near are chosen
_ROOM = 0.15  # m that the robot may get further in that time than its speed says
_DEEP = 0.05  # m into a wall to which no robot drives: it was put there
_APART = 0.12  # s without touch after which another touch is another collision


class MujocoObstacles:
    """Walls and moving discs around one robot.

    Of the map's boxes the nearest few stand in the physical world, chosen anew ten times a second:
    what is further away than the robot gets in that time cannot matter, and a map of any size costs
    the same. In free space nothing is looked at. A wall into which the robot was put, as no robot
    drives, is a collision but does not throw it out: it stands again once the robot has left it.

    Attributes:
        collisions: How often the body began to touch something; a touch within 0.12 s of another
            is the same collision.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        robot: Robot,
        walls: Walls | None,
        moving: Sequence[MovingObstacle],
    ) -> None:
        """Find what was built into ``model``.

        Raises:
            InvalidInput: More than :data:`MOST_MOVING` obstacles move.
        """
        if len(moving) > MOST_MOVING:
            raise InvalidInput(f"{len(moving)} obstacles move, need at most {MOST_MOVING}")
        self._model, self._walls, self._moving = model, walls, tuple(moving)
        self._radius = robot.body_radius
        first = model.geom("wall0").id if walls is not None else 0
        self._geoms = slice(first, first + NEAR_WALLS)
        self._mocaps = [int(model.body(f"moving{k}").mocapid[0]) for k in range(len(moving))]
        self._boxes = np.empty((0, 4))
        self._within = False
        self._touched = -inf
        self.collisions = 0

    def reset(self, data: mujoco.MjData) -> None:
        """No walls near, movers where they start, nothing touched."""
        if self._walls is not None:
            self._stand(np.empty((0, 4)))
        self.move(data)
        self._within, self._touched, self.collisions = False, -inf, 0

    def approach(self, data: mujoco.MjData) -> bool:
        """Put up the walls that are near; tell whether there is anything to :meth:`count`."""
        walls = self._walls
        if walls is not None:
            x, y = data.qpos[:2].tolist()
            speed = float(np.hypot(*data.qvel[:2]))
            reach = self._radius + min(_ROOM + _LOOK_AHEAD * speed, AHEAD)
            if np.isfinite(x + y + speed):  # else the run ends
                boxes = walls.near(x, y, reach, NEAR_WALLS)
                deep = 0.0 if self._within else min(_DEEP, 0.5 * self._radius)
                inside = distances(boxes, *walls.in_map(x, y)) < self._radius - deep
                self._within = bool(inside.any())
                if self._within:
                    self._touch(data.time)
                self._stand(boxes[~inside])
        return len(self._boxes) > 0 or bool(self._moving)

    def count(self, places: Float[Array, "steps 2"], times: Float[Array, " steps"]) -> None:
        """Count what was touched on the way since :meth:`approach`.

        From where the body's centre was, in m of W, and when, in s: a sphere touches an upright box
        or cylinder if it is nearer than its radius. Going through MuJoCo's contacts in every step
        would take as long as the physics of balls.
        """
        touched = np.zeros(len(times), dtype=bool)
        if self._walls is not None:
            u, v = self._walls.in_map(*places.T)
            for box in self._boxes:
                touched |= distances(box[None], u, v) < self._radius
        for obstacle in self._moving:
            there = np.array([obstacle.at(t) for t in times.tolist()])
            touched |= np.hypot(*(places - there).T) < self._radius + obstacle.radius
        for time in times[touched].tolist():
            self._touch(time)

    def _touch(self, time: float) -> None:
        if time - self._touched > _APART:
            self.collisions += 1
        self._touched = time

    def move(self, data: mujoco.MjData) -> None:
        """Put what moves where it is now."""
        for mocap, obstacle in zip(self._mocaps, self._moving, strict=True):
            data.mocap_pos[mocap, :2] = obstacle.at(data.time)

    def _stand(self, boxes: Float[Array, "near 4"]) -> None:
        """Let these boxes stand, and no others."""
        places, sizes = self._model.geom_pos[self._geoms], self._model.geom_size[self._geoms]
        count = len(boxes)
        if count == len(self._boxes) == 0:
            return
        left, right, bottom, top = boxes.T
        places[:count] = np.column_stack(
            [0.5 * (left + right), 0.5 * (bottom + top), np.zeros(count)]
        )
        places[count:] = PARKED
        sizes[:count, :2] = 0.5 * np.column_stack([right - left, top - bottom])
        self._boxes = boxes
