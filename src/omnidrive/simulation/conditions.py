"""What acts on a robot besides its commands."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from omnidrive.geometry import WorldTwist


class Motor(IntEnum):
    """State of a wheel's motor."""

    HEALTHY = 0
    WEAK = 1
    """Gives half its torque."""
    DEAD = 2
    """Gives none; the wheel turns freely."""
    LOCKED = 3
    """The wheel does not turn."""


WEAK = 0.5
"""Part of its torque that a weak motor gives at most."""


class Patch(NamedTuple):
    """A disc of floor with a friction of its own."""

    x: float
    """Centre in W, in m."""
    y: float
    """Centre in W, in m."""
    radius: float
    """In m."""
    friction: float
    """Coulomb coefficient between roller and floor."""


class Payload(NamedTuple):
    """A point mass fixed to the robot's body."""

    mass: float
    """In kg."""
    x: float
    """In B, in m."""
    y: float
    """In B, in m."""


class Conditions(NamedTuple):
    """What acts on a robot besides its commands; by default nothing."""

    motors: tuple[Motor, ...] = ()
    """Of each wheel; empty: all are healthy."""
    slope: tuple[float, float] = (0.0, 0.0)
    """Rise of the floor per metre along x and along y of W."""
    payload: Payload | None = None
    patch: Patch | None = None
    impulse: WorldTwist = WorldTwist(0.0, 0.0, 0.0)
    """Given to the body once, when imposed: N s, N s and, about B's origin, N m s."""
    jump: WorldTwist = WorldTwist(0.0, 0.0, 0.0)
    """By which the robot is carried elsewhere at once, when imposed: m, m, rad."""


class SensorConditions(NamedTuple):
    """What is wrong with a robot's sensors; by default nothing."""

    dead_encoders: tuple[int, ...] = ()
    """Wheels, counted from 0, whose encoders tell nothing, or stand still in what they tell."""
    fixes_silent: bool = False
    """Whether the pose is not measured; fixes on their way still arrive."""
    gyro_silent: bool = False
    """Whether no measurement of the yaw rate arrives."""
