"""References along paths of ROS 2."""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, ceil, hypot
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference, one_line
from omnidrive.geometry import Pose, WorldTwist, compose, wrap
from omnidrive.planning import SplinePath
from omnidrive.reference import MotionLimits, Reference, time_within_limits
from omnidrive.reference.waypoint_reference import spline_along
from omnidrive.reference.waypoints.waypoints import untimed_waypoints
from omnidrive.robot import Robot
from omnidrive.ros2.planar_messages import pose_of
from omnidrive.ros2.transform_tree import TransformTree

_MAX_POSES = 100_000
_NEAR = 0.02
"""Distance, m, below which the first pose of a path is replaced by that of the robot."""
_SAME = 0.05
"""Distance, m, and angle, rad, up to which two paths are the same ahead of the robot."""
_MAX_COMPARED = 500
"""Number of points of each path above which only some are compared."""
REST = WorldTwist(0.0, 0.0, 0.0)
_MOVING, _LEVER = 0.02, 0.3
"""Speed, m/s, below which a robot counts as standing, and distance that counts as a turn by 1 rad,
m."""
_BEHIND = 3.0
"""Length of the begin of a path on which a moving robot is sought, m."""
_SHORTEST_BLEND, _BLEND_STEP = 0.15, 0.02
"""Length of the curve from a moving robot to its path, m, and distance between its points, m."""


class UnknownFrame(InvalidReference):
    """A path is in a frame that is not connected to the world frame."""


def path_poses(message: Any, world: str, tree: TransformTree) -> Float[Array, "poses 3"]:
    """Return the poses of a ``nav_msgs/msg/Path`` in W; m, m, rad.

    Args:
        message: The path; its frame is W or one that is known in it.
        world: Name of the frame W.
        tree: Known transforms.

    Raises:
        UnknownFrame: The frame is not known in W.
        InvalidReference: There are no poses, too many, or one is not finite.
    """
    frame = message.header.frame_id.removeprefix("/") or world
    offset = tree.pose(frame, world)
    if offset is None:
        raise UnknownFrame(
            f"the path is in the frame {one_line(frame, 60)}, which is not known in {world}"
        )
    if not 0 < len(message.poses) <= _MAX_POSES:
        raise InvalidReference(f"the path has {len(message.poses)} poses, need 1 to {_MAX_POSES}")
    poses = np.array([compose(offset, pose_of(each.pose)) for each in message.poses])
    if not (np.abs(poses) < 1e6).all():
        raise InvalidReference("a pose of the path is not finite")
    return poses


def path_reference(
    poses: Float[Array, "poses 3"],
    start: Pose,
    robot: Robot,
    *,
    speed: float | None = None,
    twist: WorldTwist = REST,
) -> Reference:
    """Return the fastest motion along a path from a pose on, within the limits of the robot.

    A path whose poses all have the heading 0 except perhaps the last one states no headings: the
    robot turns evenly from its own heading to that of the goal.

    A robot that moves follows the path from the point that is nearest to it on; a cubic curve, in
    whose length it can change its direction, leads from its pose and twist to the path.

    Args:
        poses: Poses in W; m, m, rad.
        start: Pose of the robot in W.
        robot: The robot.
        speed: Limit of the speed, m/s; None: that of the robot.
        twist: Twist of the robot in W; m/s, m/s, rad/s.

    Raises:
        InvalidReference: The robot is at the end of the path already, the path is too long, or it
            cannot be followed from ``twist`` on within the limits.
    """
    limits = MotionLimits.of_robot(robot, max_speed=speed)
    moving = _rate(twist) > _MOVING
    ahead = poses[_nearest(poses, start) :] if moving else poses
    joined = _joined(_with_headings(ahead, start), start)
    if not moving:
        spline = spline_along(untimed_waypoints("the path", joined))
        return time_within_limits(spline, robot.chassis, limits)
    length = _blend_length(joined, twist, limits)
    spline = spline_along(untimed_waypoints("the path", _blended(joined, twist, length)))
    points = spline.control_points.copy()  # the second one determines the direction at the start
    move = points[1] - points[0]
    points[1] = points[0] + np.array(twist) * (_rate(move) / _rate(twist))
    return time_within_limits(SplinePath(points), robot.chassis, limits, start_twist=twist)


def _rate(motion: Iterable[float]) -> float:
    """Return the speed of a twist, or the length of a move; 1 rad counts as 0.3 m."""
    x, y, yaw = motion
    return hypot(x, y) + _LEVER * abs(yaw)


