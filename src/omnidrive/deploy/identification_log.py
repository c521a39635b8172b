"""The log of a drive for the identification of its robot."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

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

_MAX_SAMPLES = 1_000_000
_MAX_GAP = 0.4  # s, without readings: the watchdog of a robot may stop it
_MAX_SAMPLES_GAP = 2.5  # sample times without readings, if that is longer
_LATEST = 1e10  # s, of a stamp
_RESOLUTION = 1e-6  # s, of the times of the rows


class _Stretch(NamedTuple):
    """Samples one after another with what was measured from the first to the last."""

    samples: list[LoggedSample]
    t: Float[Array, " rows"]
    """Time of the readings of each sample, s."""
    angles: Float[Array, "readings columns"]
    """Stamp, s, and angle of each wheel, rad; no rows: not measured. Stamps increase."""
    fixes: Float[Array, "fixes 4"]
    """Stamp, x, y and yaw; s, m, m, rad. Stamps increase."""


def identification_log(logged: LoggedDrive) -> RobotLog:
    """Return commands, pose fixes and wheel speeds of the stretch with the most pose fixes.

    Rows of the log are the samples, the stamps of wheel angles, and those of pose fixes; at the
    stamps there are mean wheel speeds since the angles before, and poses. In a stretch no sample is
    missing, and there are readings every 0.4 s or 2.5 sample times. The time of a sample is that of
    its readings, in the median of the stretch.

    Raises:
        InvalidLog: It has no stretch with pose fixes, commands torques, is too long or damaged.
    """
    if logged.sample_count > _MAX_SAMPLES:
        raise InvalidLog(f"the log has more than {_MAX_SAMPLES:,} samples")
    best: _Stretch | None = None
    for run in _runs(logged.samples()):
        for stretch in _stretches(run, logged.robot, logged.dt):
            if best is None or len(stretch.fixes) > len(best.fixes):
                best = stretch
    if best is None or len(best.fixes) < 2:
        raise InvalidLog(
            "the log has fewer than two pose fixes in succession: the identification needs "
            "poses measured from outside, such as by motion capture; give commands, wheel "
            "speeds and these as a table (.csv)"
        )
    return _robot_log(best, logged.robot)


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


def _stretches(run: list[LoggedSample], robot: Robot, dt: float) -> Iterator[_Stretch]:
    """Yield the parts of a run in which readings succeed each other."""
    read = [k for k, sample in enumerate(run) if _is_dated(sample.read)]
    reads = [each for k in read if (each := run[k].read) is not None]
    if not reads:
        return
    numbers = np.array([sample.number for sample in run], dtype=float)
    stamps = np.array([each.stamp for each in reads])
    times = dt * numbers + np.median(stamps - dt * numbers[read])
    angles, fixes = _angles(reads, len(robot.mounts)), _fixes(reads)
    measured = np.unique(np.concatenate([angles[:, 0], fixes[:, 0]]))
    gaps = np.flatnonzero(np.diff(measured) > max(_MAX_GAP, _MAX_SAMPLES_GAP * dt))
    for part in np.split(measured, gaps + 1):
        if not len(part):
            continue
        first, end = np.searchsorted(times, [part[0] - _RESOLUTION, part[-1] + _RESOLUTION])
        if end - first < 3:
            continue
        t = times[first:end]
        yield _Stretch(run[first:end], t, _between(angles, t), _between(fixes, t))


def _angles(reads: list[SensorReadings], wheels: int) -> Float[Array, "readings columns"]:
    """Return stamps, s, and wheel angles, rad, of the readings that have them."""
    rows = [(each.stamp, *each.wheel_angles) for each in reads if len(each.wheel_angles) == wheels]
    return np.array(rows, dtype=float).reshape(-1, 1 + wheels)


def _fixes(reads: list[SensorReadings]) -> Float[Array, "fixes 4"]:
    """Return stamp, x, y and yaw of the usable pose fixes with a yaw; s, m, m, rad."""
    fixes = [fix for each in reads for fix in each.fixes]
    usable = [each for fix in fixes if (each := usable_fix(fix, _LATEST)) is not None]
    rows = [(fix.stamp, *fix.pose) for fix in usable if fix.yaw_sigma < inf]
    return np.array(rows, dtype=float).reshape(-1, 4)


def _between(
    rows: Float[Array, "rows columns"], t: Float[Array, " samples"]
) -> Float[Array, "kept columns"]:
    """Return rows with stamps from the first sample to the last, by stamp, one of each."""
    inside = rows[(rows[:, 0] >= t[0] - _RESOLUTION) & (rows[:, 0] <= t[-1] + _RESOLUTION)]
    _, first = np.unique(_steps(inside[:, 0], t), return_index=True)
    kept: Float[Array, "kept columns"] = inside[first]
    return kept


def _steps(stamps: Float[Array, " n"], t: Float[Array, " samples"]) -> Float[Array, " n"]:
    """Return the times since the first sample in whole steps of the resolution."""
    whole: Float[Array, " n"] = np.round((stamps - t[0]) / _RESOLUTION)
    return whole


def _is_dated(read: SensorReadings | None) -> bool:
    return read is not None and abs(read.stamp) <= _LATEST


def _robot_log(stretch: _Stretch, robot: Robot) -> RobotLog:
    sampled, read, fixed = (
        _steps(stamps, stretch.t)
        for stamps in (stretch.t, stretch.angles[:, 0], stretch.fixes[:, 0])
    )
    rows = np.unique(np.concatenate([sampled, read, fixed]))
    sent = np.array([_twist(sample.sent, robot) for sample in stretch.samples])
    commands = sent[np.maximum(np.searchsorted(sampled, rows, side="right") - 1, 0)]
    poses = np.full((len(rows), 3), nan)
    poses[np.searchsorted(rows, fixed)] = stretch.fixes[:, 1:]
    speeds = None
    if len(read) > 1:
        speeds = np.full((len(rows), len(robot.mounts)), nan)
        at = np.searchsorted(rows, read)
        turned = np.diff(stretch.angles[:, 1:], axis=0)
        speeds[at[1:]] = turned / (_RESOLUTION * np.diff(read)[:, None])
        speeds[at[0]] = speeds[at[1]]  # the first mean begins there
    return RobotLog(_RESOLUTION * (rows - rows[0]), commands, poses, speeds, mean_wheel_speeds=True)


def _twist(value: CommandValue | None, robot: Robot) -> BodyTwist:
    """Return a command as the body twist that it asks for."""
    if isinstance(value, WheelSpeeds) and len(value) == len(robot.mounts):
        return robot.chassis.twist(value)
    if isinstance(value, BodyTwist):
        return value
    raise InvalidLog("the log commands wheel torques: identification needs twists or wheel speeds")
