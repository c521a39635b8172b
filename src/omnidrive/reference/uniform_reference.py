"""References whose spline parameter grows uniformly with time, as in the paper."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.planning import SplinePath
from omnidrive.reference.piecewise_path import rotate_into_body
from omnidrive.reference.reference import WindowReference, check_duration
from omnidrive.robot import Chassis


@dataclass(frozen=True, eq=False)
class UniformReference(WindowReference):
    """Motion along a spline path with the parameter ``t / duration``.

    Attributes:
        path: Path to follow.
        duration: Duration of the motion, in s.

    Raises:
        InvalidReference: ``duration`` is not a positive number.
    """

    path: SplinePath
    duration: float

    def __post_init__(self) -> None:
        check_duration(self.duration)

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        u = (t + dt * np.arange(n)) / self.duration
        inside = (u >= 0.0) & (u <= 1.0 + 1e-12)  # k * dt / duration may round past 1
        u = np.clip(u, 0.0, 1.0)
        twists = self.path.first_derivatives(u) / self.duration * inside[:, None]
        return np.hstack([self.path.poses(u), twists])


def wheel_speed_used(path: SplinePath, duration: float, chassis: Chassis) -> float:
    """Return the peak wheel speed on ``path`` in ``duration`` s, as a share of the speed limit.

    Wheel speeds are proportional to 1 / duration, so that one evaluation of the path gives the
    peak for every duration.
    """
    u = np.linspace(0.0, 1.0, 20 * len(path.control_points) + 1)
    derivatives = rotate_into_body(path.first_derivatives(u), path.poses(u)[:, 2])
    peak = float(np.abs(derivatives @ chassis.jacobian.T).max())
    return peak / (duration * chassis.max_wheel_speed)


def shortest_duration(path: SplinePath, chassis: Chassis) -> float:
    """Return the shortest duration, in s, rounded up to 0.1 s, within the wheel speed limit."""
    return ceil(wheel_speed_used(path, 1.0, chassis) * 10.0) / 10.0


def time_uniformly(path: SplinePath, duration: float, chassis: Chassis) -> UniformReference:
    """Return the uniform reference along ``path`` in ``duration`` s.

    Raises:
        InvalidReference: A wheel would exceed its speed limit; the message gives the shortest
            duration.
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
