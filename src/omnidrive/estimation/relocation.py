"""Finding the robot again after it was carried elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnidrive.estimation import PoseFix
from omnidrive.geometry import Pose, move, twist_between, wrap

JUMP = np.diag([100.0, 100.0, 10.0])
"""Covariance of a jump of the pose of which nothing is known, in m^2, m^2, rad^2."""

_SIGMAS = 4.0
_SLACK = 0.05
"""In m and rad: how much odometry may drift while fixes are compared."""


def agree(fixes: Sequence[tuple[PoseFix, Pose]], here: Pose) -> bool:
    """Whether fixes tell of one and the same jump.

    Odometry leads on from every fix to a pose now; these poses must be near each other.

    Args:
        fixes: Each with the pose that was believed when it was taken.
        here: The pose believed now, by the same odometry.
    """
    now = [move(fix.pose, twist_between(believed, here, 1.0), 1.0) for fix, believed in fixes]
    middle = now[len(now) // 2]
    for (fix, _), pose in zip(fixes, now, strict=True):
        far = np.hypot(pose.x - middle.x, pose.y - middle.y)
        if far > _SIGMAS * fix.position_sigma * 2.0**0.5 + _SLACK:
            return False
        if abs(wrap(pose.yaw - middle.yaw)) > _SIGMAS * fix.yaw_sigma * 2.0**0.5 + _SLACK:
            return False
    return True
