"""The log of a drive for the identification of its robot."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.control import CommandValue, WheelSpeeds
from omnidrive.deploy.log.logged_drive import LoggedDrive
from omnidrive.deploy.log.logged_sample import LoggedSample
from omnidrive.errors import InvalidLog
from omnidrive.estimation import SensorReadings
from omnidrive.estimation.plausibility import usable_fix
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot
from omnidrive.simulation.identification import RobotLog

_MOST_SAMPLES = 1_000_000
_MAX_GAP = 2.5
"""Longest time between two measurements between which samples are interpolated, in sample times:
one sample in succession may be without."""
_LATEST = 1e10  # s, of a stamp
_INSTANT = 1e-6  # s


class _Stretch(NamedTuple):
    """Samples one after another with what was measured at their times."""

    samples: list[LoggedSample]
    poses: Float[Array, "rows 3"]
    angles: Float[Array, "rows wheels"] | None
    """Angle of each wheel, rad; None: not measured."""


def identification_log(logged: LoggedDrive) -> RobotLog:
    """Return commands, measured poses and wheel speeds of the longest stretch without gaps.

    Poses and wheel angles are linearly interpolated at the times of the samples between the stamps
    of measurements at most 2.5 sample times apart, so that single ones may be late or missing; the
    wheel speeds are central differences of the angles. The time of a sample is that of its
    readings, in the median of the stretch.

    Raises:
        InvalidLog: It has no stretch with pose fixes, commands torques, is too long or damaged.
    """
    if logged.sample_count > _MOST_SAMPLES:
        raise InvalidLog(f"the log has more than {_MOST_SAMPLES:,} samples")
    best: _Stretch | None = None
    intervals: list[float] = []
    for run in _runs(logged.samples()):
        fixes = _fixes(run)
        intervals += np.diff(np.unique(fixes[:, 0])).tolist()
        stretch = _longest_stretch(run, fixes, logged.robot, logged.dt)
        if best is None or len(stretch.samples) > len(best.samples):
            best = stretch
    if best is None or len(best.samples) < 3:
        if not intervals:
            raise InvalidLog(
                "the log has fewer than two pose fixes in succession: the identification needs "
                "poses measured from outside, such as by motion capture; give commands, wheel "
                "speeds and these as a table (.csv)"
            )
        fixes_rate, rate = 1.0 / float(np.median(intervals)), 1.0 / logged.dt
        raise InvalidLog(
            "the log has no samples with commands and measured poses one after another (there are "
            f"{fixes_rate:.3g} pose fixes and {rate:.3g} samples a second): drive at the rate of "
            "the pose fixes, or a lower one (--rate)"
        )
    return _robot_log(best, logged.robot, logged.dt)


def _runs(samples: Iterator[LoggedSample]) -> Iterator[list[LoggedSample]]:
    """Yield the samples with commands, in parts in which none is missing."""
    run: list[LoggedSample] = []
    for sample in samples:
        if run and (sample.sent is None or sample.number > run[-1].number + 1):
            yield run
            run = []
        if sample.sent is not None:
            run.append(sample)
    if run:
        yield run


def _fixes(run: list[LoggedSample]) -> Float[Array, "fixes 4"]:
    """Return stamp, x, y and yaw of the usable pose fixes with a yaw; s, m, m, rad."""
    fixes = [fix for sample in run if sample.read is not None for fix in sample.read.fixes]
    usable = [each for fix in fixes if (each := usable_fix(fix, _LATEST)) is not None]
    rows = [(fix.stamp, *fix.pose) for fix in usable if fix.yaw_sigma < inf]
    return np.array(rows).reshape(-1, 4)


def _longest_stretch(
    run: list[LoggedSample], fixes: Float[Array, "fixes 4"], robot: Robot, dt: float
) -> _Stretch:
    """Return the longest part of a run with measurements at the times of all samples."""
    numbers = np.array([sample.number for sample in run], dtype=float)
    read = [k for k, sample in enumerate(run) if _is_dated(sample.read)]
    if not read or not len(fixes):
        return _Stretch([], np.empty((0, 3)), None)
    reads = [each for k in read if (each := run[k].read) is not None]
    stamps = np.array([each.stamp for each in reads])
    times = dt * numbers + np.median(stamps - dt * numbers[read])
    fixes = fixes[np.argsort(fixes[:, 0], kind="stable")]
    fixes[:, 3] = np.unwrap(fixes[:, 3])
    poses, measured = _interpolated(times, fixes[:, 0], fixes[:, 1:], _MAX_GAP * dt)
    angles = None
    if all(len(each.wheel_angles) == len(robot.mounts) for each in reads):
        turned = np.array([each.wheel_angles for each in reads])
        angles, known = _interpolated(times, stamps, turned, _MAX_GAP * dt)
        measured &= known
    ends = np.flatnonzero(np.diff(measured, prepend=False, append=False)).reshape(-1, 2)
    if not len(ends):
        return _Stretch([], np.empty((0, 3)), None)
    first, end = ends[np.argmax(ends[:, 1] - ends[:, 0])].tolist()
    part = slice(first, end)
    return _Stretch(run[part], poses[part], None if angles is None else angles[part])


def _is_dated(read: SensorReadings | None) -> bool:
    return read is not None and abs(read.stamp) <= _LATEST


def _interpolated(
    times: Float[Array, " rows"],
    stamps: Float[Array, " n"],
    values: Float[Array, "n columns"],
    gap: float,
) -> tuple[Float[Array, "rows columns"], Bool[Array, " rows"]]:
    """Return values at ``times``, and at which of them stamps before and after are near enough."""
    stamps, chosen = np.unique(stamps, return_index=True)
    values = values[chosen]
    after = np.searchsorted(stamps, times - _INSTANT)
    before = np.searchsorted(stamps, times + _INSTANT, side="right") - 1
    last = len(stamps) - 1
    near = stamps[np.minimum(after, last)] - stamps[np.maximum(before, 0)] <= gap
    found = np.column_stack([np.interp(times, stamps, column) for column in values.T])
    return found, near & (after <= last) & (before >= 0)


def _robot_log(stretch: _Stretch, robot: Robot, dt: float) -> RobotLog:
    t = dt * np.array([sample.number for sample in stretch.samples], dtype=float)
    commands = np.array([_twist(sample.sent, robot) for sample in stretch.samples])
    speeds = None if stretch.angles is None else np.gradient(stretch.angles, t, axis=0)
    return RobotLog(t - t[0], commands, stretch.poses, speeds)


def _twist(value: CommandValue | None, robot: Robot) -> BodyTwist:
    """Return a command as the body twist that it asks for."""
    if isinstance(value, WheelSpeeds) and len(value) == len(robot.mounts):
        return robot.chassis.twist(value)
    if isinstance(value, BodyTwist):
        return value
    raise InvalidLog("the log commands wheel torques: identification needs twists or wheel speeds")
