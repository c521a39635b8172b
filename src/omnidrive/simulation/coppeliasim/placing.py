"""Poses of a scene's objects, and planar motions of them."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, sin

from omnidrive.geometry import Pose

ObjectPose = Sequence[float]
"""x, y, z in m and a unit quaternion qx, qy, qz, qw, as CoppeliaSim writes it."""


def planar(pose: ObjectPose) -> Pose:
    """Seen from above: where an object stands, and the bearing of its x axis in (-pi, pi]."""
    x, y, _, qx, qy, qz, qw = pose
    return Pose(x, y, atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz)))


def uprightness(pose: ObjectPose) -> float:
    """Cosine of the angle between the object's z axis and the vertical."""
    _, _, _, qx, qy, _, _ = pose
    return 1.0 - 2.0 * (qx * qx + qy * qy)


def then(frame: Pose, offset: Pose) -> Pose:
    """``offset``, given in ``frame``, in the frame in which ``frame`` is given."""
    c, s = cos(frame.yaw), sin(frame.yaw)
    return Pose(
        frame.x + c * offset.x - s * offset.y,
        frame.y + s * offset.x + c * offset.y,
        frame.yaw + offset.yaw,
    )


def seen_from(frame: Pose, pose: Pose) -> Pose:
    """``pose`` in ``frame``: what :func:`then` leads back."""
    c, s = cos(frame.yaw), sin(frame.yaw)
    dx, dy = pose.x - frame.x, pose.y - frame.y
    return Pose(c * dx + s * dy, c * dy - s * dx, pose.yaw - frame.yaw)


def moved(pose: ObjectPose, here: Pose, there: Pose) -> list[float]:
    """An object carried over the floor as what is ``here`` would be to stand ``there``."""
    x, y, z, qx, qy, qz, qw = pose
    at = then(there, seen_from(here, Pose(x, y, 0.0)))
    half = 0.5 * (there.yaw - here.yaw)
    c, s = cos(half), sin(half)
    return [at.x, at.y, z, c * qx - s * qy, c * qy + s * qx, c * qz + s * qw, c * qw - s * qz]
