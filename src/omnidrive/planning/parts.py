"""Parts of a spline's pieces, halved where a bound is not yet close enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.planning.pieces import Pieces


class Parts(NamedTuple):
    """Parts of cubic pieces, all of one width.

    Attributes:
        slopes: First derivatives where each part begins.
        bends: Second derivatives there.
        jerks: Third derivatives, constant on a piece.
        width: Of each part, in the parameter by which the derivatives are taken.
    """

    slopes: Float[Array, "parts 2"]
    bends: Float[Array, "parts 2"]
    jerks: Float[Array, "parts 2"]
    width: float

    @classmethod
    def of(cls, pieces: Pieces) -> Parts:
        """Whole pieces."""
        return cls(pieces.slopes[:-1], pieces.bends[:-1], np.diff(pieces.bends, axis=0), 1.0)

    def halved(self, chosen: Bool[Array, " parts"]) -> Parts:
        """The halves of the chosen parts."""
        slopes, bends, jerks = self.slopes[chosen], self.bends[chosen], self.jerks[chosen]
        half = 0.5 * self.width
        return Parts(
            np.concatenate([slopes, slopes + half * bends + 0.5 * half**2 * jerks]),
            np.concatenate([bends, bends + half * jerks]),
            np.concatenate([jerks, jerks]),
            half,
        )

    def hodograph(self) -> Float[Array, "3 parts 2"]:
        """Bezier control points of the first derivative, which lies in their triangle."""
        middle = self.slopes + 0.5 * self.width * self.bends
        end = self.slopes + self.width * self.bends + 0.5 * self.width**2 * self.jerks
        return np.stack([self.slopes, middle, end])
