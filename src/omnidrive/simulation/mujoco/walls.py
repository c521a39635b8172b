"""The obstacles of a map as boxes, and those of them that are near the robot."""

from __future__ import annotations

from math import cos, hypot, inf, sin
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.maps import OccupancyGrid

T = TypeVar("T", float, np.ndarray)

_SLACK = 0.5  # m that the robot moves before boxes are looked up again
_SPARE = 0.3  # m by which its reach may grow before


class Walls:
    """Boxes that cover the occupied cells of a map, in the map's own frame.

    That frame lies at the grid's origin, turned by its yaw. Where the grid is walled there are
    boxes around it, without an end; else the robot may leave the map. Cells of which the map does
    not know what they are, are what it was read as having there.

    Attributes:
        boxes: (left, right, bottom, top) of each, in m; they do not overlap.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        """Merge the cells of ``grid`` into few boxes."""
        self._grid = grid
        rows, cols = grid.occupied.shape
        left, right, bottom, top = boxes_of(grid.occupied).T * grid.resolution
        self.boxes: Float[Array, "boxes 4"] = np.column_stack([left, right, bottom, top])
        if grid.walled:
            width, height = cols * grid.resolution, rows * grid.resolution
            around = [(-inf, 0.0, -inf, inf), (width, inf, -inf, inf)]
            around += [(0.0, width, -inf, 0.0), (0.0, width, height, inf)]
            self.boxes = np.vstack([self.boxes, around])
        self._looked_up: tuple[float, float, float] = (inf, inf, 0.0)
        self._near, self._nearest = self.boxes[:0], inf

    @property
    def frame(self) -> tuple[tuple[float, float], float]:
        """Where the map's frame lies in W, and by how much it is turned: ((m, m), rad)."""
        return self._grid.origin, self._grid.yaw

    def in_map(self, x: T, y: T) -> tuple[T, T]:
        """A point of W, or many, in the map's frame, in m."""
        dx, dy = x - self._grid.origin[0], y - self._grid.origin[1]
        c, s = cos(self._grid.yaw), sin(self._grid.yaw)
        return c * dx + s * dy, c * dy - s * dx

    def near(self, x: float, y: float, reach: float, most: int) -> Float[Array, "near 4"]:
        """The ``most`` nearest boxes of those within ``reach`` m of a point of W, nearest first.

        Of each box what lies within ``reach`` along the map's axes.
        """
        u, v = self.in_map(x, y)
        looked_at_u, looked_at_v, had = self._looked_up
        moved = hypot(u - looked_at_u, v - looked_at_v)
        if not (moved <= _SLACK and reach <= had):
            gaps = distances(self.boxes, u, v)
            self._near = self.boxes[gaps <= reach + _SPARE + _SLACK]
            self._nearest = float(gaps.min(initial=inf))
            self._looked_up, moved = (u, v, reach + _SPARE), 0.0
        if moved + reach < self._nearest:
            return self.boxes[:0]
        gaps = distances(self._near, u, v)
        order = np.argsort(gaps, kind="stable")[:most]
        chosen = self._near[order[gaps[order] <= reach]]
        window = np.array([u, u, v, v])
        clipped: Float[Array, "near 4"] = np.clip(chosen, window - reach, window + reach)
        return clipped


def boxes_of(occupied: Bool[Array, "rows cols"]) -> Int[Array, "boxes 4"]:
    """Rectangles (first column, column after the last, first row, row after the last).

    Runs of taken cells in a row, joined with equal runs in the rows after it.
    """
    edges = np.diff(np.pad(occupied.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, begin = np.nonzero(edges == 1)
    end = np.nonzero(edges == -1)[1]
    order = np.lexsort((row, end, begin))
    row, begin, end = row[order], begin[order], end[order]
    joined = (np.diff(row) == 1) & (np.diff(begin) == 0) & (np.diff(end) == 0)
    first = np.flatnonzero(np.concatenate([[True], ~joined])[: len(row)])
    last = np.append(first[1:], len(row))[: len(first)] - 1
    return np.column_stack([begin[first], end[first], row[first], row[last] + 1])


def distances(
    boxes: Float[Array, "#points 4"],
    u: float | Float[Array, " points"],
    v: float | Float[Array, " points"],
) -> Float[Array, " points"]:
    """From a point to boxes, or from points to a box, all in one frame, in m; 0 inside."""
    left, right, bottom, top = boxes.T
    across = np.maximum(np.maximum(left - u, u - right), 0.0)
    along = np.maximum(np.maximum(bottom - v, v - top), 0.0)
    gaps: Float[Array, " points"] = np.hypot(across, along)
    return gaps
