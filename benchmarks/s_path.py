"""S-shaped reference: one period of a sine, from rest to rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from omnidrive.geometry import BodyTwist, Pose, WorldTwist, twist_between
from omnidrive.reference import Setpoint

LENGTH, WIDTH = 4.0, 0.5  # m, period and amplitude of the sine
SPEED = 0.7  # m/s


class SPath:
    """Reference along the S at :data:`SPEED`.

    Args:
        turning: Whether the heading follows the path; otherwise it is 0.
        ramp: Duration of the acceleration and of the deceleration, in s; 0 for none.
    """

    def __init__(self, turning: bool, ramp: float) -> None:
        x = np.linspace(0.0, LENGTH, 20_001)
        rate = 2.0 * np.pi / LENGTH
        y = WIDTH * np.sin(rate * x)
        heading = np.arctan2(WIDTH * rate * np.cos(rate * x), 1.0) * turning
        self._along = np.concatenate([[0.0], np.hypot(np.diff(x), np.diff(y)).cumsum()])
        self._columns = x, y, heading
        self._ramp = ramp
        self.duration = float(self._along[-1]) / SPEED + ramp

    def _distance(self, t: float) -> float:
        """Return the distance travelled after t s, in m."""
        t = min(max(t, 0.0), self.duration)
        if t > 0.5 * self.duration:
            return float(self._along[-1]) - self._distance(self.duration - t)
        if t < self._ramp:
            return 0.5 * SPEED * t * t / self._ramp
        return SPEED * (t - 0.5 * self._ramp)

    def pose(self, t: float) -> Pose:
        distance = self._distance(t)
        return Pose(*(float(np.interp(distance, self._along, column)) for column in self._columns))

    def at(self, t: float) -> Setpoint:
        e = 1e-3
        rates = np.subtract(self.pose(t + e), self.pose(t - e)) / (2.0 * e)
        return Setpoint(self.pose(t), WorldTwist(*rates.tolist()))

    def window(self, t: float, n: int, dt: float) -> np.ndarray:
        points = [self.at(t + k * dt) for k in range(n)]
        return np.array([[*point.pose, *point.twist] for point in points])

    def commands(self, dt: float) -> list[BodyTwist]:
        """Return the constant twists between the poses, one per ``dt`` s."""
        poses = [self.pose(k * dt) for k in range(round(self.duration / dt) + 1)]
        return [twist_between(a, b, dt) for a, b in pairwise(poses)]
