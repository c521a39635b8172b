"""Coordinate frame of a grid's cells in the world frame W."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.maps import OccupancyGrid


class GridFrame(NamedTuple):
    """Frame in units of cells, (column, row): cell (i, j) is the square from (j, i) to (j+1, i+1).

    Attributes:
        corner: Outer corner of cell (0, 0) in W, m.
        sides: Vectors to the next column and to the next row in W, m; orthogonal.
    """

    corner: Float[Array, " xy"]
    sides: Float[Array, "2 2"]

    @classmethod
    def of(cls, grid: OccupancyGrid) -> GridFrame:
        """Create the frame of a grid, axis-aligned or rotated."""
        rows, cols = grid.occupied.shape
        first = np.array(grid.centre(0, 0))
        # over the whole grid, which minimises the rounding error
        right = (np.array(grid.centre(0, cols)) - first) / cols
        up = (np.array(grid.centre(rows, 0)) - first) / rows
        return cls(first - 0.5 * (right + up), np.stack([right, up]))

    @property
    def resolution(self) -> float:
        """Side of a cell, in m."""
        return float(np.hypot(*self.sides[0]))

    @property
    def rounding(self) -> float:
        """Rounding error of positions, in cells; it grows with the distance to W's origin."""
        far = float(np.abs(self.corner).max()) / self.resolution
        return 1e-8 + 8.0 * float(np.finfo(float).eps) * far

    def cells(self, points: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """Transform points from W (m) to cells."""
        return np.ascontiguousarray((points - self.corner) @ self.sides.T / self.resolution**2)

    def world(self, positions: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """Transform points from cells to W (m)."""
        points: Float[Array, "points 2"] = self.corner + positions @ self.sides
        return points
