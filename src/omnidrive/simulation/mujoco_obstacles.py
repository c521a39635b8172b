"""What the robot's body can run into in MuJoCo, and how often it did."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.errors import InvalidInput
from omnidrive.robot import Robot
from omnidrive.simulation.mjcf_scene import AHEAD, NEAR_WALLS, PARKED
from omnidrive.simulation.moving_obstacle import MOST_MOVING, MovingObstacle
from omnidrive.simulation.walls import Walls

Array = np.ndarray

_LOOK_AHEAD = 0.1  # s for which the boxes that are near are chosen
_ROOM = 0.15  # m that the robot may get further in that time than its speed says
_APART = 0.1  # s without touch after which another touch is another collision


class MujocoObstacles:
    """Walls and moving discs around one robot.

    Of the map's boxes the nearest few stand in the physical world, chosen anew ten times a second:
    what is further away than the robot gets in that time cannot matter, and a map of any size costs
    the same. In free space nothing is looked at.

    Attributes:
        collisions: How often the body began to touch something; a touch within 0.1 s of another
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
        some = walls is not None or bool(moving)
        self._body = model.geom("body").id if some else -1
        first = model.geom("wall0").id if walls is not None else 0
        self._geoms = slice(first, first + NEAR_WALLS)
        self._mocaps = [int(model.body(f"moving{k}").mocapid[0]) for k in range(len(moving))]
        self._standing = 0
        self._touched = -inf
        self.collisions = 0

    def reset(self, data: mujoco.MjData) -> None:
        """No walls near, movers where they start, nothing touched."""
        if self._walls is not None:
            self._stand(np.empty((0, 4)))
        self._move(data)
        self._touched, self.collisions = -inf, 0

    def approach(self, data: mujoco.MjData) -> bool:
        """Put up the walls that are near; tell whether there is anything to :meth:`watch`."""
        if self._walls is not None:
            x, y = data.qpos[:2].tolist()
            speed = float(np.hypot(*data.qvel[:2]))
            reach = self._radius + min(_ROOM + _LOOK_AHEAD * speed, AHEAD)
            if np.isfinite(x + y + speed):  # else the run ends
                self._stand(self._walls.near(x, y, reach, NEAR_WALLS))
        return self._standing > 0 or bool(self._moving)

    def watch(self, data: mujoco.MjData) -> None:
        """Count what was touched in the last step, and move what moves for the next."""
        if data.ncon and (data.contact.geom == self._body).any():
            if data.time - self._touched > _APART:
                self.collisions += 1
            self._touched = data.time
        self._move(data)

    def _move(self, data: mujoco.MjData) -> None:
        for mocap, obstacle in zip(self._mocaps, self._moving, strict=True):
            data.mocap_pos[mocap, :2] = obstacle.at(data.time)

    def _stand(self, boxes: Float[Array, "near 4"]) -> None:
        """Let these boxes stand, and no others."""
        places, sizes = self._model.geom_pos[self._geoms], self._model.geom_size[self._geoms]
        count = len(boxes)
        if count == self._standing == 0:
            return
        left, right, bottom, top = boxes.T
        places[:count] = np.column_stack(
            [0.5 * (left + right), 0.5 * (bottom + top), np.zeros(count)]
        )
        places[count:] = PARKED
        sizes[:count, :2] = 0.5 * np.column_stack([right - left, top - bottom])
        self._standing = count
