"""Timing in which the spline's parameter grows uniformly, as in the paper."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.planning import SplinePath
from omnidrive.reference.course import turned_into_body
from omnidrive.reference.reference import Setpoint
from omnidrive.robot import Chassis


@dataclass(frozen=True, eq=False)
class UniformReference:
    """A spline path whose parameter is ``t / duration``.

    Attributes:
        path: The way.
        duration: Time from its start to its end, in s.
    """

    path: SplinePath
    duration: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.duration) and self.duration > 0.0):
            raise InvalidReference(f"duration must be positive, got {self.duration:g} s")

    def at(self, t: float) -> Setpoint:
        """Setpoint at time ``t`` in s; outside [0, duration] an end pose, at rest."""
        x, y, yaw, *twist = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(x, y, yaw), WorldTwist(*twist))

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Setpoints at ``t + k * dt`` for k = 0..n-1, columns as in :class:`Reference`."""
        u = (t + dt * np.arange(n)) / self.duration
        inside = (u >= 0.0) & (u <= 1.0 + 1e-12)  # k * dt / duration may round past 1
        u = np.clip(u, 0.0, 1.0)
        twists = self.path.first_derivatives(u) / self.duration * inside[:, None]
        return np.hstack([self.path.poses(u), twists])


def wheel_speed_used(path: SplinePath, duration: float, chassis: Chassis) -> float:
    """Peak of any wheel's speed as a share of its limit, for ``path`` in ``duration`` s.

    Wheel speeds are proportional to 1 / duration, so one sweep along the path finds their peak.
    """
    u = np.linspace(0.0, 1.0, 20 * len(path.control_points) + 1)
    slopes = turned_into_body(path.first_derivatives(u), path.poses(u)[:, 2])
    peak = float(np.abs(slopes @ chassis.jacobian.T).max())
    return peak / (duration * chassis.max_wheel_speed)


def shortest_duration(path: SplinePath, chassis: Chassis) -> float:
    """Least duration in s, to 0.1 s, at which uniform timing keeps every wheel within its limit."""
    return ceil(wheel_speed_used(path, 1.0, chassis) * 10.0) / 10.0


def time_uniformly(path: SplinePath, duration: float, chassis: Chassis) -> UniformReference:
    """Reference along ``path`` that the wheels of ``chassis`` can follow.

    Raises:
        InvalidReference: ``duration`` (s) is too short; the message says the shortest that is not.
    """
    reference = UniformReference(path, duration)
    shortest = shortest_duration(path, chassis)
    if duration < shortest:
        raise InvalidReference(
            f"{duration:g} s is too short for this path of {path.length:.2f} m: a wheel would need "
            f"{shortest / duration * chassis.max_wheel_speed:.0f} rad/s and reaches "
            f"{chassis.max_wheel_speed:g} rad/s. The shortest duration is {shortest:g} s "
            f"(a mean speed of {path.length / shortest:.2f} m/s)"
        )
    return reference
