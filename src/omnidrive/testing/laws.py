"""What the checks of controllers, plants and state estimators have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.components import Component
from omnidrive.errors import PART_ERRORS, OmnidriveError, one_line
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.reference import Setpoint
from omnidrive.robot import Robot, named_robot

Law = Callable[[], str | None]
"""A check: it returns None, or a sentence that says how the law is broken."""


class Laws(ABC):
    """The laws of one kind of part, for the products of one factory; abstract.

    Args:
        factory: The class or function that makes the part.
        robot: The robot. None: the built-in robot `small`.
        parameters: Parameters for the factory. None: the defaults.
    """

    kind: ClassVar[str]
    """Noun of the part, such as "plant"."""
    row: ClassVar[str]
    """Noun of one row of :meth:`record`."""
    dt: float = 0.1
    """Time between two rows, s."""

    def __init__(self, factory: Callable[..., Any], robot: Robot | None, parameters: Any) -> None:
        name = getattr(factory, "__name__", f"of the {self.kind}")
        self.component = Component(f"{self.kind}s", name, "", factory)
        self.robot, self.parameters = robot or named_robot("small"), parameters

    def make(self) -> Any:
        """Return a new object from the factory; its type is not checked yet."""
        return self.component.make(self.context(), self.parameters)

    @abstractmethod
    def context(self) -> Any:
        """Return a new context for the factory."""

    @abstractmethod
    def protocol(self) -> str | None:
        """Check the members of the part, and the types of its results."""

    @abstractmethod
    def record(self, part: Any) -> Sequence[object]:
        """Return the results of one run from ``reset`` on, ``dt`` apart; the same for each call."""

    def determinism(self) -> str | None:
        """Check that two runs of one part, and that of a new one, are equal in every bit."""
        part = self.make()
        once = [repr(row) for row in self.record(part)]
        for what, cause, is_new in (
            ("after reset", "reset keeps some memory", False),
            (f"in a new {self.kind}", "randomness or global state", True),
        ):
            again = [repr(row) for row in self.record(self.make() if is_new else part)]
            for k, (a, b) in enumerate(zip(once, again, strict=True)):
                if a != b:
                    return f"{what}, the {self.row} at {k * self.dt:g} s differs: {cause}"
        return None

    def check(self, **others: Law) -> None:
        """Check protocol, determinism and other laws; if the protocol is broken, only that.

        Raises:
            AssertionError: Laws are broken; the message has one line for each.
        """
        broken = []
        laws = {"protocol": self.protocol, "determinism": self.determinism, **others}
        for name, law in laws.items():
            try:
                fact = law()
            except OmnidriveError as error:
                fact = str(error)
            except PART_ERRORS as error:
                fact = one_line(f"it raises {type(error).__name__}: {error}")
            if fact is not None:
                broken.append(f"  {name.replace('_', ' ')}: {fact}")
                if name == "protocol":  # the other laws would all fail
                    break
        if broken:
            raise AssertionError(
                "\n".join([f"the {self.kind} breaks {len(broken)} law(s)", *broken])
            )


@dataclass(frozen=True)
class Circle:
    """One turn about the origin at constant speed with tangential heading.

    Attributes:
        radius: Radius, m.
        duration: Duration, s.
        turn: Rotation of the world, rad.
    """

    radius: float = 1.0
    duration: float = 8.0
    turn: float = 0.0

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
