"""Commands within the speed limit of the wheels, for laws that predict the motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Chassis


class WheelLimit(NamedTuple):
    """Wheel matrix and speed limit of a robot, as parameters of a law."""

    jacobian: Float[Array, "wheels 3"]
    """Wheel speed per body twist; rad/m, rad/m, rad/rad."""
    speed: float
    """Largest wheel speed, rad/s."""

    @classmethod
    def of(cls, chassis: Chassis) -> WheelLimit:
        """Return the limit of a chassis."""
        jacobian = np.array(chassis.jacobian, dtype=float, order="C")
        return cls(jacobian, float(chassis.max_wheel_speed))


@compiled
def within_wheel_limit(limit: WheelLimit, twist: BodyTwist) -> BodyTwist:
    """Return the largest multiple of ``twist``, at most 1, within the limit of every wheel.

    Plants and supervisors scale commands in the same way (:meth:`.Chassis.saturate`), so that a law
    with memory predicts the motion by the command that is executed.
    """
    peak = 0.0
    for row in limit.jacobian:
        speed = row[0] * twist.vx + row[1] * twist.vy + row[2] * twist.yaw_rate
        peak = max(peak, abs(speed))
    if peak <= limit.speed:
        return twist
    share = limit.speed / peak
    return BodyTwist(share * twist.vx, share * twist.vy, share * twist.yaw_rate)
