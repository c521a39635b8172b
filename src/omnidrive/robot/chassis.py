"""Wheel kinematics of an omnidirectional robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidGeometry, InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.robot.checks import check_no_faults, not_positive
from omnidrive.robot.mount import Mount


@dataclass(frozen=True, eq=False, slots=True)
class Chassis:
    """Linear map from body twist to wheel speeds, ``wheels = J @ twist``.

    Attributes:
        jacobian: J, wheel angular speed per unit of body twist, in rad/m, rad/m and rad/rad.
        max_wheel_speed: Largest speed of every wheel, in rad/s; infinite for no limit.

    Raises:
        InvalidGeometry: The wheels cannot produce every twist: J has a rank below 3.
        InvalidInput: J has an entry that is not finite, or the speed is not positive.
    """

    jacobian: Float[Array, "wheels 3"]
    max_wheel_speed: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.jacobian).all():
            raise InvalidInput("the wheel matrix has entries that are not finite")
        if not self.max_wheel_speed > 0.0:
            raise InvalidInput(
                f"max_wheel_speed must be positive, got {self.max_wheel_speed:g} rad/s"
            )
        rank = int(np.linalg.matrix_rank(self.jacobian))
        if rank != 3:
            raise InvalidGeometry(rank)

    @classmethod
    def of_mounts(
        cls, mounts: Sequence[Mount], *, wheel_radius: float, max_wheel_speed: float
    ) -> Chassis:
        """Return the chassis of wheels with passive rollers on the given mounts.

        A wheel of radius r rolls along t, and its roller on the floor has the axis p. Without slip
        its mount moves by ``p . v = r w (p . t)``, because rollers turn freely across their axes:
        ``r w_i = (p_x vx + p_y vy + (x p_y - y p_x) yaw_rate) / cos(roller_i)``
        (Campion, Bastin & d'Andrea-Novel 1996, eq. 8; for omni wheels the paper's eq. 1).

        Args:
            mounts: Mount of each wheel.
            wheel_radius: r, in m.
            max_wheel_speed: Largest speed of every wheel, in rad/s.

        Raises:
            InvalidGeometry: The wheels cannot produce every planar twist.
            InvalidInput: The radius or the speed is not positive.
        """
        check_no_faults(not_positive("wheel_radius", wheel_radius, "m"))
        rows = _rows(mounts, wheel_radius)
        try:
            return cls(rows, max_wheel_speed)
        except InvalidGeometry as error:
            fact = _cause(mounts, rows)
            if fact is None:
                raise
            raise InvalidGeometry(error.rank, fact) from None

    @classmethod
    def omni(
        cls,
        *,
        angles: Sequence[float],
        ring_radius: float,
        wheel_radius: float,
        max_wheel_speed: float,
    ) -> Chassis:
        """Return the chassis of omni wheels with radial axles on a circle of radius R.

        Wheel i is at (R cos a_i, R sin a_i) in B and drives along (-sin a_i, cos a_i):
        ``r w_i = -sin(a_i) vx + cos(a_i) vy + R yaw_rate`` (the paper, eq. 1).

        Args:
            angles: a_i, bearing of each wheel in B, in rad.
            ring_radius: R, distance from the centre to each wheel's plane, in m.
            wheel_radius: r, in m.
            max_wheel_speed: Largest speed of every wheel, in rad/s.
        """
        check_no_faults(not_positive("wheel_radius", wheel_radius, "m"))
        rows = [[-sin(a), cos(a), ring_radius] for a in angles]
        return cls(np.array(rows) / wheel_radius, max_wheel_speed)

    def wheel_speeds(self, twist: BodyTwist) -> Float[Array, " wheels"]:
        """Return the wheel speeds, in rad/s, that produce ``twist`` without slip."""
        speeds: Float[Array, " wheels"] = self.jacobian @ np.asarray(twist)
        return speeds

    def twist(self, wheel_speeds: Sequence[float] | Float[Array, " wheels"]) -> BodyTwist:
        """Return the least-squares body twist for measured wheel speeds in rad/s."""
        x, *_ = np.linalg.lstsq(self.jacobian, np.asarray(wheel_speeds), rcond=None)
        return BodyTwist(*x.tolist())

    def saturate(self, twist: BodyTwist) -> BodyTwist:
        """Return the largest multiple of ``twist``, at most 1, within the limit of every wheel.

        All wheels are scaled together, which keeps the direction of motion and the ratio of
        rotation to translation.
        """
        peak = float(np.abs(self.wheel_speeds(twist)).max())
        if peak <= self.max_wheel_speed:
            return twist
        k = self.max_wheel_speed / peak
        return BodyTwist(k * twist.vx, k * twist.vy, k * twist.yaw_rate)

    def limited_speeds(
        self, command: BodyTwist | Sequence[float]
    ) -> tuple[Float[Array, " wheels"], bool]:
        """Return the wheel speeds of a command within the limit of every wheel.

        All wheels are scaled together, as in :meth:`saturate`.

        Args:
            command: Body twist, or wheel speeds in rad/s.

        Returns:
            Wheel speeds, rad/s, and whether they were scaled down.
        """
        if isinstance(command, BodyTwist):
            twist = self.saturate(command)
            return self.wheel_speeds(twist), twist is not command
        speeds: Float[Array, " wheels"] = np.asarray(command, dtype=float)
        peak = float(np.abs(speeds).max())
        k = min(1.0, self.max_wheel_speed / max(peak, 1e-300))
        return speeds * k, peak > self.max_wheel_speed

    def limited_speeds_of(self, twists: Float[Array, "*many 3"]) -> Float[Array, "*many wheels"]:
        """Return the wheel speeds of many twists, as :meth:`limited_speeds`; rounded differently.

        Args:
            twists: Body twists; m/s, m/s, rad/s.
        """
        speeds: Float[Array, "*many wheels"] = twists @ self.jacobian.T
        peak = np.abs(speeds).max(axis=-1, keepdims=True)
        speeds *= np.minimum(1.0, self.max_wheel_speed / np.maximum(peak, 1e-300))
        return speeds


def _rows(mounts: Sequence[Mount], wheel_radius: float) -> Float[Array, "wheels 3"]:
    """Return the wheel matrix of wheels on mounts; see :meth:`Chassis.of_mounts`."""
    rows = []
    for mount in mounts:
        px, py = mount.drive_direction
        lever = mount.x * py - mount.y * px
        rows.append(np.array([px, py, lever]) / (wheel_radius * cos(mount.roller_angle)))
    return np.array(rows).reshape(-1, 3)


def _cause(mounts: Sequence[Mount], rows: Float[Array, "wheels 3"]) -> str | None:
    """Return why the wheel matrix of three or more wheels is singular; None: no known cause."""
    if len(mounts) < 3:
        return None
    if np.linalg.matrix_rank(rows[:, :2]) == 1:
        return (
            "all wheels push in the same direction; mecanum wheels need roller_angle of about "
            "+-0.785 rad with alternating signs"
        )
    mirrored = [mount._replace(roller_angle=-mount.roller_angle) for mount in mounts]
    if np.linalg.matrix_rank(_rows(mirrored, 1.0)) == 3:
        return "the rollers look swapped; reverse the sign of every roller_angle"
    return None
