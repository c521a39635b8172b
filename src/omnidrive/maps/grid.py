"""Occupancy grids: free and occupied cells of the plane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, floor, hypot, sin

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput, InvalidMap
from omnidrive.geometry.polygon import check_footprint
from omnidrive.maps.distance import (
    column_table,
    disc_reach,
    nearest_cell,
    square_distances,
    within_reach,
)
from omnidrive.maps.footprint import covered_runs, footprint_hits

_FURTHEST = 2.0**62  # cells; limit of the conversion to 64-bit integers
_FURTHEST_ORIGIN = 1e12  # cells; beyond, positions in a cell are rounded to thousandths of it


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Occupancy of square cells. Do not modify the array once the grid is in use.

    Attributes:
        occupied: True for obstacles. The row index grows along the y axis of the grid, the column
            index along its x axis.
        resolution: Side of a cell, in m.
        origin: Outer corner of cell (0, 0) in W, in m.
        walled: Whether everything outside the grid counts as occupied.
        yaw: Angle from the x axis of W to that of the grid, in rad, counter-clockwise positive.

    Raises:
        InvalidMap: The array is empty or not boolean, or a number is not finite, or the resolution
            is not positive, or the origin is more than 1e12 cells from that of W.
    """

    occupied: Bool[Array, "rows cols"]
    resolution: float
    origin: tuple[float, float] = (0.0, 0.0)
    walled: bool = True
    yaw: float = 0.0

    def __post_init__(self) -> None:
        if self.occupied.dtype != bool or self.occupied.ndim != 2 or self.occupied.size == 0:
            raise InvalidMap(
                "a grid needs a two-dimensional array of booleans with at least one cell, "
                f"got {self.occupied.dtype} of shape {self.occupied.shape}"
            )
        if not (np.isfinite(self.resolution) and self.resolution > 0.0):
            raise InvalidMap(f"the resolution must be positive, got {self.resolution:g} m per cell")
        if not np.isfinite((*self.origin, self.yaw)).all():
            raise InvalidMap(f"the origin must be finite, got {self.origin} m, {self.yaw} rad")
        if max(map(abs, self.origin)) > _FURTHEST_ORIGIN * self.resolution:
            raise InvalidMap(
                f"the origin {self.origin} m is more than {_FURTHEST_ORIGIN:g} cells of "
                f"{self.resolution:g} m from the origin of the world frame, where positions are no "
                "longer exact; move the map nearer to it"
            )
        # one memory layout, so that kernels are compiled only once
        object.__setattr__(self, "occupied", np.require(self.occupied, requirements=["C", "W"]))

    @property
    def corners(self) -> Float[Array, "4 2"]:
        """Outer corners (x, y) in W, in m, counter-clockwise from the origin."""
        rows, cols = self.occupied.shape
        return self.points_of(np.array([(0, 0), (0, cols), (rows, cols), (rows, 0)], float))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Bounding box (left, right, bottom, top) in W, in m."""
        left, bottom = self.corners.min(axis=0).tolist()
        right, top = self.corners.max(axis=0).tolist()
        return (left, right, bottom, top)

    def bordered(self) -> OccupancyGrid:
        """Return the grid with the walls around it as cells: a border of one occupied cell.

        A grid without walls, or whose outermost cells are all occupied, is returned as it is.
        """
        edges = (self.occupied[[0, -1]], self.occupied[:, [0, -1]])
        if not self.walled or all(each.all() for each in edges):
            return self
        x, y = self.points_of(np.array([(-1.0, -1.0)]))[0].tolist()
        cells = np.pad(self.occupied, 1, constant_values=True)
        return replace(self, occupied=cells, origin=(x, y))

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return row and column of the cell of the point (x, y) in W; it may lie outside."""
        along, across = cos(self.yaw), sin(self.yaw)
        dx, dy = x - self.origin[0], y - self.origin[1]
        v = (along * dy - across * dx) / self.resolution
        u = (along * dx + across * dy) / self.resolution
        return (
            floor(min(max(v, -_FURTHEST), _FURTHEST)),
            floor(min(max(u, -_FURTHEST), _FURTHEST)),
        )

    def cells_of(self, points: Float[Array, "points 2"]) -> Int[Array, "points 2"]:
        """Return row and column of the cells of points (x, y) in W; they may lie outside."""
        cells: Int[Array, "points 2"] = (
            np.floor(self._in_cells(points)).clip(-_FURTHEST, _FURTHEST).astype(np.int64)
        )
        return cells

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """Return the centre (x, y) of a cell in W, in m."""
        along, across = cos(self.yaw), sin(self.yaw)
        v, u = (row + 0.5) * self.resolution, (col + 0.5) * self.resolution
        return (
            self.origin[0] + (along * u - across * v),
            self.origin[1] + (across * u + along * v),
        )

    def centres(self, cells: Int[Array, "cells 2"]) -> Float[Array, "cells 2"]:
        """Return the centres (x, y) of cells (row, column) in W, in m."""
        return self.points_of(cells + 0.5)

    def contains(self, row: int, col: int) -> bool:
        """Whether a cell lies in the grid."""
        rows, cols = self.occupied.shape
        inside: bool = 0 <= row < rows and 0 <= col < cols
        return inside

    def is_occupied(self, x: float, y: float) -> bool:
        """Whether the point (x, y) in W lies in an obstacle."""
        row, col = self.cell(x, y)
        return bool(self.occupied[row, col]) if self.contains(row, col) else self.walled

    def occupied_at(self, points: Float[Array, "points 2"]) -> Bool[Array, " points"]:
        """Whether each point (x, y) in W, in m, lies in an obstacle."""
        cells = self.cells_of(points)
        last = np.array(self.occupied.shape) - 1
        within = ((cells >= 0) & (cells <= last)).all(axis=1)
        row, col = cells.clip(0, last).T
        occupied: Bool[Array, " points"] = np.where(within, self.occupied[row, col], self.walled)
        return occupied

    def occupied_on(self, other: OccupancyGrid) -> Bool[Array, "rows cols"]:
        """Whether the centre of each cell of ``other`` is occupied in this grid."""
        frames = ((g.occupied.shape, g.resolution, g.origin, g.yaw) for g in (self, other))
        if next(frames) == next(frames):
            return self.occupied.copy()
        rows, cols = other.occupied.shape
        cells = np.column_stack([np.zeros(cols, np.int64), np.arange(cols)])
        occupied = np.empty((rows, cols), bool)
        for row in range(rows):
            cells[:, 0] = row
            occupied[row] = self.occupied_at(other.centres(cells))
        return occupied

    def inflated(self, radius: float) -> OccupancyGrid:
        """Return the grid whose free cells are those at whose centre a disc does not collide.

        A disc of ``radius`` (m) collides with an occupied square if the exact Euclidean distance
        from its centre to the square is less than the radius. At any other point of a free cell it
        overlaps an obstacle by at most half the diagonal of a cell.

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
        near = within_reach(self._distances_to_occupied, self.walled, disc_reach(in_cells, steps))
        return replace(self, occupied=self.occupied | near)

    def inflated_by(
        self, footprint: Float[Array, "corners 2"], yaw: float | None = None
    ) -> OccupancyGrid:
        """Return the grid whose free cells are those where the footprint does not collide.

        The robot's centre is at the centre of the cell. The footprint collides with an occupied
        square if it covers a part of its interior. The time is proportional to the number of rows
        of cells that the footprint spans.

        Args:
            footprint: Corners (x, y) of a polygon in B, in m; it need not be convex.
            yaw: Heading of the robot in W, in rad. None covers every heading by the disc about the
                robot's centre through the farthest corner.

        Raises:
            InvalidInput: The footprint is not a polygon, or the heading is not finite.
        """
        corners = np.asarray(footprint, dtype=float)
        check_footprint(corners)
        if yaw is None:
            return self.inflated(float(np.hypot(*corners.T).max()))
        if not np.isfinite(yaw):
            raise InvalidInput(f"the heading must be finite, got {yaw} rad")
        along, across = cos(yaw - self.yaw), sin(yaw - self.yaw)
        x, y = corners.T / self.resolution
        rotated = np.column_stack([across * x + along * y, along * x - across * y])
        runs = covered_runs(rotated, *self.occupied.shape)
        return replace(
            self, occupied=self.occupied | footprint_hits(self.occupied, self.walled, runs)
        )

    def clearance(self, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
        """Return the exact distance in m from each point (x, y) in W to the nearest obstacle.

        Inside an obstacle it is minus the distance to the nearest free cell. It is infinite if
        there is no such cell, and NaN for a point that is not finite.
        """
        out = np.full(len(points), np.nan)
        finite = np.isfinite(points).all(axis=1)
        inside = finite.copy()
        inside[finite] = self.occupied_at(points[finite])
        outside = finite & ~inside
        out[outside] = square_distances(
            self._distances_to_occupied, self.walled, self._in_cells(points[outside]), np.inf
        )
        if inside.any():
            out[inside] = -square_distances(
                self._distances_to_free, not self.walled, self._in_cells(points[inside]), np.inf
            )
        return out * self.resolution

    def centre_distances(self, limit: float) -> Float32[Array, "rows cols"]:
        """Return the distance in m from the centre of each cell to the nearest obstacle.

        It is at most ``limit`` (m), and 0 in an obstacle.
        """
        rows, cols = self.occupied.shape
        distances = np.empty((rows, cols), np.float32)
        centres = np.column_stack([np.zeros(cols), np.arange(cols) + 0.5])
        reach = limit / self.resolution
        for row in range(rows):
            centres[:, 0] = row + 0.5
            distances[row] = square_distances(
                self._distances_to_occupied, self.walled, centres, reach
            )
        return distances * np.float32(self.resolution)

    def nearest_free(self, x: float, y: float) -> tuple[tuple[int, int], float] | None:
        """Return the free cell whose centre is nearest to a point in W, and the distance in m.

        Returns None if no cell is free.
        """
        v, u = self._in_cells(np.array([[x, y]]))[0].tolist()
        row, col = nearest_cell(~self.occupied, v, u)
        if row < 0:
            return None
        centre = self.centre(row, col)
        return (row, col), hypot(centre[0] - x, centre[1] - y)

    def region_size(self, row: int, col: int, *, cut_corners: bool = False) -> int:
        """Return the number of free cells connected to a cell, itself included; 0 if occupied.

        Diagonal moves connect no additional cells unless they may pass between two occupied cells.

        Args:
            row: Row of the cell.
            col: Column of the cell.
            cut_corners: Whether diagonal moves may pass occupied cells.
        """
        if not self.contains(row, col) or self.occupied[row, col]:
            return 0
        return int(_connected_cells(self.occupied, row, col, 2 if cut_corners else 1))

    def _in_cells(self, points: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """Transform points (x, y) in W to fractional (row, column), relative to the origin."""
        along, across = cos(self.yaw), sin(self.yaw)
        with np.errstate(over="ignore"):  # infinity is right
            dx, dy = (points - np.array(self.origin)).T
            cells = np.column_stack([along * dy - across * dx, along * dx + across * dy])
            return cells / self.resolution

    def points_of(self, cells: Float[Array, "points 2"]) -> Float[Array, "points 2"]:
        """Return points (x, y) in W, in m; ``cells`` are fractional rows and columns.

        The corners of cell (row, column) are at whole numbers, its centre at (row + 0.5,
        column + 0.5).
        """
        along, across = cos(self.yaw), sin(self.yaw)
        v, u = (cells * self.resolution).T
        return np.column_stack(
            [self.origin[0] + (along * u - across * v), self.origin[1] + (across * u + along * v)]
        )

    @cached_property
    def _distances_to_occupied(self) -> Int32[Array, "rows cols"]:
        return column_table(self.occupied, self.walled)

    @cached_property
    def _distances_to_free(self) -> Int32[Array, "rows cols"]:
        return column_table(~self.occupied, not self.walled)


@compiled
def _connected_cells(occupied: Bool[Array, "rows cols"], row: int, col: int, reach: int) -> int:
    """Count the free cells connected to a free cell, itself included, by flood fill.

    Args:
        occupied: Occupancy of the grid.
        row: Row of the first cell.
        col: Column of the first cell.
        reach: Number of coordinates that a move may change: 1 along the axes, 2 diagonally as well.
    """
    rows, cols = occupied.shape
    closed = occupied.copy()
    waiting = np.empty(occupied.size, np.int32)  # untouched pages take no memory
    waiting[0] = row * cols + col
    closed[row, col] = True
    count, left = 1, 1
    while left > 0:
        left -= 1
        row, col = waiting[left] // cols, waiting[left] % cols
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(col - 1, 0), min(col + 2, cols)):
                if abs(r - row) + abs(c - col) <= reach and not closed[r, c]:
                    closed[r, c] = True
                    waiting[left] = r * cols + c
                    count, left = count + 1, left + 1
    return count
