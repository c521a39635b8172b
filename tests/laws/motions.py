"""Motions that the law tests share."""

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from omnidrive.geometry import Pose, WorldTwist
from omnidrive.reference import Setpoint


@dataclass(frozen=True)
class Circle:
    """One turn about the origin at constant speed with tangential heading, rotated by ``turn``."""

    radius: float = 1.0
    duration: float = 8.0
    turn: float = 0.0

    def at(self, t):
        rate = 2 * pi / self.duration
        inside = 0.0 <= t <= self.duration
        angle = rate * min(max(t, 0.0), self.duration) + self.turn
        pose = Pose(self.radius * sin(angle), -self.radius * cos(angle), angle)
        speed = self.radius * rate if inside else 0.0
        return Setpoint(pose, WorldTwist(speed * cos(angle), speed * sin(angle), rate * inside))

    def window(self, t, n, dt):
        return np.array([[*s.pose, *s.twist] for s in (self.at(t + k * dt) for k in range(n))])


def rotated(pose, angle):
    """Return the pose after a rotation of the world by ``angle`` about the origin."""
    c, s = cos(angle), sin(angle)
    return Pose(c * pose.x - s * pose.y, s * pose.x + c * pose.y, pose.yaw + angle)
