"""Where wheels stand, and which way they push."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin
from typing import NamedTuple


class Mount(NamedTuple):
    """Place and direction of one wheel, seen from above, in B."""

    x: float
    """Of the middle of the wheel, in m."""
    y: float
    """Of the middle of the wheel, in m."""
    axle: float
    """Bearing of the axle, in rad: turning positively, the wheel rolls along
    (-sin axle, cos axle)."""
    roller: float = 0.0
    """Angle from the direction of rolling to the axis of the roller that touches the floor, in rad,
    positive towards the axle: 0 for omni wheels, pi / 4 or -pi / 4 for mecanum wheels."""

    @property
    def push(self) -> tuple[float, float]:
        """Unit vector along which the wheel can push: the axis of the roller on the floor."""
        turned = self.axle + 0.5 * pi - self.roller
        return cos(turned), sin(turned)


def omni_ring(angles: Sequence[float], arm: float) -> tuple[Mount, ...]:
    """Omni wheels with radial axles.

    Args:
        angles: Bearing of each wheel in B, in rad.
        arm: Distance from the centre to each wheel's plane, in m.
    """
    return tuple(Mount(arm * cos(a), arm * sin(a), a) for a in angles)


def mecanum_rectangle(half_length: float, half_width: float) -> tuple[Mount, ...]:
    """Four mecanum wheels that all roll forward when they turn positively.

    In the order front left, front right, rear left, rear right:
    ``r w = vx -+ vy -+ (half_length + half_width) yaw_rate`` with the signs - -, + +, + -, - +
    (Taheri, Qiao & Ghaeminezhad, "Kinematic model of a four mecanum wheeled mobile robot", 2015).
    Seen from above the axes of the topmost rollers form an X, of those on the floor a diamond.

    Args:
        half_length: From the centre to the front axles, in m.
        half_width: From the centre to the middle of the left wheels, in m.
    """
    ahead, left, quarter = half_length, half_width, 0.25 * pi
    return (
        Mount(ahead, left, -0.5 * pi, quarter),
        Mount(ahead, -left, -0.5 * pi, -quarter),
        Mount(-ahead, left, -0.5 * pi, -quarter),
        Mount(-ahead, -left, -0.5 * pi, quarter),
    )
