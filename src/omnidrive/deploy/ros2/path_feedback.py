"""Feedback of the action ``follow_path``."""

from __future__ import annotations

from math import atan2, hypot
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose, wrap
from omnidrive.ros2.message import Message
from omnidrive.ros2.planar_messages import set_pose


class Tracking(NamedTuple):
    """Where a robot is beside a path, as ``nav2_msgs/msg/TrackingFeedback`` defines it."""

    segment: int
    """Number of the nearest segment."""
    offset: float
    """Distance from it, m; positive: the robot is on its left."""
    heading: float
    """Angle from the heading of the robot to the direction of the segment, rad."""
    remaining: float
    """Length of the path from the start of the segment on, m."""


def tracking(poses: Float[Array, "poses 3"], pose: Pose) -> Tracking:
    """Return where a robot is beside a path of at least one pose in W."""
    points = poses[:, :2]
    here = np.array([pose.x, pose.y])
    if len(points) == 1:
        return Tracking(0, float(np.hypot(*(here - points[0]))), 0.0, 0.0)
    moves = np.diff(points, axis=0)
    lengths = np.hypot(*moves.T)
    beside = here - points[:-1]
    share = np.clip((beside * moves).sum(axis=1) / np.maximum(lengths**2, 1e-12), 0.0, 1.0)
    distances = np.hypot(*(beside - share[:, None] * moves).T)
    nearest = int(distances.argmin())
    (dx, dy), (x, y) = moves[nearest].tolist(), beside[nearest].tolist()
    side = 1.0 if dx * y - dy * x >= 0.0 else -1.0
    turn = wrap(atan2(dy, dx) - pose.yaw)
    return Tracking(nearest, side * float(distances[nearest]), turn, float(lengths[nearest:].sum()))


def fill_feedback(
    feedback: Message, poses: Float[Array, "poses 3"], pose: Pose, speed: float, header: Message
) -> None:
    """Set the fields of a ``FollowPath_Feedback`` of any distribution.

    Args:
        feedback: The message.
        poses: Path in W; m, m, rad.
        pose: Pose of the robot in W.
        speed: Commanded speed, m/s.
        header: Stamp and frame of the pose.
    """
    filled = feedback
    if feedback.interface.fields[0].name == "tracking_feedback":  # from Lyrical on
        filled = feedback.tracking_feedback
        found = tracking(poses, pose)
        filled.header = filled.robot_pose.header = header
        set_pose(filled.robot_pose.pose, pose)
        filled.current_path_index = found.segment
        filled.position_tracking_error = found.offset
        filled.heading_tracking_error = found.heading
        filled.remaining_path_length = found.remaining
    x, y, _ = poses[-1].tolist()
    filled.distance_to_goal, filled.speed = hypot(x - pose.x, y - pose.y), speed
