"""What a robot can do with the wheels that are left."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidGeometry
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Chassis, Robot, acceleration_polytope


@dataclass(frozen=True, eq=False, slots=True)
class Remaining:
    """A robot that stands on all its wheels and drives with some.

    Attributes:
        wheels: Those that drive, counted from 0.
        chassis: Their rows of the wheel matrix: the allocation of a twist to them.
        rim_jacobian: Speed of their rims per unit of body twist, in 1, 1 and m/rad.
        force_limits: What each can push, in N; a dead wheel goes on carrying its load.
        acceleration_faces: ``|acceleration_faces @ (ax, ay, yaw acceleration)| <= 1`` in B;
            s^2/m, s^2/m, s^2/rad.
    """

    wheels: tuple[int, ...]
    chassis: Chassis
    rim_jacobian: Float[Array, "wheels 3"]
    force_limits: Float[Array, " wheels"]
    acceleration_faces: Float[Array, "faces 3"]

    @classmethod
    def of(cls, robot: Robot, lost: Collection[int]) -> Remaining:
        """Of a robot without some of its wheels.

        Raises:
            InvalidGeometry: The others do not drive it every way.
        """
        kept = [i for i in range(len(robot.mounts)) if i not in lost]
        if len(kept) < 3:
            raise InvalidGeometry(len(kept))
        chassis = Chassis(robot.drive.jacobian[kept], robot.max_wheel_speed)
        rim_jacobian, force_limits = robot.rim_jacobian[kept], robot.force_limits[kept]
        acceleration_faces = acceleration_polytope(rim_jacobian, force_limits, robot.inertia)
        return cls(tuple(kept), chassis, rim_jacobian, force_limits, acceleration_faces)


def eased(
    acceleration_faces: Float[Array, "faces 3"], before: BodyTwist, wanted: BodyTwist, dt: float
) -> BodyTwist:
    """The twist nearest to the one wanted, on the way there from the one before, that wheels push.

    Args:
        acceleration_faces: ``|acceleration_faces @ acceleration| <= 1``; s^2/m, s^2/m, s^2/rad.
        before: What is asked of the robot until now.
        wanted: What shall be asked next.
        dt: For how long, in s.
    """
    change = np.subtract(wanted, before)
    used = float(np.abs(acceleration_faces @ change).max()) / dt
    if used <= 1.0:
        return wanted
    return BodyTwist(*(np.asarray(before) + change / used).tolist())
