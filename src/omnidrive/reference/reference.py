"""Protocol of reference motions: desired pose and twist as functions of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose, WorldTwist


class Setpoint(NamedTuple):
    """Desired pose and twist at one time, both in W."""

    pose: Pose
    twist: WorldTwist


@runtime_checkable
class Reference(Protocol):
    """Motion on [0, duration]; rest at its first pose before and at its last pose afterwards."""

    @property
    def duration(self) -> float:
        """Duration of the motion, in s."""
        ...

    def at(self, t: float) -> Setpoint:
        """Return the setpoint at time ``t`` in s."""
        ...

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt`` for k = 0..n-1.

        Columns: x, y in m, yaw in rad, then their derivatives in m/s, m/s and rad/s, all in W.
        """
        ...


@dataclass(frozen=True, slots=True)
class Hold:
    """Constant pose for ``duration`` seconds; the reference of a step response."""

    pose: Pose
    duration: float

    def at(self, t: float) -> Setpoint:
        """Return the constant setpoint."""
        return Setpoint(self.pose, WorldTwist(0.0, 0.0, 0.0))

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return ``n`` rows with the constant setpoint."""
        return np.tile([*self.pose, 0.0, 0.0, 0.0], (n, 1))
