"""Figure of eight."""

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
class Eight(PlaneCurve):
    """Lemniscate of Gerono: (length / 2 sin a, width / 2 sin 2a), a = 2 pi laps s.

    Lawrence, "A Catalog of Special Plane Curves", 1972, ch. 5. The start is the crossing.
    """

    length: Annotated[float, Bounds(0.01, 1000.0, "m")] = 4.0
    """Extent along the x axis of the start, m."""
    width: Annotated[float, Bounds(0.01, 1000.0, "m")] = 2.0
    """Extent along the y axis of the start, m."""
    laps: Annotated[int, Bounds(1, 100, "")] = 1
    """Number of laps."""

    def points(self, s: Float[Array, " n"]) -> Float[Array, "4 n 2"]:
        """Return x and y, and their derivatives, see :meth:`PlaneCurve.points`."""
        rate = 2.0 * pi * self.laps
        x = 0.5 * self.length * harmonics(rate * s, rate)
        y = 0.5 * self.width * harmonics(2.0 * rate * s, 2.0 * rate)
        return np.stack([x, y], axis=2)

    def directions(self, s: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the direction of travel in rad, continuous in s.

        It stays within half a turn of -pi/2, its mean over a lap.
        """
        x, y = self.points(s)[1].T
        direction: Float[Array, " n"] = np.arctan2(x, -y) - 0.5 * pi
        return direction
