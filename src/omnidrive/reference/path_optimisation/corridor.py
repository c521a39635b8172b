"""Corridors of overlapping obstacle-free boxes along a path."""

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
from omnidrive.reference.path_optimisation.spline_basis import bezier_basis
from omnidrive.reference.timing.piecewise_path import rotate_into_body

_SAMPLES_PER_CELL = 4
_MAX_SAMPLES = 1_000_000

_PER_BOX = 1.5
"""Mean number of spline pieces per box, before short boxes receive three."""

_INSET = 2e-3
"""Distance of Bezier points from the sides of a box, as a share of a cell. It is the largest
difference of the two proved bounds of a path's clearance, so that the lower bound is not
negative."""

_ROUNDING = 1e-7
"""Distance outside a box that counts as rounding (of two rotations), as a share of a cell."""


@dataclass(frozen=True, eq=False, slots=True)
class Corridor:
    """Boxes of free cells along a path, each overlapping the next, in the frame of the grid.

    Attributes:
        frame: Origin and heading of the grid in W, in m, m and rad.
        resolution: Side of a cell, in m.
        boxes: Left, right, bottom and top of each box, in m along the axes of the grid from its
            origin.
        box_ends: Distance along the path at which each box ends and the next begins, in m; the last
            value is the length of the path.
    """

    frame: Pose
    resolution: float
    boxes: Float[Array, "boxes 4"]
    box_ends: Float[Array, " boxes"]

    @classmethod
    def along(cls, points: Float[Array, "points 2"], free_space: OccupancyGrid) -> Corridor:
        """Build the corridor around the polyline through ``points`` (m, in W).

        A box starts as the cells in which the polyline leaves the previous box. It grows by a row
        or column on each side in turn until occupied cells stop it on all sides.

        Raises:
            NoPathFound: The polyline passes an occupied cell, or passes diagonally between two.
        """
        at, cells = _sample_cells(points, free_space)
        boxes: list[tuple[int, int, int, int]] = []
        ends: list[float] = []
        start = 0
        while start < len(cells):
            seed = cells[max(start - 1, 0) : start + 1]
            box = _grow_box(free_space.occupied, seed.min(axis=0), seed.max(axis=0) + 1)
            if box[0] >= box[1]:
                x, y = free_space.centre(*cells[start].tolist())
                raise NoPathFound(f"the path is not free at ({x:.2f}, {y:.2f}) m")
            outside = ~_inside(cells[start:], box)
            start = start + int(np.argmax(outside)) if outside.any() else len(cells)
            boxes.append(box)
            ends.append(float(at[min(start, len(at) - 1)]))
        sides = np.array(boxes)[:, [2, 3, 0, 1]] * free_space.resolution
        return cls(
            Pose(*free_space.origin, free_space.yaw), free_space.resolution, sides, np.array(ends)
        )

    def pieces(self, count: int) -> Int[Array, " pieces"]:
        """Return the box index of each piece of a spline, with the pieces spread evenly.

        The number of pieces is about ``count``, or one and a half per box if that is more. Each box
        has at least three, so that no control point belongs to more than two boxes.
        """
        count = max(count, round(_PER_BOX * len(self.boxes)))
        portions = np.diff(self.box_ends, prepend=0.0) / max(float(self.box_ends[-1]), 1e-9)
        counts = np.maximum(3, np.ceil(portions * count)).astype(int)
        return np.repeat(np.arange(len(counts)), counts)

    def from_world(self, poses: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """Transform poses from W to the frame of the grid; m, m, rad."""
        return rotate_into_body(poses - np.array(self.frame), self.frame.yaw)

    def to_world(self, poses: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """Transform poses from the frame of the grid to W; m, m, rad."""
        turned = rotate_into_body(poses, -self.frame.yaw)
        world: Float[Array, "n 3"] = turned + np.array(self.frame)
        return world

    def contains(
        self, control_points: Float[Array, "points 3"], pieces: Int[Array, " pieces"]
    ) -> bool:
        """Return whether each piece of a cubic B-spline in W has its four Bezier points in its box.

        If so, the whole piece is in the box, which contains the convex hull of its Bezier points.
        A distance of 1e-7 cells counts as rounding.

        Args:
            control_points: Control points in W.
            pieces: Box index of each piece.
        """
        low, high = np.hsplit(self._sides(pieces, -_ROUNDING), 2)
        xy = bezier_basis(len(control_points)) @ self.from_world(control_points)[:, :2]
        return bool(((low <= xy) & (xy <= high)).all())

    def bezier_bounds(self, pieces: Int[Array, " pieces"]) -> Float[Array, "bezier 4"]:
        """Return the lower, then the upper bounds of x and y of all Bezier points, in the grid.

        The common point of two pieces is bounded by both boxes. The bounds are 0.002 cells inside
        the boxes.
        """
        return self._sides(pieces, _INSET)

    def control_point_bounds(
        self, pieces: Int[Array, " pieces"]
    ) -> tuple[Float[Array, "points 2"], Float[Array, "points 2"]]:
        """Return bounds of x and y of the control points that imply :meth:`bezier_bounds`.

        Control point i affects pieces i - 3 to i, and is bounded by the boxes of all of them.
        """
        boxes, inset = self.boxes[pieces], _INSET * self.resolution
        low, high = np.full((len(pieces) + 3, 2), -np.inf), np.full((len(pieces) + 3, 2), np.inf)
        for k in range(4):
            part = slice(k, k + len(pieces))
            low[part] = np.maximum(low[part], boxes[:, [0, 2]])
            high[part] = np.minimum(high[part], boxes[:, [1, 3]])
        return low + inset, high - inset

    def _sides(self, pieces: Int[Array, " pieces"], inset: float) -> Float[Array, "bezier 4"]:
        """Return the bounds of Bezier points, ``inset`` cells inside the boxes."""
        boxes = self.boxes[pieces][:, [0, 2, 1, 3]]
        sides = np.vstack([np.repeat(boxes, 3, axis=0), boxes[-1:]])
        shared = sides[3:-1:3]  # a view: the points where pieces meet
        shared[:, :2] = np.maximum(boxes[:-1, :2], boxes[1:, :2])
        shared[:, 2:] = np.minimum(boxes[:-1, 2:], boxes[1:, 2:])
        margin = inset * self.resolution
        within: Float[Array, "bezier 4"] = sides + np.array([margin, margin, -margin, -margin])
        return within


def _sample_cells(
    points: Float[Array, "points 2"], free_space: OccupancyGrid
) -> tuple[Float[Array, " samples"], Int[Array, "samples 2"]]:
    """Return distances along the polyline, in m, a quarter of a cell apart, and the cells there."""
    distance = cumulative_length(points)
    count = 2 + int(_SAMPLES_PER_CELL * distance[-1] / free_space.resolution)
    if count > _MAX_SAMPLES:
        raise NoPathFound(f"the path is {distance[-1]:.0f} m long, too long for a corridor")
    at = np.linspace(0.0, distance[-1], count)
    xy = np.stack([np.interp(at, distance, column) for column in points.T], axis=1)
    return at, free_space.cells_of(xy)


def _inside(cells: Int[Array, "n 2"], box: tuple[int, int, int, int]) -> Bool[Array, " n"]:
    first, last, left, right = box
    row, col = cells.T
    inside: Bool[Array, " n"] = (first <= row) & (row < last) & (left <= col) & (col < right)
    return inside


@compiled
def _grow_box(
    occupied: Bool[Array, "rows cols"], low: Int[Array, " 2"], high: Int[Array, " 2"]
) -> tuple[int, int, int, int]:
    """Grow a box; return rows [first, last) and columns [left, right), or zeros if not free."""
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
