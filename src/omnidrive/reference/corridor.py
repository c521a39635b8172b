"""Corridors: overlapping boxes without obstacles, along a way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.compiled import compiled
from omnidrive.errors import NoPathFound
from omnidrive.maps import OccupancyGrid

Array = np.ndarray

_SAMPLES_PER_CELL = 4
_MAX_SAMPLES = 1_000_000


@dataclass(frozen=True, eq=False, slots=True)
class Corridor:
    """Boxes of free cells, each overlapping the next.

    Attributes:
        boxes: left, right, bottom and top of each, in m of W; sides run along W's axes.
        ends: Distance along the way at which each box gives over to the next, in m; the last is
            the way's length.
    """

    boxes: Float[Array, "boxes 4"]
    ends: Float[Array, " boxes"]

    @classmethod
    def along(cls, points: Float[Array, "points 2"], free: OccupancyGrid) -> Corridor:
        """Boxes of cells of ``free`` around the polyline through ``points`` (m, in W).

        A box starts as the cells in which the way leaves the one before, and grows by a row or
        column on each side in turn until obstacles stop it on all.

        Raises:
            NoPathFound: The way passes an occupied cell, or slips between two that touch.
        """
        at, cells = _sampled(points, free)
        boxes: list[tuple[int, int, int, int]] = []
        ends: list[float] = []
        start = 0
        while start < len(cells):
            seed = cells[max(start - 1, 0) : start + 1]
            box = _grown(free.occupied, seed.min(axis=0), seed.max(axis=0) + 1)
            if box[0] >= box[1]:
                x, y = free.centre(*cells[start].tolist())
                raise NoPathFound(f"the way is not free at ({x:.2f}, {y:.2f}) m")
            outside = ~_inside(cells[start:], box)
            start = start + int(np.argmax(outside)) if outside.any() else len(cells)
            boxes.append(box)
            ends.append(float(at[min(start, len(at) - 1)]))
        return cls(_metres(np.array(boxes), free), np.array(ends))

    def pieces(self, count: int) -> Int[Array, " pieces"]:
        """The box of every piece of a spline of about ``count`` pieces, spread evenly over the way.

        At least three in every box: then no control point belongs to more than two boxes.
        """
        portions = np.diff(self.ends, prepend=0.0) / max(float(self.ends[-1]), 1e-9)
        counts = np.maximum(3, np.ceil(portions * count)).astype(int)
        return np.repeat(np.arange(len(counts)), counts)

    def contains(
        self, control_points: Float[Array, "points 3"], pieces: Int[Array, " pieces"]
    ) -> bool:
        """Whether each piece of a cubic B-spline has its four control points in one box.

        Then the whole piece lies in it: it stays in their convex hull. ``pieces`` says in which.
        """
        low, high = self.bounds(pieces)
        xy = control_points[:, :2]
        return bool(((low <= xy) & (xy <= high)).all())

    def bounds(
        self, pieces: Int[Array, " pieces"]
    ) -> tuple[Float[Array, "points 2"], Float[Array, "points 2"]]:
        """Least and greatest x and y of control points, for the box of each piece of a spline.

        Control point i shapes pieces i - 3 to i, and has to lie in the boxes of all of them.
        """
        points = len(pieces) + 3
        low, high = np.full((points, 2), -np.inf), np.full((points, 2), np.inf)
        for k in range(4):
            part = slice(k, k + len(pieces))
            low[part] = np.maximum(low[part], self.boxes[pieces][:, [0, 2]])
            high[part] = np.minimum(high[part], self.boxes[pieces][:, [1, 3]])
        return low, high


def _sampled(
    points: Float[Array, "points 2"], free: OccupancyGrid
) -> tuple[Float[Array, " samples"], Int[Array, "samples 2"]]:
    """Distances along the polyline, in m, and the cells there; a quarter of a cell apart."""
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    count = 2 + int(_SAMPLES_PER_CELL * travelled[-1] / free.resolution)
    if count > _MAX_SAMPLES:
        raise NoPathFound(f"the way is {travelled[-1]:.0f} m long, too long to build a corridor")
    at = np.linspace(0.0, travelled[-1], count)
    xy = np.stack([np.interp(at, travelled, column) for column in points.T], axis=1)
    cells = np.floor((xy - free.origin) / free.resolution).astype(np.int64)[:, ::-1]
    return at, np.ascontiguousarray(cells)


def _inside(cells: Int[Array, "n 2"], box: tuple[int, int, int, int]) -> Bool[Array, " n"]:
    top, bottom, left, right = box
    row, col = cells.T
    inside: Bool[Array, " n"] = (top <= row) & (row < bottom) & (left <= col) & (col < right)
    return inside


def _metres(boxes: Int[Array, "boxes 4"], free: OccupancyGrid) -> Float[Array, "boxes 4"]:
    """Boxes of cells as boxes in W, a millionth of a cell smaller: rounding stays inside."""
    rows, cols = boxes[:, :2], boxes[:, 2:]
    x, y = free.origin
    sides = np.hstack([x + cols * free.resolution, y + rows * free.resolution])
    return sides + 1e-6 * free.resolution * np.array([1.0, -1.0, 1.0, -1.0])


@compiled
def _grown(
    occupied: Bool[Array, "rows cols"], first: Int[Array, " 2"], last: Int[Array, " 2"]
) -> tuple[int, int, int, int]:
    """Rows and columns [top, bottom) and [left, right); nothing if the seed is not free."""
    rows, cols = occupied.shape
    top, left, bottom, right = first[0], first[1], last[0], last[1]
    if top < 0 or left < 0 or bottom > rows or right > cols:
        return 0, 0, 0, 0
    if occupied[top:bottom, left:right].any():
        return 0, 0, 0, 0
    grows = True
    while grows:
        grows = False
        if top > 0 and not occupied[top - 1, left:right].any():
            top, grows = top - 1, True
        if left > 0 and not occupied[top:bottom, left - 1].any():
            left, grows = left - 1, True
        if bottom < rows and not occupied[bottom, left:right].any():
            bottom, grows = bottom + 1, True
        if right < cols and not occupied[top:bottom, right].any():
            right, grows = right + 1, True
    return top, bottom, left, right
