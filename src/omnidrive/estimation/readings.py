"""Sensor readings: everything a robot can measure, simulated or real."""

from __future__ import annotations

from math import inf, pi
from typing import NamedTuple

from omnidrive.geometry import Pose
from omnidrive.parameter import are_finite, are_numbers, is_number, or_none, record_fault


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


def unwrapped_pose(fix: PoseFix, yaw: float) -> Pose:
    """Return the pose of a fix with whole turns added to its yaw, so that it is near ``yaw`` (rad).

    The yaw is ``yaw`` itself if the fix measures none.
    """
    if fix.yaw_sigma == inf:
        return fix.pose._replace(yaw=yaw)
    turns = round((yaw - fix.pose.yaw) / (2.0 * pi))
    return fix.pose._replace(yaw=fix.pose.yaw + 2.0 * pi * turns)


def readings_fault(readings: object) -> str | None:
    """Return what is wrong with the result of sensors, in one line; None: nothing.

    Numbers of measurements that are not finite are no fault: estimators treat them as lost.
    """
    return record_fault(readings, SensorReadings, _READINGS_RULES)


def _is_fix(fix: object) -> bool:
    return (
        isinstance(fix, PoseFix)
        and isinstance(fix.pose, Pose)
        and are_numbers((fix.stamp, *fix.pose, fix.position_sigma, fix.yaw_sigma))
    )


_READINGS_RULES = {
    "stamp": (lambda stamp: are_finite((stamp,)), "a finite number"),
    "wheel_angles": (are_numbers, "a tuple of numbers"),
    "wheel_torques": (are_numbers, "a tuple of numbers"),
    "yaw_rate": or_none((is_number, "a number")),
    "fixes": (
        lambda fixes: isinstance(fixes, tuple) and all(map(_is_fix, fixes)),
        "a tuple of PoseFix",
    ),
}
