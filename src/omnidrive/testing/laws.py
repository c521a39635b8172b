"""Collection of broken laws, and the motions that the checks use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import OmnidriveError
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.reference import Setpoint

Law = Callable[[], str | None]
"""A check: it returns None, or a sentence that says how the law is broken."""


def check_laws(kind: str, laws: dict[str, Law]) -> None:
    """Check all laws, by name, also after one that is broken other than `protocol`.

    Raises:
        AssertionError: Laws are broken; the message has one line for each.
    """
    broken = []
    for name, law in laws.items():
        try:
            fact = law()
        except OmnidriveError as error:
            fact = str(error)
        except Exception as error:
            fact = f"it raises {type(error).__name__}: {error}"
        if fact is not None:
            broken.append(f"  {name}: {fact}")
            if name == "protocol":  # the other laws would all fail
                break
    if broken:
        raise AssertionError("\n".join([f"the {kind} breaks {len(broken)} law(s)", *broken]))


@dataclass(frozen=True)
class Circle:
    """One turn about the origin at constant speed with tangential heading.

    Attributes:
        turn: Rotation of the world, rad.
        radius: Radius, m.
        duration: Duration, s.
    """

    turn: float = 0.0
    radius: float = 1.0
    duration: float = 8.0

    def at(self, t: float) -> Setpoint:
        """Return the setpoint at ``t`` (s)."""
        rate = 2.0 * pi / self.duration
        inside = 0.0 <= t <= self.duration
        angle = rate * min(max(t, 0.0), self.duration) + self.turn
        speed = self.radius * rate if inside else 0.0
        return Setpoint(
            Pose(self.radius * sin(angle), -self.radius * cos(angle), angle),
            WorldTwist(speed * cos(angle), speed * sin(angle), rate * inside),
        )

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return poses and twists at t, t + dt, ..., see :class:`Reference`."""
        setpoints = (self.at(t + k * dt) for k in range(n))
        return np.array([[*s.pose, *s.twist] for s in setpoints])


def rotated(pose: Pose, angle: float) -> Pose:
    """Return the pose after a rotation of the world by ``angle`` (rad) about the origin."""
    c, s = cos(angle), sin(angle)
    return Pose(c * pose.x - s * pose.y, s * pose.x + c * pose.y, pose.yaw + angle)


def first_difference(one: Float[Array, "rows n"], two: Float[Array, "rows n"]) -> int | None:
    """Return the first row in which two logs differ in any bit; None: they are equal."""
    rows = min(len(one), len(two))
    for row in range(rows):
        if one[row].tobytes() != two[row].tobytes():
            return row
    return None if len(one) == len(two) else rows
