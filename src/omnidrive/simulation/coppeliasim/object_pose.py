"""Poses of objects in a scene, and planar transformations of them."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, sin

from omnidrive.geometry import Pose, compose

ObjectPose = Sequence[float]
"""x, y, z (m) and a unit quaternion qx, qy, qz, qw, in the order of CoppeliaSim."""


def planar_pose(pose: ObjectPose) -> Pose:
    """Return position and yaw, the bearing of the x axis in (-pi, pi], of an object."""
    x, y, _, qx, qy, qz, qw = pose
    return Pose(x, y, atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz)))


def uprightness(pose: ObjectPose) -> float:
    """Return the cosine of the angle between the object's z axis and the vertical."""
    _, _, _, qx, qy, _, _ = pose
    return 1.0 - 2.0 * (qx * qx + qy * qy)


def relative_pose(frame: Pose, pose: Pose) -> Pose:
    """Return ``pose`` relative to ``frame``; the inverse of :func:`compose`."""
    c, s = cos(frame.yaw), sin(frame.yaw)
    dx, dy = pose.x - frame.x, pose.y - frame.y
    return Pose(c * dx + s * dy, c * dy - s * dx, pose.yaw - frame.yaw)


def transport(pose: ObjectPose, start: Pose, goal: Pose) -> list[float]:
    """Return the pose of an object after the planar motion that moves ``start`` to ``goal``."""
    x, y, z, qx, qy, qz, qw = pose
    at = compose(goal, relative_pose(start, Pose(x, y, 0.0)))
    half = 0.5 * (goal.yaw - start.yaw)
    c, s = cos(half), sin(half)
    return [at.x, at.y, z, c * qx - s * qy, c * qy + s * qx, c * qz + s * qw, c * qw - s * qz]
