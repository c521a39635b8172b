"""Least distance of a polygon at given poses to the occupied cells of a grid."""

from __future__ import annotations

from math import ceil, cos, floor, hypot, inf, sin

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.grid_frame import GridFrame

_HALF_DIAGONAL = 0.5**0.5
_TOUCH = 1e-9  # cells; a smaller overlap is a mere contact


def pose_distance(grid: OccupancyGrid, polygon: Polygon, poses: Float[Array, "poses 3"]) -> float:
    """Return the least distance in m from a polygon at poses (W; m, m, rad) to occupied cells.

    The polygon is the union of its triangles. The distance of disjoint convex polygons is that of a
    corner of one to the other. Where a triangle and a cell overlap, the result is negative: minus
    the least translation that separates them (separating axis theorem). Poses and cells are left
    out that a bound by the circle about the origin of B excludes. Infinite if no cell is occupied.
    """
    poses = poses[np.isfinite(poses).all(axis=1)]
    if len(poses) == 0:
        return inf
    frame = GridFrame.of(grid)
    bounds = grid.clearance(poses[:, :2]) / frame.resolution
    near = np.argsort(bounds)
    least = float(bounds[near[0]])
    if least == inf:
        return inf
    cells = np.column_stack([frame.cells(poses[near, :2]), poses[near, 2] - grid.yaw])
    found = _least_distance(
        np.ascontiguousarray(grid.occupied),
        grid.walled,
        np.ascontiguousarray(polygon.triangles / frame.resolution),
        polygon.radius / frame.resolution,
        np.ascontiguousarray(cells),
        bounds[near],
    )
    return float(found) * frame.resolution


@compiled
def _least_distance(  # noqa: PLR0917
    occupied: Bool[Array, "rows cols"],
    walled: bool,
    triangles: Float[Array, "triangles 3 2"],
    radius: float,
    poses: Float[Array, "poses 3"],
    bounds: Float[Array, " poses"],
) -> float:
    """Return the least distance in cells; ``bounds``: ascending distances of the poses' origins."""
    least = max(bounds[0], 0.0) + radius  # a point of the polygon is within the radius
    turned = np.empty_like(triangles)
    rows, cols = occupied.shape
    for k in range(len(poses)):
        if bounds[k] - radius >= least:
            break
        x, y = poses[k, 0], poses[k, 1]
        along, across = cos(poses[k, 2]), sin(poses[k, 2])
        for t in range(len(triangles)):
            for i in range(3):
                u, v = triangles[t, i, 0], triangles[t, i, 1]
                turned[t, i, 0] = x + along * u - across * v
                turned[t, i, 1] = y + across * u + along * v
                if walled:
                    px, py = turned[t, i, 0], turned[t, i, 1]
                    least = min(least, px, py, cols - px, rows - py)
        reach = radius + max(least, 0.0)
        low, high = max(floor(y - reach), 0), min(ceil(y + reach), rows)
        left, right = max(floor(x - reach), 0), min(ceil(x + reach), cols)
        for row in range(low, high):
            for col in range(left, right):
                if not occupied[row, col]:
                    continue
                apart = hypot(col + 0.5 - x, row + 0.5 - y) - _HALF_DIAGONAL - radius
                if apart < least:
                    for t in range(len(turned)):
                        least = min(least, _distance(turned[t], col, row, least))
    found: float = least
    return found


@inlined
def _distance(triangle: Float[Array, "3 2"], col: int, row: int, least: float) -> float:
    """Return the signed distance of triangle and cell, or a bound on it that is >= ``least``."""
    gap: float = _separation(triangle, col, row)
    if gap >= least or gap < -_TOUCH:
        return gap
    if gap <= 0.0:
        return 0.0
    nearest: float = inf
    for i in range(3):
        x, y = triangle[i, 0], triangle[i, 1]
        dx, dy = triangle[i - 2, 0] - x, triangle[i - 2, 1] - y
        across, along = max(col - x, x - col - 1.0, 0.0), max(row - y, y - row - 1.0, 0.0)
        nearest = min(nearest, hypot(across, along))
        for corner in range(4):
            u, v = col + (corner & 1) - x, row + (corner >> 1) - y
            share = min(max((u * dx + v * dy) / (dx * dx + dy * dy), 0.0), 1.0)
            nearest = min(nearest, hypot(u - share * dx, v - share * dy))
    return nearest


@inlined
def _separation(triangle: Float[Array, "3 2"], col: int, row: int) -> float:
    """Return the greatest gap of triangle and cell along a normal of a side; negative: overlap."""
    gap: float = -inf
    for axis, low in ((0, col), (1, row)):
        a, b, c = triangle[0, axis], triangle[1, axis], triangle[2, axis]
        gap = max(gap, min(a, b, c) - low - 1.0, low - max(a, b, c))
    for i in range(3):  # counter-clockwise: the outward normal is (dy, -dx)
        x, y = triangle[i, 0], triangle[i, 1]
        dx, dy = triangle[i - 2, 0] - x, triangle[i - 2, 1] - y
        centre = (col + 0.5 - x) * dy - (row + 0.5 - y) * dx
        gap = max(gap, (centre - 0.5 * (abs(dx) + abs(dy))) / hypot(dx, dy))
    return gap
