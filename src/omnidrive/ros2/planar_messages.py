"""Planar poses, twists and maps as messages of ROS 2, and back."""

from __future__ import annotations

from math import atan2, cos, sin
from typing import Any

import numpy as np

from omnidrive.errors import InvalidMap
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.ros2.message import Message

_MAX_CELLS = 50_000_000
"""Largest number of cells of a map that is accepted, as of map files."""


def yaw_of(orientation: Any) -> float:
    """Return the yaw of a quaternion, rad, from -pi to pi.

    The quaternion need not be normalised (REP 103; Diebel 2006, eq. 290).
    """
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def is_level(orientation: Any) -> bool:
    """Return whether a quaternion leaves the z axis where it is, to 10 degrees."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    squares = x * x + y * y + z * z + w * w
    return bool(squares - 2.0 * (x * x + y * y) >= 0.985 * squares)


def pose_of(message: Any) -> Pose:
    """Return a ``geometry_msgs/msg/Pose`` as planar pose; m, m, rad."""
    return Pose(message.position.x, message.position.y, yaw_of(message.orientation))


def transform_of(message: Any) -> Pose:
    """Return a ``geometry_msgs/msg/Transform`` as pose of the child in the parent; m, m, rad."""
    return Pose(message.translation.x, message.translation.y, yaw_of(message.rotation))


def twist_of(message: Any) -> BodyTwist:
    """Return a ``geometry_msgs/msg/Twist`` as body twist; m/s, m/s, rad/s."""
    return BodyTwist(message.linear.x, message.linear.y, message.angular.z)


def set_pose(message: Any, pose: Pose) -> None:
    """Write a planar pose into a ``geometry_msgs/msg/Pose``."""
    message.position.x, message.position.y = pose.x, pose.y
    set_yaw(message.orientation, pose.yaw)


def set_transform(message: Any, pose: Pose) -> None:
    """Write the pose of the child in the parent into a ``geometry_msgs/msg/Transform``."""
    message.translation.x, message.translation.y = pose.x, pose.y
    set_yaw(message.rotation, pose.yaw)


def set_yaw(orientation: Any, yaw: float) -> None:
    """Write a yaw (rad) into a quaternion."""
    orientation.x = orientation.y = 0.0
    orientation.z, orientation.w = sin(0.5 * yaw), cos(0.5 * yaw)


def set_twist(message: Any, twist: BodyTwist) -> None:
    """Write a body twist into a ``geometry_msgs/msg/Twist``."""
    message.linear.x, message.linear.y, message.angular.z = twist


def planar_covariance(sigmas: tuple[float, float, float]) -> np.ndarray:
    """Return the 36 entries of the covariance of x, y and yaw; other axes are not measured."""
    diagonal = np.array([sigmas[0], sigmas[1], 1e3, 1e3, 1e3, sigmas[2]]) ** 2
    return np.diag(diagonal).ravel()


def map_message(grid: OccupancyGrid, message: Message) -> Message:
    """Return a grid as ``nav_msgs/msg/OccupancyGrid``: 0 free, 100 occupied.

    Args:
        grid: The grid.
        message: An empty message, whose header stays.
    """
    rows, cols = grid.occupied.shape
    message.info.resolution, message.info.width, message.info.height = grid.resolution, cols, rows
    set_pose(message.info.origin, Pose(*grid.origin, grid.yaw))
    message.data = np.where(grid.occupied, 100, 0).astype(np.int8).ravel()
    return message


def grid_of(message: Any, *, unknown_occupied: bool = True) -> OccupancyGrid:
    """Return a ``nav_msgs/msg/OccupancyGrid`` as grid: occupied from 65 on, as in Nav2.

    Args:
        message: The message.
        unknown_occupied: Whether unknown cells (-1) count as occupied.

    Raises:
        InvalidMap: Width and height do not fit the data, the map is too large, or a number is not
            finite.
    """
    width, height = message.info.width, message.info.height
    if not 0 < width * height <= _MAX_CELLS or width * height != len(message.data):
        raise InvalidMap(
            f"the map of {width} times {height} cells has {len(message.data)} of them, need 1 to "
            f"{_MAX_CELLS}"
        )
    cells = np.asarray(message.data).reshape(height, width)
    occupied = (cells >= 65) | ((cells < 0) if unknown_occupied else np.zeros_like(cells, bool))
    origin = pose_of(message.info.origin)
    return OccupancyGrid(
        occupied, float(message.info.resolution), (origin.x, origin.y), yaw=origin.yaw
    )
