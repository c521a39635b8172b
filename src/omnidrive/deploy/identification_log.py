"""The log of a drive for the identification of its robot."""

from __future__ import annotations

import numpy as np

from omnidrive.control import CommandValue, WheelSpeeds
from omnidrive.deploy.log.logged_drive import LoggedDrive
from omnidrive.deploy.log.logged_sample import LoggedSample
from omnidrive.errors import InvalidLog
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot
from omnidrive.simulation.identification import RobotLog

_MOST_SAMPLES = 1_000_000


def identification_log(logged: LoggedDrive) -> RobotLog:
    """Return commands, measured poses and wheel speeds of the longest stretch without gaps.

    The pose of a sample is its newest pose fix; the wheel speeds are central differences of the
    wheel angles. A stretch ends where a sample has no new pose fix.

    Raises:
        InvalidLog: It has no stretch with pose fixes, commands torques, is too long or damaged.
    """
    if logged.sample_count > _MOST_SAMPLES:
        raise InvalidLog(f"the log has more than {_MOST_SAMPLES:,} samples")
    best: list[LoggedSample] = []
    stretch: list[LoggedSample] = []
    for sample in logged.samples():
        if stretch and sample.number > stretch[-1].number + 1:
            stretch = []
        if sample.read is None or not sample.read.fixes or sample.sent is None:
            stretch = []
            continue
        stretch.append(sample)
        best = max(best, stretch, key=len)
    if len(best) < 3:
        raise InvalidLog(
            "the log has no samples with commands and measured poses one after another: drive at "
            "the rate of the pose fixes, or a lower one (--rate)"
        )
    return _robot_log(best, logged.robot, logged.dt)


def _robot_log(samples: list[LoggedSample], robot: Robot, dt: float) -> RobotLog:
    reads = [sample.read for sample in samples if sample.read is not None]
    t = dt * np.array([sample.number for sample in samples], dtype=float)
    poses = np.array([read.fixes[-1].pose for read in reads])
    commands = np.array([_twist(sample.sent, robot) for sample in samples])
    angles = [read.wheel_angles for read in reads]
    speeds = None
    if all(len(each) == len(robot.mounts) for each in angles):
        speeds = np.gradient(np.array(angles), t, axis=0)
    return RobotLog(t - t[0], commands, poses, speeds)


def _twist(value: CommandValue | None, robot: Robot) -> BodyTwist:
    """Return a command as the body twist that it asks for."""
    if isinstance(value, WheelSpeeds) and len(value) == len(robot.mounts):
        return robot.chassis.twist(value)
    if isinstance(value, BodyTwist):
        return value
    raise InvalidLog("the log commands wheel torques: identification needs twists or wheel speeds")
