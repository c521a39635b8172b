"""Boxes that cover the occupied cells of a map, and a search for the nearest ones."""

from __future__ import annotations

from math import cos, hypot, inf, sin
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.maps import OccupancyGrid

T = TypeVar("T", float, np.ndarray)

_SEARCH_DISTANCE = 0.5  # m; distance from the last search at which the next is done
_SEARCH_MARGIN = 0.3  # m; increase of the search radius without a new search


class ObstacleBoxes:
    """Boxes that cover the occupied cells of a map, in the map's frame.

    The frame has the grid's origin and yaw. A walled grid is surrounded by boxes of infinite size;
    otherwise the robot can leave the map. Unknown cells are occupied or free as the reader of the
    map has decided.

    Attributes:
        boxes: (left, right, bottom, top) of each box, m; they do not overlap.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        """Merge the occupied cells of ``grid`` into few boxes."""
        self._grid = grid
        rows, cols = grid.occupied.shape
        left, right, bottom, top = merge_cells(grid.occupied).T * grid.resolution
        self.boxes: Float[Array, "boxes 4"] = np.column_stack([left, right, bottom, top])
        if grid.walled:
            width, height = cols * grid.resolution, rows * grid.resolution
            around = [(-inf, 0.0, -inf, inf), (width, inf, -inf, inf)]
            around += [(0.0, width, -inf, 0.0), (0.0, width, height, inf)]
            self.boxes = np.vstack([self.boxes, around])
        self._searched: tuple[float, float, float] = (inf, inf, 0.0)
        self._near, self._min_distance = self.boxes[:0], inf

    @property
    def frame(self) -> tuple[tuple[float, float], float]:
        """Origin and yaw of the map's frame in W: ((m, m), rad)."""
        return self._grid.origin, self._grid.yaw

    def to_map_frame(self, x: T, y: T) -> tuple[T, T]:
        """Transform points from W to the map's frame, m."""
        dx, dy = x - self._grid.origin[0], y - self._grid.origin[1]
        c, s = cos(self._grid.yaw), sin(self._grid.yaw)
        return c * dx + s * dy, c * dy - s * dx

    def nearest(self, x: float, y: float, reach: float, limit: int) -> Float[Array, "near 4"]:
        """Return at most ``limit`` boxes within ``reach`` (m) of a point of W, nearest first.

        Each box is clipped to ``reach`` along both axes of the map.
        """
        u, v = self.to_map_frame(x, y)
        last_u, last_v, last_reach = self._searched
        moved = hypot(u - last_u, v - last_v)
        if not (moved <= _SEARCH_DISTANCE and reach <= last_reach):
            gaps = box_distances(self.boxes, u, v)
            self._near = self.boxes[gaps <= reach + _SEARCH_MARGIN + _SEARCH_DISTANCE]
            self._min_distance = float(gaps.min(initial=inf))
            self._searched, moved = (u, v, reach + _SEARCH_MARGIN), 0.0
        if moved + reach < self._min_distance:
            return self.boxes[:0]
        gaps = box_distances(self._near, u, v)
        order = np.argsort(gaps, kind="stable")[:limit]
        chosen = self._near[order[gaps[order] <= reach]]
        window = np.array([u, u, v, v])
        clipped: Float[Array, "near 4"] = np.clip(chosen, window - reach, window + reach)
        return clipped


def merge_cells(occupied: Bool[Array, "rows cols"]) -> Int[Array, "boxes 4"]:
    """Return rectangles (first column, end column, first row, end row); ends are exclusive.

    Runs of occupied cells in a row are merged with equal runs in the following rows.
    """
    edges = np.diff(np.pad(occupied.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, start = np.nonzero(edges == 1)
    end = np.nonzero(edges == -1)[1]
    order = np.lexsort((row, end, start))
    row, start, end = row[order], start[order], end[order]
    merged = (np.diff(row) == 1) & (np.diff(start) == 0) & (np.diff(end) == 0)
    first = np.flatnonzero(np.concatenate([[True], ~merged])[: len(row)])
    last = np.append(first[1:], len(row))[: len(first)] - 1
    return np.column_stack([start[first], end[first], row[first], row[last] + 1])


def box_distances(
    boxes: Float[Array, "#points 4"],
    u: float | Float[Array, " points"],
    v: float | Float[Array, " points"],
) -> Float[Array, " points"]:
    """Return distances from a point to boxes or from points to a box, m; 0 inside."""
    left, right, bottom, top = boxes.T
    across = np.maximum(np.maximum(left - u, u - right), 0.0)
    along = np.maximum(np.maximum(bottom - v, v - top), 0.0)
    gaps: Float[Array, " points"] = np.hypot(across, along)
    return gaps
