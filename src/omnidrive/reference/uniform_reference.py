"""References whose spline parameter grows uniformly with time, as in the paper."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.planning import SplinePath
from omnidrive.reference.reference import WindowReference, check_duration
from omnidrive.reference.timing.piecewise_path import rotate_into_body
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


def top_speed(path: SplinePath, duration: float) -> float:
    """Return the largest speed on ``path`` in ``duration`` s, in m/s."""
    derivatives = path.first_derivatives(_parameters(path))
    return float(np.linalg.norm(derivatives[:, :2], axis=1).max()) / duration


def wheel_speed_used(path: SplinePath, duration: float, chassis: Chassis) -> float:
    """Return the peak wheel speed on ``path`` in ``duration`` s, as a share of the speed limit.

    Wheel speeds are proportional to 1 / duration, so that one evaluation of the path gives the
    peak for every duration.
    """
    u = _parameters(path)
    derivatives = rotate_into_body(path.first_derivatives(u), path.poses(u)[:, 2])
    peak = float(np.abs(derivatives @ chassis.jacobian.T).max())
    return peak / (duration * chassis.max_wheel_speed)


def _parameters(path: SplinePath) -> Float[Array, " n"]:
    """Return the parameters at which the speeds on a path are evaluated."""
    return np.linspace(0.0, 1.0, 20 * len(path.control_points) + 1)


def shortest_duration(path: SplinePath, chassis: Chassis, max_speed: float = inf) -> float:
    """Return the shortest duration, in s, rounded up to 0.1 s, within the speed limits.

    Args:
        path: The path.
        chassis: Wheel kinematics and wheel speed limit.
        max_speed: Largest speed, in m/s.
    """
    shortest = max(wheel_speed_used(path, 1.0, chassis), top_speed(path, 1.0) / max_speed)
    return ceil(shortest * 10.0) / 10.0


def time_uniformly(
    path: SplinePath, duration: float, chassis: Chassis, max_speed: float = inf
) -> UniformReference:
    """Return the uniform reference along ``path`` in ``duration`` s, at most at ``max_speed`` m/s.

    Raises:
        InvalidReference: The speed or that of a wheel would exceed its limit; the message gives the
            shortest duration.
    """
    reference = UniformReference(path, duration)
    shortest = shortest_duration(path, chassis, max_speed)
    if duration < shortest:
        need, top = top_speed(path, duration), chassis.max_wheel_speed
        excess = (
            f"the speed would reach {need:.2f} m/s, and the largest is {max_speed:g} m/s"
            if shortest > shortest_duration(path, chassis)
            else f"a wheel would need {shortest / duration * top:.0f} rad/s and reaches {top:g} "
            "rad/s"
        )
        raise InvalidReference(
            f"{duration:g} s is too short for this path of {path.length:.2f} m: {excess}. The "
            f"shortest duration is {shortest:g} s (a mean speed of {path.length / shortest:.2f} "
            "m/s)"
        )
    return reference
