"""A gyro that measures the yaw rate."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import Annotated

import numpy as np

from omnidrive.parameter import Bounds


@dataclass(frozen=True, slots=True)
class GyroSettings:
    """A gyro as data sheets describe it.

    The defaults are those of a usual part in drones and robots: 0.014 deg/s / sqrt(Hz), and a bias
    that was averaged for two seconds at rest before the start, which leaves 0.01 deg/s of it.
    """

    noise_density: Annotated[float, Bounds(0.0, 1.0, "rad/s/sqrt(Hz)")] = 2.4e-4
    """Of its white noise: the angle walks by this times the square root of seconds."""
    bias: Annotated[float, Bounds(0.0, 1.0, "rad/s")] = 2e-4
    """Standard deviation of the bias with which a run begins."""
    bias_walk: Annotated[float, Bounds(0.0, 1.0, "rad/s/sqrt(s)")] = 2e-5
    """Standard deviation of the bias's change in one second."""


@dataclass(slots=True)
class Gyro:
    """Mean yaw rates over the intervals between readings, as a gyro sums them up.

    Attributes:
        settings: How good it is.
        rng: One number is drawn at every reset, two at every reading.
        bias: Now, in rad/s.
    """

    settings: GyroSettings
    rng: np.random.Generator
    bias: float = field(default=0.0, init=False)

    def reset(self) -> None:
        """Begin with another bias."""
        self.bias = self.settings.bias * float(self.rng.standard_normal())

    def read(self, turn: float, dt: float) -> float:
        """Mean yaw rate in rad/s, when the robot truly turned by ``turn`` (rad) in ``dt`` (s)."""
        noise, walk = self.rng.standard_normal(2).tolist()
        rate: float = turn / dt + self.bias + self.settings.noise_density / sqrt(dt) * noise
        self.bias += self.settings.bias_walk * sqrt(dt) * walk
        return rate
