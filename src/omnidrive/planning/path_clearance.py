"""Distance from a spline to a grid's obstacles between bounds, in m."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.clearance import Floor, curve_clearance, piece_clearances
from omnidrive.planning.grid_frame import GridFrame
from omnidrive.planning.pieces import Pieces, pieces

_SHARES = (1.0, 0.03, 0.001)  # of the tolerance
_MOST_SAMPLES = 10_000  # of a piece


def clearance_bounds(
    grid: OccupancyGrid, control_points: Float[Array, "points 2"], tolerance: float
) -> tuple[float, float]:
    """Bounds on the least distance in m from the spline to the square of an obstacle.

    See :meth:`omnidrive.planning.SplinePath.clearance`.
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInput(f"the tolerance must be positive, got {tolerance:g} cells")
    frame = GridFrame.of(grid)
    floor, curve = Floor.of(grid), pieces(frame.cells(control_points))
    # a chord may enter where the curve does not: then chords closer to the curve
    for share in _SHARES:
        lower, upper = curve_clearance(floor, curve.places, curve.bends, share * tolerance)
        if lower > -np.inf:
            rounding = frame.rounding
            return (lower - rounding) * frame.resolution, (upper + rounding) * frame.resolution
    bounds = piece_clearances(floor, curve.places, curve.bends, tolerance, 2.0 * tolerance)
    near = np.flatnonzero(bounds < 2.0 * tolerance).tolist()
    depths = [_depth(grid, frame, curve.piece(j), tolerance) for j in near]
    return min(lower for lower, _ in depths), min(upper for _, upper in depths)


def _depth(
    grid: OccupancyGrid, frame: GridFrame, piece: Pieces, tolerance: float
) -> tuple[float, float]:
    """Bounds on the least signed distance from a piece to the edge of the obstacles, in m.

    The distance changes no faster than the place: between samples it is less than at the nearer
    by at most half the way between them.
    """
    middle = piece.slopes[0] + 0.5 * piece.bends[0]
    fastest = float(np.linalg.norm([*piece.slopes, middle], axis=1).max())
    samples = ceil(min(max(0.25 * fastest / tolerance, 1.0), _MOST_SAMPLES))
    at = (np.arange(samples) + 0.5) / samples
    nearest = float(grid.clearance(frame.world(piece.at(at)[0])).min())
    return nearest - 0.5 * fastest / samples * frame.resolution, nearest
