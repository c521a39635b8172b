"""Planar rigid motion: poses, twists and the frames they live in."""

from omnidrive.geometry.planar import (
    BodyTwist,
    Pose,
    WorldTwist,
    move,
    to_body,
    to_world,
    twist_between,
    wrap,
)

__all__ = [
    "BodyTwist",
    "Pose",
    "WorldTwist",
    "move",
    "to_body",
    "to_world",
    "twist_between",
    "wrap",
]
