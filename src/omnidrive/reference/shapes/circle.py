"""Circle."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Annotated

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.parameter import Bounds
from omnidrive.reference.shapes.shape import PlaneCurve, harmonics


@dataclass(frozen=True, kw_only=True)
class Circle(PlaneCurve):
    """Circle that leaves the start along the x axis: (r sin a, r (1 - cos a)), a = 2 pi laps s."""

    radius: Annotated[float, Bounds(0.01, 1000.0, "m")] = 1.0
    """Radius, m."""
    laps: Annotated[int, Bounds(1, 100, "")] = 1
    """Number of laps."""
    clockwise: bool = False
    """Whether the motion is clockwise; the centre is then on the right of the start."""

    def points(self, s: Float[Array, " n"]) -> Float[Array, "4 n 2"]:
        """Return x and y, and their derivatives, see :meth:`PlaneCurve.points`."""
        rate = 2.0 * pi * self.laps
        x, y = harmonics(rate * s, rate), -harmonics(rate * s + 0.5 * pi, rate)
        y[0] += 1.0
        return self.radius * np.stack([x, self._side * y], axis=2)

    def directions(self, s: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the direction of travel in rad, continuous in s."""
        return self._side * 2.0 * pi * self.laps * s

    @property
    def _side(self) -> float:
        return -1.0 if self.clockwise else 1.0
