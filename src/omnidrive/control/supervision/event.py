"""What a robot knows of itself, and what happened to it."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.geometry import Pose


class Event(NamedTuple):
    """Something that happened in a run."""

    t: float
    """In s."""
    what: str


class Seen(NamedTuple):
    """What a robot knows of itself."""

    pose: Pose
    """Where it believes to be, in W."""
    position_sigma: float
    """In m; NaN: unknown."""
    age: float
    """Of the last measurement of the pose, in s."""
    wheel_angles: tuple[float, ...] = ()
    """By the encoders, in rad; empty: not known."""
    wheel_torques: tuple[float, ...] = ()
    """By the motors' currents, mean of the last sample in N m; empty: not known."""
