"""Corridors: overlapping boxes without obstacles, along a way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import NoPathFound
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference.course import turned_into_body
from omnidrive.reference.spline_basis import bezier_basis

_SAMPLES_PER_CELL = 4
_MAX_SAMPLES = 1_000_000

_PER_BOX = 1.5
"""Pieces for every box, before short boxes are given three."""

_INSET = 2e-3
"""Share of a cell by which Bezier points are kept off a box's sides: as far as the two proved
bounds on a path's clearance may be apart, so that the lower is not negative."""

_ROUNDING = 1e-7
"""Share of a cell that Bezier points on a side may be outside: they were turned there and back."""


@dataclass(frozen=True, eq=False, slots=True)
class Corridor:
    """Boxes of free cells, each overlapping the next, in the frame of the grid.

    Attributes:
        frame: The grid's origin and heading in W; m, m, rad.
        resolution: Side of a cell, in m.
        boxes: left, right, bottom and top of each, in m along the grid's axes from its origin.
        ends: Distance along the way at which each box gives over to the next, in m; the last is
            the way's length.
    """

    frame: Pose
    resolution: float
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
        sides = np.array(boxes)[:, [2, 3, 0, 1]] * free.resolution
        return cls(Pose(*free.origin, free.yaw), free.resolution, sides, np.array(ends))

    def pieces(self, count: int) -> Int[Array, " pieces"]:
        """The box of every piece of a spline of about ``count`` pieces, spread evenly over the way.

        Or of about one and a half for every box, if that is more. At least three in every box: then
        no control point belongs to more than two boxes.
        """
        count = max(count, round(_PER_BOX * len(self.boxes)))
        portions = np.diff(self.ends, prepend=0.0) / max(float(self.ends[-1]), 1e-9)
        counts = np.maximum(3, np.ceil(portions * count)).astype(int)
        return np.repeat(np.arange(len(counts)), counts)

    def from_world(self, poses: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """Poses in W written in the grid's frame; m, m, rad."""
        return turned_into_body(poses - np.array(self.frame), self.frame.yaw)

    def to_world(self, poses: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """The inverse of :meth:`from_world`."""
        turned = turned_into_body(poses, -self.frame.yaw)
        world: Float[Array, "n 3"] = turned + np.array(self.frame)
        return world

    def contains(
        self, control_points: Float[Array, "points 3"], pieces: Int[Array, " pieces"]
    ) -> bool:
        """Whether each piece of a cubic B-spline in W has its four Bezier points in one box.

        Then the whole piece lies in it: it stays in their convex hull. ``pieces`` says in which.
        A ten-millionth of a cell counts as rounding.
        """
        low, high = np.hsplit(self._sides(pieces, -_ROUNDING), 2)
        xy = bezier_basis(len(control_points)) @ self.from_world(control_points)[:, :2]
        return bool(((low <= xy) & (xy <= high)).all())

    def hull(self, pieces: Int[Array, " pieces"]) -> Float[Array, "bezier 4"]:
        """Least x and y, then greatest, of the Bezier points of all pieces, in the grid's frame.

        Where two pieces meet, their point has to lie in the boxes of both. All are a
        five-hundredth of a cell inside.
        """
        return self._sides(pieces, _INSET)

    def bounds(
        self, pieces: Int[Array, " pieces"]
    ) -> tuple[Float[Array, "points 2"], Float[Array, "points 2"]]:
        """Least and greatest x and y of control points with which :meth:`hull` is surely kept.

        Control point i shapes pieces i - 3 to i, and lies in the boxes of all of them.
        """
        boxes, inset = self.boxes[pieces], _INSET * self.resolution
        low, high = np.full((len(pieces) + 3, 2), -np.inf), np.full((len(pieces) + 3, 2), np.inf)
        for k in range(4):
            part = slice(k, k + len(pieces))
            low[part] = np.maximum(low[part], boxes[:, [0, 2]])
            high[part] = np.minimum(high[part], boxes[:, [1, 3]])
        return low + inset, high - inset

    def _sides(self, pieces: Int[Array, " pieces"], inset: float) -> Float[Array, "bezier 4"]:
        """Bounds of Bezier points, ``inset`` of a cell within the boxes."""
        boxes = self.boxes[pieces][:, [0, 2, 1, 3]]
        sides = np.vstack([np.repeat(boxes, 3, axis=0), boxes[-1:]])
        shared = sides[3:-1:3]  # a view: the points where pieces meet
        shared[:, :2] = np.maximum(boxes[:-1, :2], boxes[1:, :2])
        shared[:, 2:] = np.minimum(boxes[:-1, 2:], boxes[1:, 2:])
        room = inset * self.resolution
        within: Float[Array, "bezier 4"] = sides + np.array([room, room, -room, -room])
        return within


def _sampled(
    points: Float[Array, "points 2"], free: OccupancyGrid
) -> tuple[Float[Array, " samples"], Int[Array, "samples 2"]]:
    """Distances along the polyline, in m, and the cells there; a quarter of a cell apart."""
    distance = cumulative_length(points)
    count = 2 + int(_SAMPLES_PER_CELL * distance[-1] / free.resolution)
    if count > _MAX_SAMPLES:
        raise NoPathFound(f"the way is {distance[-1]:.0f} m long, too long to build a corridor")
    at = np.linspace(0.0, distance[-1], count)
    xy = np.stack([np.interp(at, distance, column) for column in points.T], axis=1)
    return at, free.cells_of(xy)


def _inside(cells: Int[Array, "n 2"], box: tuple[int, int, int, int]) -> Bool[Array, " n"]:
    first, last, left, right = box
    row, col = cells.T
    inside: Bool[Array, " n"] = (first <= row) & (row < last) & (left <= col) & (col < right)
    return inside


@compiled
def _grown(
    occupied: Bool[Array, "rows cols"], low: Int[Array, " 2"], high: Int[Array, " 2"]
) -> tuple[int, int, int, int]:
    """Rows [first, last) and columns [left, right); nothing if the seed is not free."""
    rows, cols = occupied.shape
    first, left, last, right = low[0], low[1], high[0], high[1]
    if first < 0 or left < 0 or last > rows or right > cols:
        return 0, 0, 0, 0
    if occupied[first:last, left:right].any():
        return 0, 0, 0, 0
    grows = True
    while grows:
        grows = False
        if first > 0 and not occupied[first - 1, left:right].any():
            first, grows = first - 1, True
        if left > 0 and not occupied[first:last, left - 1].any():
            left, grows = left - 1, True
        if last < rows and not occupied[last, left:right].any():
            last, grows = last + 1, True
        if right < cols and not occupied[first:last, right].any():
            right, grows = right + 1, True
    return first, last, left, right
