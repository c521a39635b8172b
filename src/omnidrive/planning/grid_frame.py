"""The frame of a grid's cells: where columns and rows lie in W."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.maps import OccupancyGrid


class GridFrame(NamedTuple):
    """Places in cells: column first, then row; cell (i, j) is the square from (j, i) on.

    Attributes:
        corner: Outer corner of cell (0, 0), in m of W.
        sides: The steps to the next column and to the next row, in m of W; orthogonal.
    """

    corner: Float[Array, " xy"]
    sides: Float[Array, "2 2"]

    @classmethod
    def of(cls, grid: OccupancyGrid) -> GridFrame:
        """Frame of a grid, turned or not."""
        rows, cols = grid.occupied.shape
        first = np.array(grid.centre(0, 0))
        # across the whole grid: least rounding
        right = (np.array(grid.centre(0, cols)) - first) / cols
        up = (np.array(grid.centre(rows, 0)) - first) / rows
        return cls(first - 0.5 * (right + up), np.stack([right, up]))

    @property
    def resolution(self) -> float:
        """Side of a cell, in m."""
        return float(np.hypot(*self.sides[0]))

    @property
    def rounding(self) -> float:
        """What places may be off by rounding, in cells: more where W's origin is far away."""
        far = float(np.abs(self.corner).max()) / self.resolution
        return 1e-8 + 8.0 * float(np.finfo(float).eps) * far

    def cells(self, points: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """Places in cells of points in m of W."""
        return np.ascontiguousarray((points - self.corner) @ self.sides.T / self.resolution**2)

    def world(self, places: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """Points in m of W of places in cells."""
        points: Float[Array, "points 2"] = self.corner + places @ self.sides
        return points
