"""Disturbances that act on a plant, and faults of its sensors."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Motor(IntEnum):
    """Condition of a wheel's motor."""

    HEALTHY = 0
    WEAK = 1
    """The torque limit is halved."""
    DEAD = 2
    """No torque; the wheel turns freely."""
    LOCKED = 3
    """The wheel does not turn."""


WEAK_TORQUE_FACTOR = 0.5
"""Torque limit of a weak motor as a share of its full limit."""


class Patch(NamedTuple):
    """A disc of floor with its own friction."""

    x: float
    """Centre in W, m."""
    y: float
    """Centre in W, m."""
    radius: float
    """Radius, m."""
    friction: float
    """Coulomb coefficient between roller and floor."""


class Payload(NamedTuple):
    """A point mass fixed to the robot's body."""

    mass: float
    """Mass, kg."""
    x: float
    """Position in B, m."""
    y: float
    """Position in B, m."""


class Impulse(NamedTuple):
    """An impulse on the body, in W, about the origin of B."""

    x: float = 0.0
    """N s."""
    y: float = 0.0
    """N s."""
    yaw: float = 0.0
    """Angular impulse, N m s."""


class PoseOffset(NamedTuple):
    """A sudden change of the pose, in W."""

    x: float = 0.0
    """m."""
    y: float = 0.0
    """m."""
    yaw: float = 0.0
    """rad."""


class Disturbances(NamedTuple):
    """Everything that acts on a plant besides its command; by default nothing."""

    motors: tuple[Motor, ...] = ()
    """Condition of each wheel's motor; empty if all are healthy."""
    slope: tuple[float, float] = (0.0, 0.0)
    """Rise of the floor per metre along x and along y of W."""
    payload: Payload | None = None
    """None: no payload."""
    patch: Patch | None = None
    """None: the whole floor has the robot's friction."""
    impulse: Impulse = Impulse()
    """Acts once, when it is applied."""
    offset: PoseOffset = PoseOffset()
    """Added to the pose once, when it is applied."""


class SensorFaults(NamedTuple):
    """Faults of a robot's sensors; by default none."""

    dead_encoders: tuple[int, ...] = ()
    """Wheels, from 0, whose encoders report nothing."""
    fixes_silent: bool = False
    """Whether no new pose fix is taken; fixes in transit still arrive."""
    gyro_silent: bool = False
    """Whether the gyro reports nothing."""
