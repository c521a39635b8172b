"""Protocol of reference motions: desired pose and twist as functions of time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
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


class WindowReference(ABC):
    """Base of references that are evaluated at many times at once; abstract."""

    __slots__ = ()

    def at(self, t: float) -> Setpoint:
        """Return the setpoint at time ``t`` in s; outside [0, duration] an end pose, at rest."""
        x, y, yaw, *twist = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(x, y, yaw), WorldTwist(*twist))

    @abstractmethod
    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""


def check_duration(duration: float) -> None:
    """Raise :class:`~omnidrive.errors.InvalidReference` unless it (s) is finite and positive."""
    if not (np.isfinite(duration) and duration > 0.0):
        raise InvalidReference(f"duration must be positive, got {duration:g} s")


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
