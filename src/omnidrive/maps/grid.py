"""Occupancy grids: where the robot may be."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, floor, hypot, sin

import numpy as np
from jaxtyping import Bool, Float, Int, Int32

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidMap
from omnidrive.maps.footprint import check_footprint, covered_runs, swept
from omnidrive.maps.nearest import column_table, disc_reach, gaps, nearest_cell, within_reach
from omnidrive.maps.region import flood

_FURTHEST = 2.0**62  # cells; where the conversion to an integer ends


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Which cells of the floor are taken. Do not change them once the grid is in use.

    Attributes:
        occupied: True where an obstacle is; row i grows with the grid's y, column j with its x.
        resolution: Side of a cell, in m.
        origin: Outer corner of cell (0, 0), in m of W.
        walled: Whether everything outside the grid is taken too.
        yaw: From W's x axis to the grid's, about the origin, in rad, counter-clockwise positive.

    Raises:
        InvalidMap: There are no cells, or a number is not finite or not positive.
    """

    occupied: Bool[Array, "rows cols"]
    resolution: float
    origin: tuple[float, float] = (0.0, 0.0)
    walled: bool = True
    yaw: float = 0.0

    def __post_init__(self) -> None:
        if self.occupied.dtype != bool or self.occupied.ndim != 2 or self.occupied.size == 0:
            raise InvalidMap(
                "a grid needs an array of booleans with one row and one column or more, "
                f"got {self.occupied.dtype} of shape {self.occupied.shape}"
            )
        if not (np.isfinite(self.resolution) and self.resolution > 0.0):
            raise InvalidMap(f"the resolution must be positive, got {self.resolution:g} m per cell")
        if not np.isfinite((*self.origin, self.yaw)).all():
            raise InvalidMap(f"the origin must be finite, got {self.origin} m, {self.yaw} rad")
        # one layout, so that kernels are compiled once
        object.__setattr__(self, "occupied", np.require(self.occupied, requirements=["C", "W"]))

    @property
    def corners(self) -> Float[Array, "4 2"]:
        """Outer corners (x, y), in m of W, counter-clockwise from the origin."""
        rows, cols = self.occupied.shape
        return self._in_world(np.array([(0, 0), (0, cols), (rows, cols), (rows, 0)], float))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least box along W's axes that holds the grid: (left, right, bottom, top), in m."""
        left, bottom = self.corners.min(axis=0).tolist()
        right, top = self.corners.max(axis=0).tolist()
        return (left, right, bottom, top)

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Row and column of the cell that holds the point (x, y) of W; perhaps outside."""
        along, across = cos(self.yaw), sin(self.yaw)
        dx, dy = x - self.origin[0], y - self.origin[1]
        return (
            floor((along * dy - across * dx) / self.resolution),
            floor((along * dx + across * dy) / self.resolution),
        )

    def cells_of(self, points: Float[Array, "points 2"]) -> Int[Array, "points 2"]:
        """Row and column of the cells that hold points (x, y), in m of W; perhaps outside."""
        cells: Int[Array, "points 2"] = (
            np.floor(self._in_cells(points)).clip(-_FURTHEST, _FURTHEST).astype(np.int64)
        )
        return cells

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """Centre (x, y) of a cell, in m of W."""
        along, across = cos(self.yaw), sin(self.yaw)
        v, u = (row + 0.5) * self.resolution, (col + 0.5) * self.resolution
        return (
            self.origin[0] + (along * u - across * v),
            self.origin[1] + (across * u + along * v),
        )

    def centres(self, cells: Int[Array, "cells 2"]) -> Float[Array, "cells 2"]:
        """Centres (x, y) of cells (row, column), in m of W."""
        return self._in_world(cells + 0.5)

    def contains(self, row: int, col: int) -> bool:
        """Whether the cell lies in the grid."""
        rows, cols = self.occupied.shape
        inside: bool = 0 <= row < rows and 0 <= col < cols
        return inside

    def is_occupied(self, x: float, y: float) -> bool:
        """Whether the point (x, y) of W lies in an obstacle."""
        row, col = self.cell(x, y)
        return bool(self.occupied[row, col]) if self.contains(row, col) else self.walled

    def occupied_at(self, points: Float[Array, "points 2"]) -> Bool[Array, " points"]:
        """Whether each point (x, y), in m of W, lies in an obstacle."""
        cells = self.cells_of(points)
        last = np.array(self.occupied.shape) - 1
        within = ((cells >= 0) & (cells <= last)).all(axis=1)
        row, col = cells.clip(0, last).T
        taken: Bool[Array, " points"] = np.where(within, self.occupied[row, col], self.walled)
        return taken

    def occupied_on(self, other: OccupancyGrid) -> Bool[Array, "rows cols"]:
        """Whether the centre of each cell of ``other`` is occupied here."""
        frames = ((g.occupied.shape, g.resolution, g.origin, g.yaw) for g in (self, other))
        if next(frames) == next(frames):
            return self.occupied.copy()
        rows, cols = other.occupied.shape
        cells = np.column_stack([np.zeros(cols, np.int64), np.arange(cols)])
        taken = np.empty((rows, cols), bool)
        for row in range(rows):
            cells[:, 0] = row
            taken[row] = self.occupied_at(other.centres(cells))
        return taken

    def inflated(self, radius: float) -> OccupancyGrid:
        """Grid whose free cells are those on whose centre a disc of ``radius`` (m) hits nothing.

        The disc hits a square if the square is nearer to its centre than the radius: the exact
        Euclidean distance, of the square and not of its centre. On any other point of a free cell
        it reaches at most half a cell's diagonal into an obstacle.

        Raises:
            InvalidInput: The radius is negative or not finite.
        """
        if not (np.isfinite(radius) and radius >= 0.0):
            raise InvalidInput(
                f"obstacles are inflated by a finite radius of 0 m or more, got {radius:g} m"
            )
        if radius == 0.0:
            return self
        in_cells = radius / self.resolution
        steps = int(min(in_cells + 2.0, self.occupied.shape[0] + 1.0))
        near = within_reach(self._to_taken, self.walled, disc_reach(in_cells, steps))
        return replace(self, occupied=self.occupied | near)

    def inflated_by(
        self, footprint: Float[Array, "corners 2"], yaw: float | None = None
    ) -> OccupancyGrid:
        """Grid whose free cells are those on whose centre the robot's footprint hits nothing.

        The footprint hits a square if it covers some of its interior. The time is proportional to
        the number of rows of cells that the footprint spans.

        Args:
            footprint: Corners (x, y) of a polygon, convex or not, in m of the robot's frame.
            yaw: The robot's heading, in rad; without one, whatever it is: a disc about the robot's
                centre through the furthest corner.

        Raises:
            InvalidInput: The footprint is no polygon, or the heading is not finite.
        """
        corners = np.asarray(footprint, dtype=float)
        check_footprint(corners)
        if yaw is None:
            return self.inflated(float(np.hypot(*corners.T).max()))
        if not np.isfinite(yaw):
            raise InvalidInput(f"the heading must be finite, got {yaw} rad")
        along, across = cos(yaw - self.yaw), sin(yaw - self.yaw)
        x, y = corners.T / self.resolution
        turned = np.column_stack([across * x + along * y, along * x - across * y])
        runs = covered_runs(turned, *self.occupied.shape)
        return replace(self, occupied=self.occupied | swept(self.occupied, self.walled, runs))

    def clearance(self, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
        """Exact distance in m from each point (m, in W) to the nearest obstacle cell.

        Negative inside an obstacle: the distance to the nearest free cell. Infinite where there is
        no such cell; NaN for a point that is not finite.
        """
        out = np.full(len(points), np.nan)
        finite = np.isfinite(points).all(axis=1)
        inside = finite.copy()
        inside[finite] = self.occupied_at(points[finite])
        outside = finite & ~inside
        out[outside] = gaps(self._to_taken, self.walled, self._in_cells(points[outside]))
        if inside.any():
            out[inside] = -gaps(self._to_free, not self.walled, self._in_cells(points[inside]))
        return out * self.resolution

    def nearest_free(self, x: float, y: float) -> tuple[tuple[int, int], float] | None:
        """The free cell whose centre is nearest to a point, and its distance in m.

        None if no cell is free.
        """
        v, u = self._in_cells(np.array([[x, y]]))[0].tolist()
        row, col = nearest_cell(~self.occupied, v, u)
        if row < 0:
            return None
        centre = self.centre(row, col)
        return (row, col), hypot(centre[0] - x, centre[1] - y)

    def region_size(self, row: int, col: int, *, cut_corners: bool = False) -> int:
        """How many free cells can be reached from a cell, itself included; 0 if it is taken.

        Diagonal moves reach no more cells than sideways ones, unless they may pass between two
        taken cells.

        Args:
            row: Of the cell.
            col: Of the cell.
            cut_corners: Whether diagonal moves may pass taken cells.
        """
        if not self.contains(row, col) or self.occupied[row, col]:
            return 0
        return int(flood(self.occupied, row, col, 2 if cut_corners else 1))

    def _in_cells(self, points: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """(Row, column) of points of W, as fractions counted from the origin."""
        along, across = cos(self.yaw), sin(self.yaw)
        dx, dy = (points - np.array(self.origin)).T
        return np.column_stack([along * dy - across * dx, along * dx + across * dy]) / (
            self.resolution
        )

    def _in_world(self, cells: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """Points (x, y) of W from (row, column) as fractions: the inverse of the above."""
        along, across = cos(self.yaw), sin(self.yaw)
        v, u = (cells * self.resolution).T
        return np.column_stack(
            [self.origin[0] + (along * u - across * v), self.origin[1] + (across * u + along * v)]
        )

    @cached_property
    def _to_taken(self) -> Int32[Array, "rows cols"]:
        return column_table(self.occupied, self.walled)

    @cached_property
    def _to_free(self) -> Int32[Array, "rows cols"]:
        return column_table(~self.occupied, not self.walled)
