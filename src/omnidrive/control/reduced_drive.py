"""The drive of a robot after the failure of some of its wheels."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidGeometry
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Chassis, Robot, acceleration_polytope


@dataclass(frozen=True, eq=False, slots=True)
class ReducedDrive:
    """Driving wheels of a robot; its failed wheels roll freely and carry their load.

    Attributes:
        wheels: Indices of the driving wheels, from 0.
        chassis: Their rows of the wheel matrix, which allocate a twist to them.
        rim_jacobian: Their rows of the rim Jacobian, rim speed per body twist; 1, 1, m/rad.
        force_limits: Largest drive force of each, N.
        acceleration_faces: Acceleration polytope ``|faces @ (ax, ay, yaw acceleration)| <= 1`` in
            B; s^2/m, s^2/m, s^2/rad.
        force_ratio: Smallest of ``force_limits`` over the whole robot's smallest, dimensionless.
    """

    wheels: tuple[int, ...]
    chassis: Chassis
    rim_jacobian: Float[Array, "wheels 3"]
    force_limits: Float[Array, " wheels"]
    acceleration_faces: Float[Array, "faces 3"]
    force_ratio: float

    @classmethod
    def of(cls, robot: Robot, failed: Collection[int]) -> ReducedDrive:
        """Return the drive of ``robot`` without the wheels ``failed`` (indices from 0).

        Raises:
            InvalidGeometry: The remaining wheels cannot produce every twist.
        """
        kept = [i for i in range(len(robot.mounts)) if i not in failed]
        if len(kept) < 3:
            raise InvalidGeometry(len(kept))
        chassis = Chassis(robot.drive.jacobian[kept], robot.max_wheel_speed)
        rim_jacobian, force_limits = robot.rim_jacobian[kept], robot.force_limits[kept]
        faces = acceleration_polytope(rim_jacobian, force_limits, robot.inertia)
        ratio = float(force_limits.min() / robot.max_force)
        return cls(tuple(kept), chassis, rim_jacobian, force_limits, faces, ratio)


def limit_acceleration(
    limits: Float[Array, "faces 3"], before: BodyTwist, desired: BodyTwist, dt: float
) -> BodyTwist:
    """Return the feasible twist closest to ``desired`` on the line from ``before`` to ``desired``.

    Args:
        limits: Acceleration polytope ``|limits @ acceleration| <= 1``; s^2/m, s^2/m, s^2/rad.
        before: Twist commanded in the previous sample.
        desired: Twist desired in this sample.
        dt: Sample time, s.
    """
    change = np.subtract(desired, before)
    used = float(np.abs(limits @ change).max()) / dt
    if used <= 1.0:
        return desired
    return BodyTwist(*(np.asarray(before) + change / used).tolist())


def reallocate(
    robot: Robot, drive: ReducedDrive, torques: Sequence[float], share: float
) -> Float[Array, " wheels"]:
    """Return torques of the driving wheels with the wrench that ``torques`` of all wheels exert.

    The wrench is ``J^T torques``, with the wheel matrix J; of the torques with this wrench, those
    with the least sum of squares. All are scaled together to the limits.

    Args:
        robot: The robot without failures.
        drive: Its driving wheels.
        torques: Torque of each wheel of the robot, N m.
        share: Share of the driving wheels' force limits that may be used.

    Returns:
        One torque for each wheel of the robot, N m; 0 for a failed wheel.
    """
    jacobian, kept = robot.chassis.jacobian, list(drive.wheels)
    driving = np.linalg.pinv(jacobian[kept].T) @ (jacobian.T @ np.asarray(torques))
    used = np.abs(driving) / (share * drive.force_limits * robot.wheel.radius)
    allocated = np.zeros(len(jacobian))
    allocated[kept] = driving / max(1.0, float(used.max()))
    return allocated
