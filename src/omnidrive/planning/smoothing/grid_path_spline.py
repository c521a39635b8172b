"""Spline along a grid path whose clearance is known without a proof of every piece."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.planning.clearance import Obstacles, piece_clearances
from omnidrive.planning.grid_frame import GridFrame
from omnidrive.planning.pieces import pieces
from omnidrive.planning.smoothing.initial_spline import TOLERANCE

_INNER = 0.409
"""Clearance in cells of a spline through the centres of a grid path, see :class:`SplinePath`."""
_ENDS = 8  # pieces at each end whose clearance is proved


def along_grid_path(
    obstacles: Obstacles, frame: GridFrame, points: Float[Array, "points 2"]
) -> tuple[Float[Array, "more 2"], float, bool]:
    """Return control points along a grid path, their proved clearance in m, and False.

    The control points are the centres of the cells, from which every inner piece has a known
    clearance; the pieces at the ends, which lie anywhere in their cells, are proved. Where they are
    not, the path follows the polygon from centre to centre, with three coincident points at each.

    Args:
        obstacles: The occupied cells.
        frame: Frame of the cells.
        points: x and y in m of start, centres of free cells without cutting corners, and goal.
    """
    cells = frame.cells(points)
    first, last = np.floor(cells[:1]) + 0.5, np.floor(cells[-1:]) + 0.5
    cells = np.vstack([cells[:1], first, cells[1:-1], last, cells[-1:]])
    clearance = _proved(obstacles, cells)
    if clearance <= 0.0:
        inner = np.repeat(cells[1:-1], 3, axis=0)
        cells, clearance = np.vstack([cells[:1], inner, cells[-1:]]), 0.0
    control_points = frame.world(cells)
    control_points[0], control_points[-1] = points[0], points[-1]
    return control_points, max(clearance - frame.rounding, 0.0) * frame.resolution, False


def _proved(obstacles: Obstacles, cells: Float[Array, "points 2"]) -> float:
    """Return a lower bound on the clearance in cells; -inf if the ends enter an obstacle."""
    count = 2 * _ENDS
    if len(cells) <= 2 * count:
        parts = [pieces(cells)]
    else:
        parts = [pieces(cells[:count]), pieces(cells[-count:])]
    least = _INNER
    for k, part in enumerate(parts):
        end = slice(None) if len(parts) == 1 else (slice(_ENDS + 1), slice(-_ENDS - 1, None))[k]
        knots = np.ascontiguousarray(part.positions[end])
        second = np.ascontiguousarray(part.second_derivatives[end])
        bounds = piece_clearances(obstacles, knots, second, TOLERANCE, _INNER)
        least = min(least, float(bounds.min()))
    return least
