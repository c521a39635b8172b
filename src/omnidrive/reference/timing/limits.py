"""Limits of speed and acceleration of a reference."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, isfinite, isnan, pi
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.robot import Chassis, Robot, force_share

SPEED_SHARE = 0.98
"""Share of the wheel speed limit that references use; the rest is for the controller's feedback."""


@dataclass(frozen=True, eq=False, slots=True)
class MotionLimits:
    """Limits of the magnitude of speeds and accelerations; ``inf`` means no limit.

    At least :attr:`wheel_acceleration` or :attr:`acceleration_faces` has to be given. Wheel speeds
    are limited by the lower of :attr:`wheel_speed` and the limit of the chassis.

    Attributes:
        wheel_acceleration: Acceleration of each wheel, in rad/s^2.
        wheel_speed: Speed of each wheel, in rad/s.
        speed: Speed of the origin of B, in m/s.
        forward_speed: Speed along the x axis of B, in m/s.
        sideways_speed: Speed along the y axis of B, in m/s.
        yaw_rate: Yaw rate, in rad/s.
        acceleration: Acceleration of the origin of B, in m/s^2.
        yaw_acceleration: Yaw acceleration, in rad/s^2.
        jerk: Rate of change of the acceleration of the origin of B in W, in m/s^3.
        yaw_jerk: Rate of change of the yaw acceleration, in rad/s^3.
        acceleration_faces: Acceleration polytope
            ``|acceleration_faces @ (ax, ay, yaw acceleration)| <= 1`` in B, as
            :attr:`omnidrive.robot.Robot.acceleration_faces`; in s^2/m, s^2/m and s^2/rad. None: no
            limit.

    Raises:
        InvalidInput: A limit is not positive, the faces are not finite or have a rank below 3, or
            neither :attr:`wheel_acceleration` nor :attr:`acceleration_faces` is given.
    """

    wheel_acceleration: float = inf
    wheel_speed: float = inf
    speed: float = inf
    forward_speed: float = inf
    sideways_speed: float = inf
    yaw_rate: float = inf
    acceleration: float = inf
    yaw_acceleration: float = inf
    jerk: float = inf
    yaw_jerk: float = inf
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
            raise InvalidInput("acceleration_faces must be finite and have rank 3")
        if not (isfinite(self.wheel_acceleration) or self.acceleration_faces is not None):
            raise InvalidInput(
                "the acceleration is not limited; set wheel_acceleration in rad/s^2, or "
                "acceleration_faces"
            )

    @classmethod
    def of_robot(
        cls, robot: Robot, *, share: float = force_share.REFERENCES, max_speed: float | None = None
    ) -> MotionLimits:
        """Return the limits of references that the recommended controller follows in time.

        They are 0.98 of the wheel speed of the robot and a share of its acceleration polytope.

        Args:
            robot: Robot with motors and friction.
            share: Usable share of the accelerations that friction and motors allow; positive.
                ``holonomic-nmpc`` plans with at most :data:`~omnidrive.robot.force_share.PLANS` of
                them and follows a reference that needs more with a delay; the default leaves it a
                reserve for feedback.
            max_speed: :attr:`speed`, m/s; None: no limit other than the wheel speed.

        Raises:
            InvalidInput: ``share`` or ``max_speed`` is not positive, or the wheels of the robot
                cannot exert a force.
        """
        if not (isfinite(share) and share > 0.0):
            raise InvalidInput(f"share must be a positive number, got {share:g}")
        return cls(
            wheel_speed=SPEED_SHARE * robot.max_wheel_speed,
            speed=inf if max_speed is None else max_speed,
            acceleration_faces=robot.acceleration_faces / share,
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
    "jerk": "m/s^3",
    "yaw_jerk": "rad/s^3",
}


class LimitRows(NamedTuple):
    """Limit of ``rows @ vector``: each entry, or the Euclidean norm, is at most 1 in magnitude.

    Attributes:
        name: Name of the limit, by which its use is reported.
        kind: Kind of the vector. ``speed``: body twist; ``twist rate``: time derivative of the body
            twist, on which the wheels' accelerations depend; ``acceleration``: second derivatives
            of x, y and yaw in W, rotated into B. ``jerk``: their third derivatives, likewise.
        rows: Coefficients of the vector, divided by the limit; their units are the inverse of those
            of the vector.
        euclidean: Whether the Euclidean norm is limited, instead of each entry.
    """

    name: str
    kind: Literal["speed", "twist rate", "acceleration", "jerk"]
    rows: Float[Array, "rows 3"]
    euclidean: bool = False

    def shares(self, vectors: Float[Array, "3 n"]) -> Float[Array, " n"]:
        """Return the use of the limit by each vector, as a share of the limit."""
        values = self.rows @ vectors  # reductions are faster along the first axis
        shares: Float[Array, " n"] = (
            np.linalg.norm(values, axis=0) if self.euclidean else np.abs(values).max(axis=0)
        )
        return shares


