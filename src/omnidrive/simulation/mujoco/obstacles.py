"""Obstacles in MuJoCo and the number of collisions with them."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.geometry.polygon import Polygon
from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MAX_MOVING_OBSTACLES, MovingObstacle
from omnidrive.simulation.mujoco.obstacle_boxes import ObstacleBoxes, box_distances
from omnidrive.simulation.mujoco.outline import box_gaps, touches_discs
from omnidrive.simulation.mujoco.world import MAX_NEAR_BOXES, MAX_REACH, PARKED

_UPDATE_TIME = 0.1  # s; time for which a choice of near boxes must remain valid
_MARGIN = 0.15  # m; distance beyond speed times that time
_MAX_PENETRATION = 0.05  # m; more occurs only if the robot is placed there
_MIN_INTERVAL = 0.12  # s without contact after which a contact is a new collision


class MujocoObstacles:
    """Obstacles of a map and moving obstacles around one robot.

    The physics contains only the few boxes nearest to the robot, chosen at least ten times a
    second, so that the computing time does not depend on the size of the map. In free space no box
    is tested. A box inside which the robot is placed, deeper than by driving, counts as a collision
    but does not push the robot out; it acts again after the robot has left it.

    Attributes:
        collisions: Number of collisions since ``reset``; contacts less than 0.12 s apart are one.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        robot: Robot,
        walls: ObstacleBoxes | None,
        moving: Sequence[MovingObstacle],
    ) -> None:
        """Look up the obstacles in ``model``.

        Raises:
            InvalidInput: There are more than :data:`MAX_MOVING_OBSTACLES` moving obstacles.
        """
        if len(moving) > MAX_MOVING_OBSTACLES:
            raise InvalidInput(
                f"got {len(moving)} moving obstacles, need at most {MAX_MOVING_OBSTACLES}"
            )
        self._model, self._walls, self._moving = model, walls, tuple(moving)
        self._radius = robot.body_radius
        self._polygon = None if robot.outline is None else Polygon.of(np.array(robot.outline))
        first = model.geom("wall0").id if walls is not None else 0
        self._geoms = slice(first, first + MAX_NEAR_BOXES)
        self._mocaps = [int(model.body(f"moving{k}").mocapid[0]) for k in range(len(moving))]
        self._boxes = np.empty((0, 4))
        self._inside = False
        self._last_contact = -inf
        self.collisions = 0

    def reset(self, data: mujoco.MjData) -> None:
        """Remove the boxes, move obstacles to their start and set ``collisions`` to 0."""
        if self._walls is not None:
            self._set_boxes(np.empty((0, 4)))
        self.move_obstacles(data)
        self._inside, self._last_contact, self.collisions = False, -inf, 0

    def update_boxes(self, data: mujoco.MjData) -> bool:
        """Place the boxes near the robot; return whether :meth:`count_collisions` is needed."""
        walls = self._walls
        if walls is not None:
            x, y = data.qpos[:2].tolist()
            speed = float(np.hypot(*data.qvel[:2]))
            reach = self._radius + min(_MARGIN + _UPDATE_TIME * speed, MAX_REACH)
            if np.isfinite(x + y + speed):  # otherwise the run ends
                boxes = walls.nearest(x, y, reach, MAX_NEAR_BOXES)
                depth = 0.0 if self._inside else min(_MAX_PENETRATION, 0.5 * self._radius)
                inside = self._reaches_in(walls, boxes, data.qpos[None, :7], depth)[0]
                self._inside = bool(inside.any())
                if self._inside:
                    self._record_contact(data.time)
                self._set_boxes(boxes[~inside])
        return len(self._boxes) > 0 or bool(self._moving)

    def count_collisions(
        self, places: Float[Array, "steps 7"], times: Float[Array, " steps"]
    ) -> None:
        """Count the collisions since :meth:`update_boxes`.

        A sphere touches a vertical box or cylinder if its centre is nearer than its radius. Reading
        MuJoCo's contacts in every step would take as long as the physics of the model `ball`.

        Args:
            places: Position of the body in W, m, and its quaternion, after each physics step.
            times: Time of each, s.
        """
        touched = np.zeros(len(times), dtype=bool)
        if self._walls is not None and len(self._boxes) > 0:
            touched |= self._reaches_in(self._walls, self._boxes, places, 0.0).any(axis=1)
        for obstacle in self._moving:
            centres = np.array([obstacle.position(t) for t in times.tolist()])
            if self._polygon is None:
                apart = np.hypot(*(places[:, :2] - centres).T)
                touched |= apart < self._radius + obstacle.radius
            else:
                poses = np.column_stack([places[:, :2], _yaws(places)])
                touched |= touches_discs(self._polygon, centres, obstacle.radius, poses)
        for time in times[touched].tolist():
            self._record_contact(time)

    def _reaches_in(
        self,
        walls: ObstacleBoxes,
        boxes: Float[Array, "boxes 4"],
        places: Float[Array, "steps 7"],
        depth: float,
    ) -> Bool[Array, "steps boxes"]:
        """Return whether the body reaches into boxes by more than a depth in m."""
        u, v = walls.to_map_frame(*places[:, :2].T)
        if self._polygon is not None:
            poses = np.column_stack([u, v, _yaws(places) - walls.frame[1]])
            return box_gaps(self._polygon, boxes, poses) < -depth
        reached = [box_distances(box[None], u, v) < self._radius - depth for box in boxes]
        return np.array(reached, bool).reshape(len(boxes), len(places)).T

    def _record_contact(self, time: float) -> None:
        if time - self._last_contact > _MIN_INTERVAL:
            self.collisions += 1
        self._last_contact = time

    def move_obstacles(self, data: mujoco.MjData) -> None:
        """Move the moving obstacles to their positions at the current time."""
        for mocap, obstacle in zip(self._mocaps, self._moving, strict=True):
            data.mocap_pos[mocap, :2] = obstacle.position(data.time)

    def _set_boxes(self, boxes: Float[Array, "near 4"]) -> None:
        """Place these boxes in the simulated world and park the others below the floor."""
        positions, sizes = self._model.geom_pos[self._geoms], self._model.geom_size[self._geoms]
        count = len(boxes)
        if count == len(self._boxes) == 0:
            return
        left, right, bottom, top = boxes.T
        positions[:count] = np.column_stack(
            [0.5 * (left + right), 0.5 * (bottom + top), np.zeros(count)]
        )
        positions[count:] = PARKED
        sizes[:count, :2] = 0.5 * np.column_stack([right - left, top - bottom])
        self._boxes = boxes


def _yaws(places: Float[Array, "steps 7"]) -> Float[Array, " steps"]:
    """Return the yaw of bodies from their positions and quaternions, rad."""
    w, x, y, z = places[:, 3:].T
    yaws: Float[Array, " steps"] = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return yaws
