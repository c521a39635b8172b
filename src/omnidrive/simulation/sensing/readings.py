"""What arrives from the sensors."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.geometry import Pose


class Fix(NamedTuple):
    """A measurement of the pose, with what its sensor says of its precision."""

    stamp: float
    """When it was taken, in s."""
    pose: Pose
    """Of B in W; m, m, rad, the yaw up to whole turns."""
    position_sigma: float
    """Standard deviation of x and of y, without a bias and without outliers, in m."""
    yaw_sigma: float
    """Standard deviation of the yaw likewise, in rad; infinite: only the position was measured."""


class Readings(NamedTuple):
    """What arrived from the sensors up to one instant."""

    t: float
    """In s."""
    wheel_angles: tuple[float, ...]
    """How far each wheel has turned, in rad; NaN: its encoder tells nothing."""
    yaw_rate: float | None = None
    """Mean since the readings before, in rad/s; None: the gyro tells nothing."""
    fixes: tuple[Fix, ...] = ()
    """Of the pose, as they arrive: perhaps none, late, or in another order than taken."""
