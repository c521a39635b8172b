"""Proofs that a moving polygon keeps a margin from occupied squares; all lengths are in cells.

Over an interval of the parameter, each corner of the polygon stays near the chord of its curve, so
an edge stays near the convex hull of its first and its last position. The edge keeps the margin
from every square if this hull, grown by the margin and the deviation from the chords, does not
reach into it. Both are grown as squares grow with their sides; the distance is at least that.
Intervals on which this is not proved are halved.
"""

from __future__ import annotations

from math import ceil, cos, floor, sin, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int32

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.footprint.raster import HALF, band_span

_STRAIGHT = 1e-10  # as in omnidrive.planning.clearance
_TOUCH = 0.5 - HALF


class Squares(NamedTuple):
    """Occupied squares of a grid.

    Attributes:
        occupied: Occupancy; row i, column j is the square from (j, i) to (j + 1, i + 1).
        sums: Number of occupied squares below row i and left of column j.
        walled: Whether everything outside the grid is occupied.
    """

    occupied: Bool[Array, "rows cols"]
    sums: Int32[Array, "more_rows more_cols"]
    walled: bool

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Squares:
        """Create the squares of a grid."""
        sums = np.zeros([n + 1 for n in grid.occupied.shape], np.int32)
        sums[1:, 1:] = grid.occupied.cumsum(axis=0, dtype=np.int32).cumsum(axis=1)
        return cls(grid.occupied, sums, grid.walled)


class Motion(NamedTuple):
    """Cubic motion of a polygon: x and y in cells, yaw in rad from the rows of the grid.

    Attributes:
        corners: Corners of the polygon in B.
        radius: Distance from the origin of B to the farthest corner.
        poses: Poses at the knots, see :class:`omnidrive.planning.pieces.Pieces`.
        second_derivatives: Second derivatives at the knots.
    """

    corners: Float[Array, "corners 2"]
    radius: float
    poses: Float[Array, "knots 3"]
    second_derivatives: Float[Array, "knots 3"]


@compiled
def reaches_into(squares: Squares, points: Float[Array, "points 2"], growth: float) -> bool:
    """Whether the hull of points reaches into an occupied square grown by ``growth`` on each side.

    By 1e-9 or more; contact alone does not count.
    """
    rows, cols = squares.occupied.shape
    half = HALF + growth
    left, right = points[:, 0].min(), points[:, 0].max()
    below, above = points[:, 1].min(), points[:, 1].max()
    if squares.walled and min(left, below, cols - right, rows - above) < growth - _TOUCH:
        return True
    first, last = _cells(left, right, half, cols)
    low, high = _cells(below, above, half, rows)
    if _count(squares.sums, low, high, first, last) == 0:
        return False
    for row in range(low, high + 1):
        if _count(squares.sums, row, row, first, last) == 0:
            continue
        left, right = band_span(points, row + 0.5 - half, row + 0.5 + half)
        if left <= right:
            begin, end = _cells(left, right, half, cols)
            if _count(squares.sums, row, row, begin, end) > 0:
                return True
    return False


@inlined
def _cells(low: float, high: float, half: float, count: int) -> tuple[int, int]:
    """Return the first and last of ``count`` squares that an interval reaches into."""
    first = ceil(min(max(low - 0.5 - half, -1.0), count + 0.0))
    last = floor(min(max(high - 0.5 + half, -1.0), count + 0.0))
    return max(first, 0), min(last, count - 1)


@inlined
def _count(sums: Int32[Array, "rows cols"], low: int, high: int, first: int, last: int) -> int:
    """Return the number of occupied squares in rows low to high and columns first to last."""
    if low > high or first > last:
        return 0
    above, below = sums[high + 1], sums[low]
    count: int = above[last + 1] - above[first] - below[last + 1] + below[first]
    return count


@compiled
def _place(motion: Motion, j: int, s: float, out: Float[Array, "corners 2"]) -> None:
    """Write the corners of the polygon at s in [0, 1] of piece j into ``out``."""
    p, q = s * (1.0 - s) * (2.0 - s) / 6.0, s * (1.0 - s) * (1.0 + s) / 6.0
    first, last = motion.poses[j], motion.poses[j + 1]
    bend, end = motion.second_derivatives[j], motion.second_derivatives[j + 1]
    x = (1.0 - s) * first[0] + s * last[0] - p * bend[0] - q * end[0]
    y = (1.0 - s) * first[1] + s * last[1] - p * bend[1] - q * end[1]
    yaw = (1.0 - s) * first[2] + s * last[2] - p * bend[2] - q * end[2]
    along, across = cos(yaw), sin(yaw)
    for i in range(len(out)):
        u, v = motion.corners[i, 0], motion.corners[i, 1]
        out[i, 0], out[i, 1] = x + along * u - across * v, y + across * u + along * v


