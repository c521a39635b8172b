"""Planar rigid-body motion: poses, twists and frames."""

from omnidrive.geometry.planar import (
    BodyTwist,
    Pose,
    WorldTwist,
    check_heading,
    compose,
    inverse,
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
    "check_heading",
    "compose",
    "inverse",
    "move",
    "to_body",
    "to_world",
    "twist_between",
    "wrap",
]
