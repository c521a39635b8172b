"""Which readings are possible, by the limits of the robot and of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.estimation.readings import PoseFix
from omnidrive.estimation.state import is_usable_number
from omnidrive.robot import Robot

MAX_RECEIVED = 200
"""Largest number of fixes of one update that are looked at."""
_MAX_SIGMA = 1e6
"""Largest standard deviation of a measured position, m."""
_MAX_YAW_SIGMA = 1e3
"""Standard deviation beyond which a yaw counts as not measured, rad."""
_MARGIN = 2.0
"""Rates up to this multiple of what the motors can do are possible: a robot can be pushed, and
wheels can overshoot."""


class RateLimits(NamedTuple):
    """Largest possible rates of a robot."""

    wheel_speed: float
    """Speed of a wheel, rad/s."""
    twist: Float[Array, " 3"]
    """Magnitude of each component of the body twist; m/s, m/s, rad/s."""

    @classmethod
    def of(cls, robot: Robot) -> RateLimits:
        """Return twice the rates of a robot whose wheels turn at their limit.

        With the wheel matrix J, the twist of the wheel speeds w is J^+ w, so that the component k
        is at most ``sum_i |J^+_ki| w_max``.
        """
        fastest = _MARGIN * robot.max_wheel_speed
        return cls(fastest, fastest * np.abs(np.linalg.pinv(robot.chassis.jacobian)).sum(axis=1))


def usable_fixes(fixes: Sequence[PoseFix], now: float) -> list[PoseFix]:
    """Return the usable ones of the last :data:`MAX_RECEIVED` fixes, see :func:`usable_fix`."""
    return [fix for each in fixes[-MAX_RECEIVED:] if (fix := usable_fix(each, now)) is not None]


def usable_fix(fix: PoseFix, now: float) -> PoseFix | None:
    """Return a pose fix, with an infinite yaw sigma if it measures no yaw; None: it is not usable.

    The stamp must be finite and not after ``now``; position and measured yaw must be usable numbers
    (:func:`~omnidrive.estimation.state.is_usable_number`). No standard deviation must be negative,
    nor that of the position infinite; NaN is an unknown one.

    Args:
        fix: The fix.
        now: Time of the readings with which it arrived, s.
    """
    stamp, (x, y, yaw), position_sigma, yaw_sigma = fix
    if not (-inf < stamp <= now and is_usable_number(x) and is_usable_number(y)):
        return None
    if position_sigma < 0.0 or position_sigma > _MAX_SIGMA or yaw_sigma < 0.0:
        return None
    if yaw_sigma > _MAX_YAW_SIGMA:
        return fix._replace(yaw_sigma=inf)
    return fix if is_usable_number(yaw) else None


def possible_angles(angles: Sequence[float], wheels: int) -> list[float]:
    """Return wheel angles, rad; NaN for those that are absent or not usable.

    Args:
        angles: One angle per wheel, or none.
        wheels: Number of wheels.

    Raises:
        InvalidInput: There is another number of angles.
    """
    if len(angles) not in {0, wheels}:
        raise InvalidInput(
            f"the readings hold {len(angles)} wheel angles, the robot has {wheels} wheels"
        )
    possible = [float(angle) if is_usable_number(angle) else nan for angle in angles]
    return possible or [nan] * wheels
