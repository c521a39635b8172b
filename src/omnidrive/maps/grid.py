"""Occupancy grids: where the robot may be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import floor, hypot

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from omnidrive.errors import InvalidMap

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Which cells of the floor are taken; everything outside the grid is taken too.

    Attributes:
        occupied: True where an obstacle is; row i grows with y, column j with x.
        resolution: Side of a cell, in m.
        origin: Outer corner of cell (0, 0), in W; rows and columns run along W's axes, in m.
    """

    occupied: Bool[Array, "rows cols"]
    resolution: float
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.resolution) and self.resolution > 0.0):
            raise InvalidMap(f"the resolution must be positive, got {self.resolution:g} m per cell")
        if not np.isfinite(self.origin).all():
            raise InvalidMap(f"the origin must be finite, got {self.origin}")

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Outer edges (left, right, bottom, top), in m."""
        rows, cols = self.occupied.shape
        x, y = self.origin
        return (x, x + cols * self.resolution, y, y + rows * self.resolution)

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Row and column of the cell that holds the point (x, y) of W; perhaps outside."""
        return (
            floor((y - self.origin[1]) / self.resolution),
            floor((x - self.origin[0]) / self.resolution),
        )

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """Centre (x, y) of a cell, in m of W."""
        return (
            self.origin[0] + (col + 0.5) * self.resolution,
            self.origin[1] + (row + 0.5) * self.resolution,
        )

    def contains(self, row: int, col: int) -> bool:
        """Whether the cell lies in the grid."""
        rows, cols = self.occupied.shape
        return 0 <= row < rows and 0 <= col < cols

    def inflated(self, radius: float) -> OccupancyGrid:
        """Grid whose free cells are those on whose centre a disc of ``radius`` (m) touches nothing.

        Distances run from centre to centre and are cut by half a cell's diagonal, so that no
        corner of an obstacle is missed; the grid's edge counts as an obstacle.
        """
        if radius <= 0.0:
            return self
        padded = np.pad(self.occupied, 1, constant_values=True)
        distance = distance_transform_edt(~padded)[1:-1, 1:-1] * self.resolution
        near = distance < radius + self.resolution * 0.5**0.5
        return OccupancyGrid(self.occupied | near, self.resolution, self.origin)

    @cached_property
    def _boundary(self) -> tuple[cKDTree, Float[Array, "cells 2"]]:
        """Occupied cells with a free neighbour, the ring outside the grid included."""
        taken = np.pad(self.occupied, 2, constant_values=True)
        free = ~taken
        edge = taken.copy()
        edge[1:-1, 1:-1] &= (
            free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
            | free[:-2, :-2] | free[:-2, 2:] | free[2:, :-2] | free[2:, 2:]
        )  # fmt: skip
        edge[[0, -1], :] = edge[:, [0, -1]] = False
        rows, cols = np.nonzero(edge)
        x, y = self.centre(-2, -2)
        centres = np.stack([x + cols * self.resolution, y + rows * self.resolution], axis=1)
        return cKDTree(centres), centres

    def clearance(self, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
        """Exact distance in m from each point (m, in W) to the nearest obstacle cell.

        Zero inside an obstacle; infinite if there is neither obstacle nor edge.
        """
        tree, centres = self._boundary
        half = 0.5 * self.resolution
        nearest, _ = tree.query(points)
        out = np.empty(len(points))
        for i, (x, y) in enumerate(points.tolist()):
            row, col = self.cell(x, y)
            if not self.contains(row, col) or self.occupied[row, col]:
                out[i] = 0.0
                continue
            # the nearest square's centre is at most half a diagonal less half a side further
            near = centres[tree.query_ball_point((x, y), nearest[i] + 0.42 * self.resolution)]
            out[i] = min(
                hypot(max(abs(x - cx) - half, 0.0), max(abs(y - cy) - half, 0.0))
                for cx, cy in near.tolist()
            )
        return out
