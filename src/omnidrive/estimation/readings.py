"""Sensor readings: everything a robot can measure, simulated or real."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.geometry import Pose


class PoseFix(NamedTuple):
    """A measurement of the pose with its stated precision.

    Sources are, for example, cameras above the floor, beacons or scan matching.
    """

    stamp: float
    """Time of the measurement, s; it may be earlier than the time at which the fix arrives."""
    pose: Pose
    """Pose of B in W; m, m, rad. The yaw may differ from the true one by whole turns."""
    position_sigma: float
    """Standard deviation of x and of y, m, without bias and outliers; NaN if unknown."""
    yaw_sigma: float
    """Standard deviation of the yaw, rad; infinite if only the position is measured, NaN if
    unknown."""


class SensorReadings(NamedTuple):
    """All readings that arrived up to one instant; None or empty where a sensor is absent."""

    stamp: float
    """Time of the readings, s."""
    wheel_angles: tuple[float, ...] = ()
    """Angle of each wheel since the reset by its encoder, rad, with the signs of the wheel matrix;
    NaN for an encoder that reports nothing; empty without encoders."""
    wheel_torques: tuple[float, ...] = ()
    """Mean torque of each motor since the previous readings, at the wheel, from its current, N m;
    empty if currents are not measured."""
    yaw_rate: float | None = None
    """Mean yaw rate since the previous readings by a gyro, rad/s; None if it reports nothing."""
    fixes: tuple[PoseFix, ...] = ()
    """Pose fixes in the order of their arrival: none, one or several, perhaps late."""
