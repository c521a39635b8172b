"""Detection of a robot that was moved without its wheels (kidnapped)."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np

from omnidrive.estimation.readings import PoseFix
from omnidrive.geometry import Pose, move, twist_between, wrap

JUMP_COVARIANCE = np.diag([100.0, 100.0, 10.0])
"""Covariance added to the pose for an unknown displacement; m^2, m^2, rad^2."""

_SIGMAS = 4.0
"""Largest distance between consistent fixes, in standard deviations of their difference."""
_DRIFT = 0.05
"""Odometry drift that is tolerated between fixes, m and rad."""


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