class SectionLimit(NamedTuple):
    """Limit that holds on a part of a path.

    Attributes:
        limit: The limit.
        first: Path parameter s at the start of the part; s increases by 1 on each piece.
        last: Path parameter at its end, not below :attr:`first`; where both are equal, the limit
            holds on the intervals that meet there.
    """

    limit: LimitRows
    first: float
    last: float

    def intervals(self, count: int, width: float) -> Bool[Array, " intervals"]:
        """Return on which of ``count`` intervals of equal ``width`` in s the limit holds."""
        starts = np.arange(count) * width
        inset = -_TOUCH if self.last <= self.first else _TOUCH
        inside: Bool[Array, " intervals"] = (starts + width > self.first + inset) & (
            starts < self.last - inset
        )
        return inside


_TOUCH = 1e-9
"""Rounding of the path parameter."""


def limit_rows(chassis: Chassis, limits: MotionLimits) -> tuple[LimitRows, ...]:
    """Return every finite limit but the jerk's, and the wheel speed limit of ``chassis``, as rows.

    Wheel speeds are ``chassis.jacobian @ twist``, wheel accelerations ``chassis.jacobian`` times
    the derivative of the twist.
    """
    top = min(chassis.max_wheel_speed, limits.wheel_speed)
    x, y, yaw = np.eye(3)[:, None]
    groups: list[tuple[LimitRows, float]] = [
        (LimitRows("wheel speed", "speed", chassis.jacobian), top),
        (LimitRows("speed", "speed", np.eye(3)[:2], euclidean=True), limits.speed),
        (LimitRows("forward speed", "speed", x), limits.forward_speed),
        (LimitRows("sideways speed", "speed", y), limits.sideways_speed),
        (LimitRows("yaw rate", "speed", yaw), limits.yaw_rate),
        (
            LimitRows("wheel acceleration", "twist rate", chassis.jacobian),
            limits.wheel_acceleration,
        ),
        (
            LimitRows("acceleration", "acceleration", np.eye(3)[:2], euclidean=True),
            limits.acceleration,
        ),
        (LimitRows("yaw acceleration", "acceleration", yaw), limits.yaw_acceleration),
    ]
    if limits.acceleration_faces is not None:
        groups.append((LimitRows("wheel force", "acceleration", limits.acceleration_faces), 1.0))
    return tuple(
        group._replace(rows=group.rows / limit) for group, limit in groups if isfinite(limit)
    )


def jerk_rows(limits: MotionLimits) -> tuple[LimitRows, ...]:
    """Return the finite limits of the jerk as rows."""
    groups = (
        (LimitRows("jerk", "jerk", np.eye(3)[:2], euclidean=True), limits.jerk),
        (LimitRows("yaw jerk", "jerk", np.eye(3)[2:]), limits.yaw_jerk),
    )
    return tuple(
        group._replace(rows=group.rows / limit) for group, limit in groups if isfinite(limit)
    )


_ANGLES = np.arange(16) * pi / 16
_POLYGON = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1) / cos(pi / 32)
"""``|_POLYGON @ a| <= 1`` is the polygon of 32 sides inscribed in the circle ``|a| <= 1``; the
distance of its sides from the centre is 0.5 % less than the radius."""


def limit_terms(
    body: tuple[Float[Array, "n 3"], Float[Array, "n 3"], Float[Array, "n 3"]],
    limits: tuple[LimitRows, ...],
) -> tuple[Float[Array, "n rows"], Float[Array, "n rows"]]:
    """Return all limits at n points of a path q(s) as ``|along u + across x| <= 1``.

    Here u = d2s/dt2 and x = (ds/dt)^2. With b = R^T q', which is q' in B, the twist is b ds/dt, its
    derivative is b u + (db/ds) x, and the acceleration is b u + R^T q'' x. A Euclidean norm is
    limited by a polygon of 32 sides within the circle.

    Args:
        body: b, db/ds and R^T q'', see
            :func:`~omnidrive.reference.timing.piecewise_path.body_derivatives`.
        limits: The limits.

    Returns:
        ``along`` and ``across``: one row for each point; one column for each limited entry of a
        twist rate or an acceleration, and a last one for the tightest speed limit, squared.
    """
    first, change, second = body
    along, across, square = [], [], np.zeros(len(first))
    for group in limits:
        if group.kind == "speed":
            values = (first @ group.rows.T) ** 2
            top = values.sum(axis=1) if group.euclidean else values.max(axis=1)
            square = np.maximum(square, top)
            continue
        rows = _POLYGON @ group.rows if group.euclidean else group.rows
        along.append(first @ rows.T)
        across.append((change if group.kind == "twist rate" else second) @ rows.T)
    along.append(np.zeros((len(first), 1)))
    across.append(square[:, None])
    return np.hstack(along), np.hstack(across)
