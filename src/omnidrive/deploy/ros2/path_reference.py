"""References along paths of ROS 2."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.deploy.ros2.planar_messages import compose, pose_of
from omnidrive.deploy.ros2.transform_tree import TransformTree
from omnidrive.errors import InvalidReference, one_line
from omnidrive.geometry import Pose, wrap
from omnidrive.reference import MotionLimits, Reference, time_within_limits
from omnidrive.reference.waypoint_reference import spline_along
from omnidrive.reference.waypoints.waypoints import untimed_waypoints
from omnidrive.robot import Robot

_MOST_POSES = 100_000
_NEAR = 0.02
"""Distance, m, below which the first pose of a path is replaced by that of the robot."""
_SAME = 0.05
"""Distance, m, and angle, rad, up to which two paths are the same ahead of the robot."""


def path_poses(message: Any, world: str, tree: TransformTree) -> Float[Array, "poses 3"]:
    """Return the poses of a ``nav_msgs/msg/Path`` in W; m, m, rad.

    Args:
        message: The path; its frame is W or one that is known in it.
        world: Name of the frame W.
        tree: Known transforms.

    Raises:
        InvalidReference: There are no poses, too many, or one is not finite, or the frame is not
            known in W.
    """
    frame = message.header.frame_id.removeprefix("/") or world
    offset = tree.pose(frame, world)
    if offset is None:
        raise InvalidReference(
            f"the path is in the frame {one_line(frame, 60)}, which is not known in {world}"
        )
    if not 0 < len(message.poses) <= _MOST_POSES:
        raise InvalidReference(f"the path has {len(message.poses)} poses, need 1 to {_MOST_POSES}")
    poses = np.array([compose(offset, pose_of(each.pose)) for each in message.poses])
    if not (np.abs(poses) < 1e6).all():
        raise InvalidReference("a pose of the path is not finite")
    return poses


def path_reference(
    poses: Float[Array, "poses 3"], start: Pose, robot: Robot, *, speed: float | None = None
) -> Reference:
    """Return the fastest motion along a path from the robot's pose, within its limits.

    A path whose poses all have the heading 0 except perhaps the last one states no headings: the
    robot turns evenly from its own heading to that of the goal.

    Args:
        poses: Poses in W; m, m, rad.
        start: Pose of the robot in W.
        robot: The robot.
        speed: Limit of the speed, m/s; None: that of the robot.

    Raises:
        InvalidReference: The robot is at the end of the path already, or the path is too long.
    """
    ahead = poses.copy()
    if not np.abs(ahead[:-1, 2]).max(initial=0.0) > 0.0:
        moves = np.hypot(*np.diff(np.vstack([start[:2], ahead[:, :2]]), axis=0).T)
        share = np.cumsum(moves) / max(float(moves.sum()), 1e-9)
        ahead[:, 2] = start.yaw + share * wrap(float(ahead[-1, 2]) - start.yaw)
    first = ahead[0]
    near = hypot(first[0] - start.x, first[1] - start.y) < _NEAR and len(ahead) > 1
    joined = np.vstack([start, ahead[1:] if near else ahead])
    limits = MotionLimits.of_robot(robot)
    if speed is not None:
        limits = MotionLimits(
            wheel_speed=limits.wheel_speed,
            speed=speed,
            acceleration_faces=limits.acceleration_faces,
        )
    spline = spline_along(untimed_waypoints("the path", joined))
    return time_within_limits(spline, robot.chassis, limits)


def is_same_ahead(
    new: Float[Array, "poses 3"], old: Float[Array, "others 3"], position: Pose
) -> bool:
    """Return whether a new path leads the robot where the old one does.

    A planner that repeats its plan every second sends the rest of it. Both paths are compared from
    the points that are nearest to the robot on: no point of the new one may be farther than 5 cm
    from the old one, and the goals must agree in position and heading.

    Args:
        new: Poses of the new path in W; m, m, rad.
        old: Poses of the old one.
        position: Pose of the robot.
    """
    if np.hypot(*(new[-1, :2] - old[-1, :2])) > _SAME or abs(wrap(new[-1, 2] - old[-1, 2])) > _SAME:
        return False
    near = int(np.hypot(*(new[:, :2] - position[:2]).T).argmin())
    rest = new[near :: max(len(new) // 500, 1), :2]
    starts, moves = old[:-1, :2], np.diff(old[:, :2], axis=0)
    if not len(moves):
        return bool(np.hypot(*(rest - old[0, :2]).T).max() <= _SAME)
    squares = np.maximum((moves**2).sum(axis=1), 1e-12)
    for point in rest:
        share = np.clip(((point - starts) * moves).sum(axis=1) / squares, 0.0, 1.0)
        if np.hypot(*(point - starts - share[:, None] * moves).T).min() > _SAME:
            return False
    return True
