"""Wheel geometry of an omnidirectional robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, isfinite, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidGeometry, InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.robot.mount import Mount


@dataclass(frozen=True, eq=False, slots=True)
class Chassis:
    """Linear map between body twist and wheel speed, ``wheels = J @ twist``.

    Attributes:
        jacobian: J, wheel angular speed per unit body twist, in rad/m and rad/rad.
        max_wheel_speed: Speed no wheel exceeds, in rad/s; infinite for no limit.

    Raises:
        InvalidGeometry: The wheels cannot produce every twist.
        InvalidInput: A number of the matrix is not finite, or the speed is not positive.
    """

    jacobian: Float[Array, "wheels 3"]
    max_wheel_speed: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.jacobian).all():
            raise InvalidInput("the wheel matrix holds numbers that are not finite")
        if not self.max_wheel_speed > 0.0:
            raise InvalidInput(
                f"the wheels' greatest speed must be positive, got {self.max_wheel_speed:g} rad/s"
            )
        rank = int(np.linalg.matrix_rank(self.jacobian))
        if rank != 3:
            raise InvalidGeometry(rank)

    @classmethod
    def of_mounts(
        cls, mounts: Sequence[Mount], *, wheel_radius: float, max_wheel_speed: float
    ) -> Chassis:
        """Wheels with passive rollers, each where and how its mount says.

        Without slip, a wheel of radius r, rolling along t, whose rollers touch the floor along p
        moves its mount by ``p . v = r w (p . t)``, as rollers turn freely across their axes:
        ``r w_i = (p_x vx + p_y vy + (x p_y - y p_x) yaw_rate) / cos(roller_i)``
        (Campion, Bastin & d'Andrea-Novel 1996, eq. 8; for omni wheels the paper's eq. 1).

        Args:
            mounts: Of each wheel.
            wheel_radius: r, in m.
            max_wheel_speed: Speed no wheel exceeds, in rad/s.
        """
        _check_radius(wheel_radius)
        rows = []
        for mount in mounts:
            px, py = mount.push
            turn = mount.x * py - mount.y * px
            rows.append(np.array([px, py, turn]) / (wheel_radius * cos(mount.roller)))
        return cls(np.array(rows).reshape(-1, 3), max_wheel_speed)

    @classmethod
    def omni(
        cls, *, angles: Sequence[float], arm: float, wheel_radius: float, max_wheel_speed: float
    ) -> Chassis:
        """Omni wheels with radial axles, ``arm`` metres from the centre.

        Wheel i stands at (arm cos a_i, arm sin a_i) in B and pushes along (-sin a_i, cos a_i):
        ``r w_i = -sin(a_i) vx + cos(a_i) vy + arm yaw_rate`` (the paper, eq. 1).

        Args:
            angles: a_i, bearing of each wheel in B, in rad.
            arm: Distance from the centre to each wheel's plane, in m.
            wheel_radius: r, in m.
            max_wheel_speed: Speed no wheel exceeds, in rad/s.
        """
        _check_radius(wheel_radius)
        rows = [[-sin(a), cos(a), arm] for a in angles]
        return cls(np.array(rows) / wheel_radius, max_wheel_speed)

    def wheel_speeds(self, twist: BodyTwist) -> Float[Array, " wheels"]:
        """Wheel speeds, in rad/s, that produce ``twist`` without slip."""
        speeds: Float[Array, " wheels"] = self.jacobian @ np.asarray(twist)
        return speeds

    def twist(self, wheel_speeds: Sequence[float] | Float[Array, " wheels"]) -> BodyTwist:
        """Least-squares body twist of measured wheel speeds in rad/s."""
        x, *_ = np.linalg.lstsq(self.jacobian, np.asarray(wheel_speeds), rcond=None)
        return BodyTwist(*x.tolist())

    def saturate(self, twist: BodyTwist) -> BodyTwist:
        """Largest multiple of ``twist``, at most 1, that every wheel can follow.

        All wheels are scaled together, so the direction of motion and the ratio of turning to
        travelling are kept.
        """
        peak = float(np.abs(self.wheel_speeds(twist)).max())
        if peak <= self.max_wheel_speed:
            return twist
        k = self.max_wheel_speed / peak
        return BodyTwist(k * twist.vx, k * twist.vy, k * twist.yaw_rate)


def _check_radius(radius: float) -> None:
    if not (isfinite(radius) and radius > 0.0):
        raise InvalidInput(f"the wheels' radius must be positive, got {radius:g} m")
