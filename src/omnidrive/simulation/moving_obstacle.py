"""Obstacles that move on given paths."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite

from omnidrive.errors import InvalidInput

MAX_MOVING_OBSTACLES = 32
"""How many obstacles may move in one world: each costs time in every step."""
MAX_PATH_POINTS = 10_000
"""Of one obstacle's path."""


@dataclass(frozen=True, slots=True)
class MovingObstacle:
    """A disc that moves from point to point, evenly in between, whatever stands in its way.

    Attributes:
        radius: In m.
        times: When it is at each point, in s since the start; it stands before and after.
        points: (x, y) in W, in m.
        loop: Whether it starts again at the last of the times; it then jumps from the last point
            to the first unless they are the same.

    Raises:
        InvalidInput: A number is not finite, the radius not positive, the times do not grow, or
            there are none, too many, or not as many as points.
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
            raise InvalidInput("a moving obstacle's times must grow, from 0 s or later")

    def at(self, t: float) -> tuple[float, float]:
        """Where its centre is at time ``t`` (s): (x, y) in W, in m."""
        times = self.times
        if self.loop and t > times[-1] > 0.0:
            t %= times[-1]
        k = bisect_right(times, t)
        if k == 0 or k == len(times):
            return self.points[max(k - 1, 0)]
        part = (t - times[k - 1]) / (times[k] - times[k - 1])
        (x, y), (to_x, to_y) = self.points[k - 1], self.points[k]
        return x + part * (to_x - x), y + part * (to_y - y)
