"""Line with a raised-cosine lateral offset."""

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
class RaisedCosine(PlaneCurve):
    """Line with the lateral offset y = amplitude (1 - cos(2 pi periods x / length)) / 2.

    At both ends the offset is 0 and the direction that of the x axis of the start.
    """

    length: Annotated[float, Bounds(0.01, 1000.0, "m")] = 6.0
    """Length along the x axis of the start, m."""
    amplitude: Annotated[float, Bounds(-100.0, 100.0, "m")] = 1.0
    """Largest lateral offset, m; positive to the left, 0 for a straight line."""
    periods: Annotated[int, Bounds(1, 100, "")] = 2
    """Number of periods."""

    def points(self, s: Float[Array, " n"]) -> Float[Array, "4 n 2"]:
        """Return x and y, and their derivatives, see :meth:`PlaneCurve.points`."""
        rate = 2.0 * pi * self.periods
        y = -0.5 * self.amplitude * harmonics(rate * s + 0.5 * pi, rate)
        y[0] += 0.5 * self.amplitude
        x = np.zeros_like(y)
        x[0], x[1] = self.length * s, self.length
        return np.stack([x, y], axis=2)

    def directions(self, s: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the direction of travel in rad; it stays within a quarter turn of 0."""
        x, y = self.points(s)[1].T
        direction: Float[Array, " n"] = np.arctan2(y, x)
        return direction