def _nearest(poses: Float[Array, "poses 3"], start: Pose) -> int:
    """Return the number of the pose after that which is nearest to the robot.

    Only the begin of the path counts, up to :data:`_BEHIND`, because a path may come back.
    """
    moves = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    begin = int(np.searchsorted(np.cumsum(moves), _BEHIND)) + 1
    distances = np.hypot(*(poses[:begin, :2] - start[:2]).T)
    return min(int(distances.argmin()) + 1, len(poses) - 1)


def _with_headings(poses: Float[Array, "poses 3"], start: Pose) -> Float[Array, "poses 3"]:
    """Return the poses of a path, with evenly changing headings if it states none."""
    ahead = poses.copy()
    if not np.abs(ahead[:-1, 2]).max(initial=0.0) > 0.0:
        moves = np.hypot(*np.diff(np.vstack([start[:2], ahead[:, :2]]), axis=0).T)
        share = np.cumsum(moves) / max(float(moves.sum()), 1e-9)
        ahead[:, 2] = start.yaw + share * wrap(float(ahead[-1, 2]) - start.yaw)
    return ahead


def _joined(ahead: Float[Array, "poses 3"], start: Pose) -> Float[Array, "joined 3"]:
    """Return a path from the pose of the robot on, with unwrapped headings."""
    first = ahead[0]
    near = hypot(first[0] - start.x, first[1] - start.y) < _NEAR and len(ahead) > 1
    joined = np.vstack([start, ahead[1:] if near else ahead])
    joined[:, 2] = np.unwrap(joined[:, 2])
    return joined


def _blend_length(path: Float[Array, "poses 3"], twist: WorldTwist, limits: MotionLimits) -> float:
    """Return the length, m, in which a moving robot can join a path from its first pose on.

    The robot needs v^2 / a times the angle, rad, to change its direction, here with a reserve of
    one half, and v^2 / (2 a) to brake.
    """
    faces = limits.acceleration_faces
    lowest = 0.0 if faces is None else float(np.abs(faces[:, :2]).max())
    speed = hypot(twist[0], twist[1])
    x, y = path[min(len(path) - 1, 2), :2] - path[0, :2]
    angle = abs(wrap(atan2(y, x) - atan2(twist[1], twist[0]))) if speed > _MOVING else 0.0
    offset = float(np.hypot(*(path[1, :2] - path[0, :2])))
    return _SHORTEST_BLEND + 2.0 * offset + (0.5 + 1.5 * angle) * speed**2 * lowest


def _blended(
    path: Float[Array, "poses 3"], twist: WorldTwist, length: float
) -> Float[Array, "points 3"]:
    """Return a path whose first ``length`` (m) are replaced by a cubic curve.

    The curve has the direction of ``twist`` at its start, and that of the path at its end.
    """
    moves = np.diff(path, axis=0)
    distance = np.concatenate([[0.0], np.cumsum([_rate(move) for move in moves.tolist()])])
    length = min(length, float(distance[-1]))
    after = min(int(np.searchsorted(distance, length)), len(path) - 1)
    end = np.array([np.interp(length, distance, column) for column in path.T])
    move = moves[after - 1]
    tangents = (
        length * np.array(twist) / _rate(twist),
        length * move / max(_rate(move), 1e-9),
    )
    curve = CubicHermiteSpline([0.0, 1.0], [path[0], end], np.array(tangents))
    count = max(ceil(length / _BLEND_STEP), 4)
    return np.vstack([curve(np.linspace(0.0, 1.0, count + 1)), path[after + 1 :]])


def is_same_ahead(
    new: Float[Array, "poses 3"], old: Float[Array, "others 3"], position: Pose
) -> bool:
    """Return whether a new path leads the robot where the old one does.

    A planner that repeats its plan every second sends the rest of it. From its point that is
    nearest to the robot on, no point of the new path may be farther than 5 cm from the old one, and
    the goals must agree in position and heading.

    Args:
        new: Poses of the new path in W; m, m, rad.
        old: Poses of the old one.
        position: Pose of the robot.
    """
    if np.hypot(*(new[-1, :2] - old[-1, :2])) > _SAME or abs(wrap(new[-1, 2] - old[-1, 2])) > _SAME:
        return False
    near = int(np.hypot(*(new[:, :2] - position[:2]).T).argmin())
    rest = new[near :: max(len(new) // _MAX_COMPARED, 1), :2]
    old = old[:: max(len(old) // _MAX_COMPARED, 1), :2]
    starts, moves = old[:-1], np.diff(old, axis=0)
    if not len(moves):
        return bool(np.hypot(*(rest - old[0]).T).max() <= _SAME)
    squares = np.maximum((moves**2).sum(axis=1), 1e-12)
    offsets = rest[:, None] - starts
    share = np.clip((offsets * moves).sum(axis=2) / squares, 0.0, 1.0)
    return bool(np.hypot(*(offsets - share[..., None] * moves).T).min(axis=0).max() <= _SAME)
