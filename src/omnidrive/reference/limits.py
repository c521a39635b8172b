"""What a timed reference may ask of the robot."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, isnan
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.robot import Chassis, Robot


@dataclass(frozen=True, eq=False, slots=True)
class MotionLimits:
    """Limits of a motion; ``inf`` is no limit. Every wheel has the same.

    The wheels' top speed is the chassis's, or :attr:`wheel_speed` if that is less.

    Attributes:
        wheel_acceleration: Of every wheel, in rad/s^2.
        wheel_speed: Of every wheel, in rad/s.
        speed: Of the origin of B in any direction, in m/s.
        forward_speed: Along B's x axis, both ways, in m/s.
        sideways_speed: Along B's y axis, both ways, in m/s.
        yaw_rate: In rad/s, both ways.
        acceleration: Of the origin of B in any direction, in m/s^2.
        yaw_acceleration: In rad/s^2, both ways.
        acceleration_faces: Rows with ``|acceleration_faces @ (ax, ay, yaw acceleration)| <= 1``, as
            :attr:`omnidrive.robot.Robot.acceleration_faces`; in s^2/m, s^2/m and s^2/rad.

    Raises:
        InvalidInput: A limit is zero, negative or not a number, or nothing limits acceleration.
    """

    wheel_acceleration: float = inf
    wheel_speed: float = inf
    speed: float = inf
    forward_speed: float = inf
    sideways_speed: float = inf
    yaw_rate: float = inf
    acceleration: float = inf
    yaw_acceleration: float = inf
    acceleration_faces: Float[Array, "faces 3"] | None = None

    def __post_init__(self) -> None:
        for name, unit in _UNITS.items():
            value = getattr(self, name)
            if isnan(value) or value <= 0.0:
                raise InvalidInput(
                    f"the limit of the {name.replace('_', ' ')} must be positive, "
                    f"got {value:g} {unit}"
                )
        if self.acceleration_faces is not None and not (
            np.isfinite(self.acceleration_faces).all()
            and np.linalg.matrix_rank(self.acceleration_faces) == 3
        ):
            raise InvalidInput("acceleration_faces must be finite and limit every acceleration")
        if not (isfinite(self.wheel_acceleration) or self.acceleration_faces is not None):
            raise InvalidInput(
                "nothing limits the wheels' acceleration, so that the motion could jump into its "
                "top speed; give wheel_acceleration in rad/s^2, or acceleration_faces"
            )

    @classmethod
    def of_robot(cls, robot: Robot, *, share: float = 0.85) -> MotionLimits:
        """What the motors reach and the wheels can push, the latter up to ``share`` of it."""
        if not (isfinite(share) and share > 0.0):
            raise InvalidInput(f"the share of traction must be positive, got {share:g}")
        return cls(
            wheel_speed=robot.max_wheel_speed, acceleration_faces=robot.acceleration_faces / share
        )


_UNITS = {
    "wheel_acceleration": "rad/s^2",
    "wheel_speed": "rad/s",
    "speed": "m/s",
    "forward_speed": "m/s",
    "sideways_speed": "m/s",
    "yaw_rate": "rad/s",
    "acceleration": "m/s^2",
    "yaw_acceleration": "rad/s^2",
}


class LimitRows(NamedTuple):
    """One limit as ``|rows @ vector| <= 1``, every row or, if ``round``, their Euclidean norm.

    The vector is, by kind: ``speed``: the twist, written in B; ``twist rate``: its time
    derivative, which is what a wheel's acceleration depends on; ``acceleration``: the second
    derivatives of x, y and yaw in W, turned into B.
    """

    name: str
    kind: Literal["speed", "twist rate", "acceleration"]
    rows: Float[Array, "rows 3"]
    round: bool = False


def limit_rows(chassis: Chassis, limits: MotionLimits) -> tuple[LimitRows, ...]:
    """Every finite limit; wheel limits are those of ``chassis``'s own wheel matrix."""
    top = min(chassis.max_wheel_speed, limits.wheel_speed)
    x, y, yaw = np.eye(3)[:, None]
    groups: list[tuple[LimitRows, float]] = [
        (LimitRows("wheel speed", "speed", chassis.jacobian), top),
        (LimitRows("speed", "speed", np.eye(3)[:2], round=True), limits.speed),
        (LimitRows("forward speed", "speed", x), limits.forward_speed),
        (LimitRows("sideways speed", "speed", y), limits.sideways_speed),
        (LimitRows("yaw rate", "speed", yaw), limits.yaw_rate),
        (
            LimitRows("wheel acceleration", "twist rate", chassis.jacobian),
            limits.wheel_acceleration,
        ),
        (
            LimitRows("acceleration", "acceleration", np.eye(3)[:2], round=True),
            limits.acceleration,
        ),
        (LimitRows("yaw acceleration", "acceleration", yaw), limits.yaw_acceleration),
    ]
    if limits.acceleration_faces is not None:
        groups.append((LimitRows("wheel force", "acceleration", limits.acceleration_faces), 1.0))
    return tuple(
        group._replace(rows=group.rows / limit) for group, limit in groups if isfinite(limit)
    )
