"""Squares of a grid that convex hulls of a few points cover; all lengths are in cells.

Square (i, j) is centred at x = j, y = i. A hull covers a square if it reaches more than 1e-9 into
it, so contact alone does not count.
"""

from __future__ import annotations

from math import ceil, floor, inf

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled

HALF = 0.5 - 1e-9
"""Half the side of a square, less the depth of a mere contact."""


@compiled
def band_span(points: Float[Array, "points 2"], low: float, high: float) -> tuple[float, float]:
    """Return the least and greatest x of the hull of points within low <= y <= high.

    The ends of this interval are points, or lie where a line between two points enters or leaves
    the band. Returns (inf, -inf) if the hull does not reach into the band.
    """
    left, right = inf, -inf
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        if low <= y <= high:
            left, right = min(left, x), max(right, x)
        for j in range(i):
            dx, dy = points[j, 0] - x, points[j, 1] - y
            if (y < low) != (y + dy < low):
                at = x + (low - y) / dy * dx
                left, right = min(left, at), max(right, at)
            if (y > high) != (y + dy > high):
                at = x + (high - y) / dy * dx
                left, right = min(left, at), max(right, at)
    return left, right


@compiled
def mark_hulls(hulls: Float[Array, "hulls points 2"], covered: Bool[Array, "height width"]) -> None:
    """Mark the squares that the hulls cover; the square at the origin is the middle of ``covered``.

    Squares beyond the border of ``covered`` are marked on the border.
    """
    rows, cols = covered.shape[0] // 2, covered.shape[1] // 2
    for k in range(len(hulls)):
        points = hulls[k]
        lowest, highest = points[:, 1].min(), points[:, 1].max()
        bottom = int(min(max(ceil(lowest - HALF), -rows), rows))
        top = int(min(max(floor(highest + HALF), -rows), rows))
        for row in range(bottom, top + 1):
            low = lowest if row == -rows else row - HALF
            high = highest if row == rows else row + HALF
            left, right = band_span(points, low, high)
            if left <= right:
                first = int(min(max(ceil(left - HALF), -cols), cols))
                last = int(min(max(floor(right + HALF), -cols), cols))
                covered[row + rows, first + cols : last + cols + 1] = True


@compiled
def runs_of(covered: Bool[Array, "height width"]) -> Int[Array, "runs 3"]:
    """Return row, first and last column of each run of marked squares, relative to the middle."""
    rows, cols = covered.shape[0] // 2, covered.shape[1] // 2
    runs = np.empty((covered.size // 2 + covered.shape[0], 3), np.int64)
    count = 0
    for row in range(covered.shape[0]):
        for col in range(covered.shape[1]):
            if not covered[row, col]:
                continue
            if col > 0 and covered[row, col - 1]:
                runs[count - 1, 2] = col - cols
            else:
                runs[count, 0], runs[count, 1], runs[count, 2] = row - rows, col - cols, col - cols
                count += 1
    return runs[:count].copy()
