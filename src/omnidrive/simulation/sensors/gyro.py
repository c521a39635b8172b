"""Yaw-rate gyro."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from omnidrive.estimation import GyroSettings


@dataclass(slots=True)
class Gyro:
    """Mean yaw rate between consecutive readings, as an integrating gyro reports it.

    Attributes:
        settings: Noise and bias.
        rng: Generator; one number is drawn per reset, two per reading.
        bias: Current bias, rad/s.
    """

    settings: GyroSettings
    rng: np.random.Generator
    bias: float = field(default=0.0, init=False)

    def reset(self) -> None:
        """Draw a new initial bias."""
        self.bias = self.settings.bias * float(self.rng.standard_normal())

    def read(self, turn: float, dt: float) -> float:
        """Return the mean yaw rate, rad/s, for a true rotation of ``turn`` (rad) in ``dt`` (s)."""
        noise, walk = self.rng.standard_normal(2).tolist()
        rate: float = turn / dt + self.bias + self.settings.noise_density / sqrt(dt) * noise
        self.bias += self.settings.bias_walk * sqrt(dt) * walk
        return rate
