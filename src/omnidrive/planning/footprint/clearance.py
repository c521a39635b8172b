"""Proved distance from a moving polygon to the occupied cells of a grid."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.footprint.motion_proof import (
    Motion,
    Squares,
    greatest_margin,
    keeps_margin,
    reaches_into,
)
from omnidrive.planning.grid_frame import GridFrame
from omnidrive.planning.path import SplinePath
from omnidrive.planning.pieces import Pieces, pieces

HALVINGS = 10
"""Of a piece, to prove that it keeps a margin."""
_MAX_SAMPLES = 60  # per piece, and per side of a triangle


def footprint_clearance(
    grid: OccupancyGrid,
    footprint: Float[Array, "corners 2"],
    path: SplinePath,
    tolerance: float = 1e-3,
) -> float:
    """Return a proved lower bound on the distance in m from a polygon along a path to obstacles.

    The start is checked as a whole, and then the outline along the path: without contact of the
    outline, no square can get inside. The bound is not sharp: where the obstacle nearest to the
    polygon is a corner, the distance may be greater by a factor of sqrt(2).

    Args:
        grid: The map.
        footprint: Corners (x, y) of a simple polygon in B, in m.
        path: Poses of B along the path.
        tolerance: Tolerance of the proved bound in cells, positive.

    Returns:
        The bound, 0 for mere contact. If the polygon may enter an occupied cell, it is negative:
        minus the greatest possible depth of a point of the polygon, as in
        :meth:`~omnidrive.maps.OccupancyGrid.clearance`. It is infinite if no cell is occupied.

    Raises:
        InvalidInput: The footprint is no simple polygon, or the tolerance is not positive.
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInput(f"the tolerance must be positive, got {tolerance:g} cells")
    polygon, frame = Polygon.of(footprint), GridFrame.of(grid)
    curve, motion, squares = _moving(grid, polygon, frame, path)
    yaw = float(path.control_points[0, 2])
    corners = path.control_points[0, :2] + polygon.turned(polygon.corners, yaw)
    limit = float(grid.clearance(corners).min()) / frame.resolution
    if limit == np.inf:
        return limit
    proved = -1.0
    if limit >= 0.0 and start_is_free(squares, polygon, frame, curve.positions[0]):
        proved = greatest_margin(squares, motion, limit, tolerance, HALVINGS)
    if proved >= 0.0:
        return max(proved - frame.rounding, 0.0) * frame.resolution
    near = _unproved(squares, motion)
    return min(_depth(grid, polygon, frame, curve.piece(j)) for j in near or [0])


def unproved_pieces(
    grid: OccupancyGrid, footprint: Float[Array, "corners 2"], path: SplinePath
) -> list[int]:
    """Return the pieces of a path along which a polygon is not proved to be free.

    If there are none, :func:`footprint_clearance` is 0 or more. Piece 0 is proved only if the
    polygon as a whole is free at the start. Arguments and errors as there.
    """
    polygon, frame = Polygon.of(footprint), GridFrame.of(grid)
    curve, motion, squares = _moving(grid, polygon, frame, path)
    found = _unproved(squares, motion)
    is_free = start_is_free(squares, polygon, frame, curve.positions[0])
    return found if is_free else sorted({0, *found})


def _moving(
    grid: OccupancyGrid, polygon: Polygon, frame: GridFrame, path: SplinePath
) -> tuple[Pieces, Motion, Squares]:
    """Return the path in cells, the motion of the polygon along it, and the occupied squares."""
    curve = pieces(poses_in_cells(grid, frame, path.control_points))
    return curve, motion_of(polygon, frame, curve), Squares.of(grid)


def _unproved(squares: Squares, motion: Motion) -> list[int]:
    """Return the pieces along which the outline is not proved to be free."""
    count = len(motion.poses) - 1
    return [j for j in range(count) if not keeps_margin(squares, motion, j, 0.0, HALVINGS)]


def poses_in_cells(
    grid: OccupancyGrid, frame: GridFrame, poses: Float[Array, "poses 3"]
) -> Float[Array, "poses 3"]:
    """Return poses in W (m, rad) in cells, with the yaw relative to the grid."""
    return np.column_stack([frame.cells(poses[:, :2]), poses[:, 2] - grid.yaw])


def motion_of(polygon: Polygon, frame: GridFrame, curve: Pieces) -> Motion:
    """Return the motion of a polygon along pieces in (x, y, yaw), in cells."""
    return Motion(
        polygon.corners / frame.resolution,
        polygon.radius / frame.resolution,
        np.ascontiguousarray(curve.positions),
        np.ascontiguousarray(curve.second_derivatives),
    )


def start_is_free(
    squares: Squares, polygon: Polygon, frame: GridFrame, pose: Float[Array, " xyyaw"]
) -> bool:
    """Whether the polygon covers no part of an occupied square at a pose in cells."""
    triangles = polygon.turned(polygon.triangles / frame.resolution, float(pose[2])) + pose[:2]
    return not any(reaches_into(squares, triangle, 0.0) for triangle in triangles)


def _depth(grid: OccupancyGrid, polygon: Polygon, frame: GridFrame, piece: Pieces) -> float:
    """Return a lower bound on the least signed distance of points of the polygon, in m.

    The signed distance is Lipschitz continuous with constant 1: between samples it is less than at
    the nearest one by at most their distance. A point of a triangle is no farther from the nearest
    of its samples, in barycentric coordinates that are multiples of 1 / n, than a side / n.
    """
    sides = polygon.triangles - np.roll(polygon.triangles, 1, axis=1)
    longest = float(np.linalg.norm(sides, axis=2).max()) / frame.resolution
    n = ceil(min(max(4.0 * longest, 1.0), _MAX_SAMPLES))
    middle = piece.first_derivatives[0] + 0.5 * piece.second_derivatives[0]
    rates = np.abs([*piece.first_derivatives, middle])
    fastest = float(
        np.linalg.norm(rates[:, :2], axis=1).max()
        + polygon.radius / frame.resolution * rates[:, 2].max()
    )
    times = ceil(min(max(2.0 * fastest, 1.0), _MAX_SAMPLES))
    shares = np.array([(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]) / n
    inside = (shares @ polygon.triangles).reshape(-1, 2)
    nearest = np.inf
    for x, y, yaw in piece.at((np.arange(times) + 0.5) / times)[0].tolist():
        turned = polygon.turned(inside / frame.resolution, yaw)
        points = frame.world(turned + np.array([x, y]))
        nearest = min(nearest, float(grid.clearance(points).min()))
    return nearest - (longest / n + 0.5 * fastest / times) * frame.resolution
