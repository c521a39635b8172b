"""Obstacles that move along given paths."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite

from omnidrive.errors import InvalidInput

MAX_MOVING_OBSTACLES = 32
"""Largest number of moving obstacles; each costs computing time in every step."""
MAX_PATH_POINTS = 10_000
"""Largest number of points of one path."""


@dataclass(frozen=True, slots=True)
class MovingObstacle:
    """A disc that moves at constant velocity from point to point and is never stopped.

    Attributes:
        radius: Radius, m.
        times: Time at each point since the start of the run, s; it rests before the first and after
            the last.
        points: (x, y) in W, m.
        loop: Whether the path repeats after the last time; if the last point differs from the
            first, the disc jumps there.

    Raises:
        InvalidInput: A number is not finite, the radius is not positive, the times do not increase,
            there are none or too many, or the numbers of times and points differ.
    """

    radius: float
    times: tuple[float, ...]
    points: tuple[tuple[float, float], ...]
    loop: bool = False

    def __post_init__(self) -> None:
        if not (isfinite(self.radius) and self.radius > 0.0):
            raise InvalidInput(f"a moving obstacle's radius must be positive, got {self.radius} m")
        if not 1 <= len(self.times) == len(self.points) <= MAX_PATH_POINTS:
            raise InvalidInput(
                f"a moving obstacle needs as many times as points, 1 to {MAX_PATH_POINTS}; "
                f"got {len(self.times)} times and {len(self.points)} points"
            )
        if not all(map(isfinite, (*self.times, *(v for point in self.points for v in point)))):
            raise InvalidInput("a moving obstacle's times and points must be finite")
        if self.times[0] < 0.0 or any(b <= a for a, b in pairwise(self.times)):
            raise InvalidInput("a moving obstacle's times must increase from 0 s or later")

    def position(self, t: float) -> tuple[float, float]:
        """Return the centre (x, y) at time ``t`` (s) in W, m."""
        times = self.times
        if self.loop and t > times[-1] > 0.0:
            t %= times[-1]
        k = bisect_right(times, t)
        if k == 0 or k == len(times):
            return self.points[max(k - 1, 0)]
        fraction = (t - times[k - 1]) / (times[k] - times[k - 1])
        (x, y), (to_x, to_y) = self.points[k - 1], self.points[k]
        return x + fraction * (to_x - x), y + fraction * (to_y - y)