@inlined
def _is_straight(motion: Motion, j: int) -> bool:
    """Whether piece j is a straight line in (x, y, yaw) that never reverses, at varying speed.

    See the function of this name in :mod:`omnidrive.planning.clearance`.
    """
    square = u = v = size = 0.0
    for i in range(3):
        c = motion.poses[j + 1, i] - motion.poses[j, i]
        square, size = square + c * c, size + abs(c)
        u += c * motion.second_derivatives[j, i] / 6.0
        v += c * motion.second_derivatives[j + 1, i] / 6.0
    for i in range(3):
        c = motion.poses[j + 1, i] - motion.poses[j, i]
        first = motion.second_derivatives[j, i] / 6.0 * square - u * c
        last = motion.second_derivatives[j + 1, i] / 6.0 * square - v * c
        if max(abs(first), abs(last)) > _STRAIGHT * size * square:
            return False
    slowest = square + min(-2.0 * u - v, u - v, u + 2.0 * v)
    return square > 0.0 and slowest >= -_STRAIGHT * square


@compiled
def corner_acceleration(motion: Motion, j: int) -> float:
    """Return a bound on the second derivative of every corner over piece j.

    It is at most |p''| + R (|yaw''| + yaw'^2). The second derivatives are linear, and yaw' lies
    between its Bezier control points. The speed of a straight piece does not matter.
    """
    turn: float = motion.poses[j + 1, 2] - motion.poses[j, 2]
    if _is_straight(motion, j):
        return motion.radius * turn * turn
    first, last = motion.second_derivatives[j], motion.second_derivatives[j + 1]
    linear = sqrt(max(first[0] ** 2 + first[1] ** 2, last[0] ** 2 + last[1] ** 2))
    u, v = first[2] / 6.0, last[2] / 6.0
    rate = max(abs(turn - 2.0 * u - v), abs(turn + u - v), abs(turn + u + 2.0 * v))
    turning: float = motion.radius * (max(abs(first[2]), abs(last[2])) + rate * rate)
    return linear + turning


@compiled
def _interval_is_clear(
    squares: Squares,
    before: Float[Array, "corners 2"],
    after: Float[Array, "corners 2"],
    hull: Float[Array, "4 2"],
    growth: float,
) -> bool:
    """Whether the hulls of the first and last position of every edge are clear of the squares."""
    count = len(before)
    for i in range(count):
        k = i + 1 if i + 1 < count else 0
        for axis in range(2):
            hull[0, axis], hull[1, axis] = before[i, axis], before[k, axis]
            hull[2, axis], hull[3, axis] = after[i, axis], after[k, axis]
        if reaches_into(squares, hull, growth):
            return False
    return True


@compiled
def keeps_margin(squares: Squares, motion: Motion, j: int, margin: float, halvings: int) -> bool:
    """Whether every edge is proved to keep ``margin`` from all occupied squares over piece j."""
    count = len(motion.corners)
    before, after, hull = np.empty((count, 2)), np.empty((count, 2)), np.empty((4, 2))
    straight = _is_straight(motion, j)
    eighth = 0.125 * corner_acceleration(motion, j)
    straight_motion = motion
    if straight:
        straight_motion = Motion(
            motion.corners, motion.radius, motion.poses[j : j + 2], np.zeros((2, 3))
        )
    at = 0 if straight else j
    level, k = 0, 0
    while not (level == 0 and k == 1):
        width = 1.0 / (1 << level)
        _place(straight_motion, at, k * width, before)
        _place(straight_motion, at, (k + 1) * width, after)
        if _interval_is_clear(squares, before, after, hull, margin + eighth * width * width):
            k += 1
            while level > 0 and k % 2 == 0:
                level, k = level - 1, k // 2
        elif level == halvings or not _interval_is_clear(squares, before, before, hull, margin):
            return False
        else:
            level, k = level + 1, 2 * k
    return True


@compiled
def greatest_margin(
    squares: Squares, motion: Motion, limit: float, tolerance: float, halvings: int
) -> float:
    """Return the greatest proved margin of all pieces, at most ``limit``; negative if none is.

    It is found within ``tolerance`` by bisection.
    """
    best = limit
    for j in range(len(motion.poses) - 1):
        if keeps_margin(squares, motion, j, best, halvings):
            continue
        low, high = 0.0, best
        if not keeps_margin(squares, motion, j, 0.0, halvings):
            return -1.0
        while high - low > tolerance:
            middle = 0.5 * (low + high)
            if keeps_margin(squares, motion, j, middle, halvings):
                low = middle
            else:
                high = middle
        best = low
    return best


@compiled
def proved_margins(
    squares: Squares, motion: Motion, margins: Float[Array, " margins"], halvings: int
) -> Float[Array, " pieces"]:
    """Return for each piece the first of the margins that is proved, 0 if none."""
    found = np.zeros(len(motion.poses) - 1)
    for j in range(len(found)):
        for margin in margins:
            if keeps_margin(squares, motion, j, margin, halvings):
                found[j] = margin
                break
    return found


@compiled
def are_steps_free(
    squares: Squares,
    shape: Motion,
    begins: Float[Array, "steps 3"],
    ends: Float[Array, "steps 3"],
    halvings: int,
) -> Bool[Array, " steps"]:
    """Return for each straight motion between two poses, one of them free, whether it is free."""
    found = np.empty(len(begins), np.bool_)
    poses = np.empty((2, 3))
    motion = Motion(shape.corners, shape.radius, poses, np.zeros((2, 3)))
    for i in range(len(found)):
        poses[0], poses[1] = begins[i], ends[i]
        found[i] = keeps_margin(squares, motion, 0, 0.0, halvings)
    return found
