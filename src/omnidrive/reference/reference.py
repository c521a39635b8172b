"""Timed references: what the robot should do, as a function of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose, WorldTwist


class Setpoint(NamedTuple):
    """Where the robot should be at one instant, and how fast it should be moving."""

    pose: Pose
    twist: WorldTwist


@runtime_checkable
class Reference(Protocol):
    """A motion defined on [0, duration]; before and after, it holds its end poses at rest."""

    @property
    def duration(self) -> float:
        """Length of the motion in s."""
        ...

    def at(self, t: float) -> Setpoint:
        """Setpoint at time ``t`` in s."""
        ...

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Setpoints at ``t + k * dt`` for k = 0..n-1.

        Columns: x, y in m, yaw in rad, then their derivatives in m/s, m/s, rad/s, all in W.
        """
        ...


@dataclass(frozen=True, slots=True)
class Hold:
    """Stand at one pose for ``duration`` seconds: the target of a step response."""

    pose: Pose
    duration: float

    def at(self, t: float) -> Setpoint:
        """Setpoint at time ``t`` in s: always the same."""
        return Setpoint(self.pose, WorldTwist(0.0, 0.0, 0.0))

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """``n`` times the same setpoint."""
        return np.tile([*self.pose, 0.0, 0.0, 0.0], (n, 1))
