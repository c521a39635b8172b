"""Random smooth motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Annotated

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.parameter import Bounds
from omnidrive.reference.shapes.shape import Shape
from omnidrive.reference.timing.piecewise_path import PathDerivatives


@dataclass(frozen=True, kw_only=True)
class RandomSmooth(Shape):
    """Random closed motion in x, y and heading: sums of sines with random amplitudes and phases.

    Shinozuka & Deodatis, "Simulation of stochastic processes by spectral representation", 1991. The
    amplitude of the k-th harmonic is proportional to u / k^1.5 with u uniform in [0.5, 1]. The
    heading is independent of the direction of travel.
    """

    seed: Annotated[int, Bounds(0, 2**53, "")] = 1
    """Seed of amplitudes and phases."""
    extent: Annotated[float, Bounds(0.01, 1000.0, "m")] = 4.0
    """Largest extent in x and in y, m."""
    turn: Annotated[float, Bounds(0.0, 100.0, "rad")] = 3.0
    """Largest difference of two headings, rad."""
    harmonics: Annotated[int, Bounds(1, 50, "")] = 5
    """Number of harmonics; more make a curve with more turns."""

    def evaluate(self, s: Float[Array, " n"]) -> PathDerivatives:
        """Return poses and derivatives, see :meth:`Shape.evaluate`."""
        amplitudes, phases = self._spectrum
        rates = 2.0 * pi * np.arange(1, self.harmonics + 1)
        angles = s[:, None, None] * rates + phases
        sines = amplitudes * np.sin(angles)
        poses = sines.sum(axis=2) - (amplitudes * np.sin(phases)).sum(axis=1)
        first = (rates * amplitudes * np.cos(angles)).sum(axis=2)
        return PathDerivatives(poses, first, -(rates**2 * sines).sum(axis=2))

    @cached_property
    def _spectrum(self) -> tuple[Float[Array, "3 harmonics"], Float[Array, "3 harmonics"]]:
        """Amplitudes and phases; the amplitudes of x, y and yaw add up to half their range."""
        rng = np.random.default_rng(self.seed)
        weights = (
            rng.uniform(0.5, 1.0, (3, self.harmonics)) / np.arange(1, self.harmonics + 1) ** 1.5
        )
        ranges = np.array([self.extent, self.extent, self.turn])
        amplitudes = 0.5 * ranges[:, None] * weights / weights.sum(axis=1, keepdims=True)
        return amplitudes, rng.uniform(0.0, 2.0 * pi, (3, self.harmonics))
