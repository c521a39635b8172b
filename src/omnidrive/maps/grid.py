"""Occupancy grids: where the robot may be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import floor

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import binary_erosion, distance_transform_edt
from scipy.spatial import cKDTree

from omnidrive.errors import InvalidMap

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Which cells of the floor are taken.

    Attributes:
        occupied: True where an obstacle is; row i grows with y, column j with x.
        resolution: Side of a cell, in m.
        origin: Outer corner of cell (0, 0), in W; rows and columns run along W's axes, in m.
        walled: Whether everything outside the grid is taken too.
    """

    occupied: Bool[Array, "rows cols"]
    resolution: float
    origin: tuple[float, float] = (0.0, 0.0)
    walled: bool = True

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
        inside: bool = 0 <= row < rows and 0 <= col < cols
        return inside

    def is_occupied(self, x: float, y: float) -> bool:
        """Whether the point (x, y) of W lies in an obstacle."""
        row, col = self.cell(x, y)
        return bool(self.occupied[row, col]) if self.contains(row, col) else self.walled

    def occupied_on(self, other: OccupancyGrid) -> Bool[Array, "rows cols"]:
        """Whether the centre of each cell of ``other`` is occupied here."""
        row, col = (
            np.floor(
                (start + (np.arange(count) + 0.5) * other.resolution - own) / self.resolution
            ).astype(int)
            for start, own, count in zip(
                other.origin[::-1], self.origin[::-1], other.occupied.shape, strict=True
            )
        )
        rows, cols = self.occupied.shape
        outside = np.add.outer((row < 0) | (row >= rows), (col < 0) | (col >= cols))
        near = self.occupied[np.ix_(row.clip(0, rows - 1), col.clip(0, cols - 1))]
        taken: Bool[Array, "rows cols"] = np.where(outside, self.walled, near)
        return taken

    def inflated(self, radius: float) -> OccupancyGrid:
        """Grid whose free cells are those on whose centre a disc of ``radius`` (m) touches nothing.

        Distances run from centre to centre and are cut by half a cell's diagonal, so that no
        corner of an obstacle is missed.
        """
        if radius <= 0.0:
            return self
        padded = np.pad(self.occupied, 1, constant_values=self.walled)
        distance = distance_transform_edt(~padded)[1:-1, 1:-1] * self.resolution
        near = distance < radius + self.resolution * 0.5**0.5
        return OccupancyGrid(self.occupied | near, self.resolution, self.origin, self.walled)

    @cached_property
    def _edges(self) -> tuple[_Squares, _Squares]:
        """Occupied squares with a free neighbour (a ring outside included), and the reverse."""
        taken = np.pad(self.occupied, 2, constant_values=self.walled)
        x, y = self.centre(-2, -2)
        return (
            _Squares.on_edge(taken, (x, y), self.resolution),
            _Squares.on_edge(~taken, (x, y), self.resolution),
        )

    def clearance(self, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
        """Exact distance in m from each point (m, in W) to the nearest obstacle cell.

        Negative inside an obstacle: the distance to the nearest free cell.
        """
        taken, free = self._edges
        inside = np.array([self.is_occupied(x, y) for x, y in points.tolist()])
        out = np.empty(len(points))
        out[~inside] = taken.distance(points[~inside])
        out[inside] = -free.distance(points[inside])
        return out


@dataclass(frozen=True, eq=False, slots=True)
class _Squares:
    """Axis-parallel squares of one size, for exact distances to the nearest."""

    centres: Float[Array, "squares 2"]
    tree: cKDTree
    side: float

    @classmethod
    def on_edge(
        cls, mask: Bool[Array, "rows cols"], first: tuple[float, float], side: float
    ) -> _Squares:
        """Squares of ``mask`` with one of eight neighbours outside it; ``first`` is a centre."""
        rows, cols = np.nonzero(mask & ~binary_erosion(mask, np.ones((3, 3)), border_value=1))
        centres = np.stack([first[0] + cols * side, first[1] + rows * side], axis=1)
        return cls(centres, cKDTree(centres), side)

    def distance(self, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
        """Distance from each point to the nearest square, in m; infinite without squares."""
        out = np.full(len(points), np.inf)
        if len(self.centres) and len(points):
            nearest, _ = self.tree.query(points)
            # the nearest square's centre is at most half a diagonal less half a side further
            reach = nearest + 0.2072 * self.side
            for i, ids in enumerate(self.tree.query_ball_point(points, reach)):
                gaps = np.abs(points[i] - self.centres[ids]) - 0.5 * self.side
                out[i] = np.hypot(*np.maximum(gaps, 0.0).T).min()
        return out
