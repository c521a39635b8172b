"""Bounds on the distance from a spline to the occupied cells of a grid, in m."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.clearance import Obstacles, curve_clearance, piece_clearances
from omnidrive.planning.grid_frame import GridFrame
from omnidrive.planning.pieces import Pieces, pieces

_SHARES = (1.0, 0.03, 0.001)  # factors of the tolerance, tried in turn
_MAX_SAMPLES = 10_000  # per piece


def clearance_bounds(
    grid: OccupancyGrid, control_points: Float[Array, "points 2"], tolerance: float
) -> tuple[float, float]:
    """Return bounds on the least distance in m from the spline to an occupied cell.

    See :meth:`omnidrive.planning.SplinePath.clearance`.
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInput(f"the tolerance must be positive, got {tolerance:g} cells")
    frame = GridFrame.of(grid)
    obstacles, curve = Obstacles.of(grid), pieces(frame.cells(control_points))
    # a chord may enter a square that the curve avoids: retry with chords closer to the curve
    for share in _SHARES:
        lower, upper = curve_clearance(
            obstacles, curve.positions, curve.second_derivatives, share * tolerance
        )
        if lower > -np.inf:
            rounding = frame.rounding
            return (lower - rounding) * frame.resolution, (upper + rounding) * frame.resolution
    bounds = piece_clearances(
        obstacles, curve.positions, curve.second_derivatives, tolerance, 2.0 * tolerance
    )
    near = np.flatnonzero(bounds < 2.0 * tolerance).tolist()
    depths = [_depth(grid, frame, curve.piece(j), tolerance) for j in near]
    return min(lower for lower, _ in depths), min(upper for _, upper in depths)


def _depth(
    grid: OccupancyGrid, frame: GridFrame, piece: Pieces, tolerance: float
) -> tuple[float, float]:
    """Return bounds on the least signed distance from a piece to the edge of the obstacles, in m.

    The signed distance is Lipschitz continuous with constant 1: between two samples it is less than
    at the nearer sample by at most half the arc length between them.
    """
    middle = piece.first_derivatives[0] + 0.5 * piece.second_derivatives[0]
    fastest = float(np.linalg.norm([*piece.first_derivatives, middle], axis=1).max())
    samples = ceil(min(max(0.25 * fastest / tolerance, 1.0), _MAX_SAMPLES))
    at = (np.arange(samples) + 0.5) / samples
    nearest = float(grid.clearance(frame.world(piece.at(at)[0])).min())
    return nearest - 0.5 * fastest / samples * frame.resolution, nearest
