"""Detection of a robot that was moved without its wheels (kidnapped)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import hypot, isfinite

import numpy as np

from omnidrive.estimation.readings import PoseFix
from omnidrive.geometry import Pose, move, twist_between, wrap

JUMP_COVARIANCE = np.diag([100.0, 100.0, 10.0])
"""Covariance added to the pose for an unknown displacement; m^2, m^2, rad^2."""

_SIGMAS = 4.0
"""Largest deviation between fixes of one robot, in standard deviations of their difference."""
_DRIFT = 0.05
"""Deviation that is tolerated in addition, for drift of the odometry, m and rad."""


def consistent(fixes: Sequence[tuple[PoseFix, Pose]], current: Pose) -> bool:
    """Return whether rejected fixes indicate one and the same displacement of the robot.

    Odometry propagates every fix to the current time; the resulting poses must be near each other,
    compared with the fixes' standard deviations.

    Args:
        fixes: Each fix with the pose that was estimated at its stamp, before its correction.
        current: Pose estimated at the current time, by the same odometry.
    """
    poses = [
        move(
            fix.pose if isfinite(fix.yaw_sigma) else fix.pose._replace(yaw=prior.yaw),
            twist_between(prior, current, 1.0),
            1.0,
        )
        for fix, prior in fixes
    ]
    middle = poses[len(poses) // 2]
    for (fix, _), pose in zip(fixes, poses, strict=True):
        distance = np.hypot(pose.x - middle.x, pose.y - middle.y)
        if distance > _SIGMAS * fix.position_sigma * 2.0**0.5 + _DRIFT:
            return False
        if abs(wrap(pose.yaw - middle.yaw)) > _SIGMAS * fix.yaw_sigma * 2.0**0.5 + _DRIFT:
            return False
    return True


def reachable(fixes: Sequence[PoseFix], max_speed: float) -> bool:
    """Return whether a robot can have been at the positions of all fixes at their stamps.

    Args:
        fixes: The fixes, in any order.
        max_speed: Largest possible speed of the robot, m/s.
    """
    for before, after in pairwise(sorted(fixes, key=lambda fix: fix.stamp)):
        distance = hypot(after.pose.x - before.pose.x, after.pose.y - before.pose.y)
        noise = _SIGMAS * hypot(before.position_sigma, after.position_sigma) + _DRIFT
        if distance > max_speed * (after.stamp - before.stamp) + noise:
            return False
    return True
