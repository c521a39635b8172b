"""What the controller sees instead of the true pose."""

from __future__ import annotations

from dataclasses import dataclass
from math import sin
from typing import Protocol, runtime_checkable

import numpy as np

from omnidrive.geometry import Pose


@runtime_checkable
class Sensor(Protocol):
    """Turns true poses into measured ones."""

    def sense(self, t: float, pose: Pose) -> Pose:
        """Pose measured at ``t`` (s) when the true one is ``pose``."""
        ...


@dataclass(frozen=True, slots=True)
class PerfectSensor:
    """Measures the true pose."""

    def sense(self, t: float, pose: Pose) -> Pose:
        """The true pose."""
        return pose


@dataclass(frozen=True, eq=False, slots=True)
class PaperNoise:
    """The paper's noise: ``rand() / 6 * sin(t / 5)`` added to x, y (m) and yaw (rad).

    ``rand`` is uniform in [0, 1], so the noise is biased: positive for the first 5 pi seconds.

    Attributes:
        rng: Source of ``rand``; three numbers are drawn per call, in the order x, y, yaw.
    """

    rng: np.random.Generator

    def sense(self, t: float, pose: Pose) -> Pose:
        """True pose plus noise."""
        size = sin(t / 5.0) / 6.0
        dx, dy, dyaw = (self.rng.random(3) * size).tolist()
        return Pose(pose.x + dx, pose.y + dy, pose.yaw + dyaw)
