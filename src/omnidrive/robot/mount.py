"""Positions and drive directions of wheels."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin
from typing import NamedTuple


class Mount(NamedTuple):
    """Position and orientation of one wheel, seen from above, in B."""

    x: float
    """x of the wheel's centre, in m."""
    y: float
    """y of the wheel's centre, in m."""
    axle_angle: float
    """Bearing of the axle, in rad. A wheel that turns in the positive sense rolls along
    (-sin axle_angle, cos axle_angle)."""
    roller_angle: float = 0.0
    """Angle from the rolling direction to the axis of the roller that touches the floor, in rad,
    positive towards the axle: 0 for omni wheels, pi / 4 or -pi / 4 for mecanum wheels."""

    @property
    def is_mecanum(self) -> bool:
        """Whether the rollers are inclined, by more than 0.01 rad."""
        return abs(self.roller_angle) > 0.01

    @property
    def drive_direction(self) -> tuple[float, float]:
        """Unit vector along which the wheel exerts force: the axis of the roller on the floor."""
        bearing = self.axle_angle + 0.5 * pi - self.roller_angle
        return cos(bearing), sin(bearing)


def omni_ring(angles: Sequence[float], ring_radius: float) -> tuple[Mount, ...]:
    """Return the mounts of omni wheels with radial axles on a circle.

    Args:
        angles: Bearing of each wheel in B, in rad.
        ring_radius: Distance from the centre to each wheel's plane, in m.
    """
    return tuple(Mount(ring_radius * cos(a), ring_radius * sin(a), a) for a in angles)


def mecanum_rectangle(half_length: float, half_width: float) -> tuple[Mount, ...]:
    """Return the mounts of four mecanum wheels that all roll forward at positive speed.

    The order is front left, front right, rear left, rear right, with
    ``r w = vx -+ vy -+ (half_length + half_width) yaw_rate`` and the signs - -, + +, + -, - +
    (Taheri, Qiao & Ghaeminezhad, "Kinematic model of a four mecanum wheeled mobile robot", 2015).
    Seen from above, the axes of the topmost rollers form an X, those of the rollers on the floor a
    diamond.

    Args:
        half_length: Distance from the centre to the front axles, in m.
        half_width: Distance from the centre to the middle of the left wheels, in m.
    """
    ahead, left, quarter = half_length, half_width, 0.25 * pi
    return (
        Mount(ahead, left, -0.5 * pi, quarter),
        Mount(ahead, -left, -0.5 * pi, -quarter),
        Mount(-ahead, left, -0.5 * pi, -quarter),
        Mount(-ahead, -left, -0.5 * pi, quarter),
    )
