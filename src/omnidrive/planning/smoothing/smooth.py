"""From the way that a search found to a smooth path and its certificate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.clearance import Floor, curve_clearance
from omnidrive.planning.grid_frame import GridFrame
from omnidrive.planning.headings import with_headings
from omnidrive.planning.path import SplinePath
from omnidrive.planning.pieces import pieces
from omnidrive.planning.polyline import resampled
from omnidrive.planning.smoothing.polygon import free_polygon
from omnidrive.planning.smoothing.relaxation import relaxed
from omnidrive.planning.smoothing.start import certified_start

SmoothingName = Literal["spline", "certified"]

_LEAST = 1e-6  # cells that a certified path keeps at least where it bends
_TOLERANCE = 1e-3  # cells, of what is proved
_DIGITS = 9  # of cells


@dataclass(frozen=True, eq=False, slots=True)
class Smoothed:
    """A smooth path and what is proved of it.

    Attributes:
        path: The path.
        clearance: Distance in m from the squares of all obstacles that the whole path is proved
            to keep; negative for a path that may enter one, by that much.
    """

    path: SplinePath
    clearance: float


def smooth(
    grid: OccupancyGrid,
    points: Float[Array, "points 2"],
    *,
    method: SmoothingName = "certified",
    clearance: float = 0.0,
    yaws: tuple[float | None, float | None] = (None, None),
    turn_within: float = 1.0,
) -> Smoothed:
    """Smooth path along a way that a search found; its ends stay where they are.

    - ``"spline"``: the points are the control points, as in the paper. It may enter an obstacle
      where the way cuts corners or is any-angle; see :class:`SplinePath`.
    - ``"certified"``: the control points are moved toward low curvature, and each move is taken
      only if every point of the curve is proved to keep its distance from all obstacles. It never
      fails: where no rounded corner can be proved to keep clear, the path follows the polygon
      and turns on the spot, with three control points at the corner.

    Args:
        grid: The obstacles, inflated: its free cells are where the origin of B may be.
        points: x and y in m: a polygon over free cells. Only its ends may be off cell centres.
        method: See above.
        clearance: Distance in m from the obstacles' squares that a certified path is to keep. A
            part of it keeps less where the polygon does: four fifths of the polygon's.
        yaws: Headings at start and goal in rad; None for along the path.
        turn_within: Distance over which the heading turns from an end's to the path's, in m.

    Raises:
        InvalidInput: There is no point, a point is not finite, the polygon enters an obstacle
            (certified only), or ``clearance`` is negative or not finite.
    """
    points = np.asarray(points, float)
    if len(points) == 0 or not np.isfinite(points).all():
        raise InvalidInput("a way to smooth needs at least one point, all of them finite")
    if not (np.isfinite(clearance) and clearance >= 0.0):
        raise InvalidInput(f"the clearance must be 0 m or more, got {clearance:g} m")
    control_points, proved = _METHODS[method](grid, points, clearance)
    path = SplinePath(with_headings(control_points, *yaws, turn_within))
    return Smoothed(path, path.clearance(grid)[0] if proved is None else proved)


def _plain(
    grid: OccupancyGrid, points: Float[Array, "points 2"], clearance: float
) -> tuple[Float[Array, "more 2"], None]:
    """The paper's control points, at least four, of which nothing is proved yet."""
    return points if len(points) >= 4 else resampled(points, 4), None


def _certified(
    grid: OccupancyGrid, points: Float[Array, "points 2"], clearance: float
) -> tuple[Float[Array, "more 2"], float]:
    """Control points of a relaxed spline, and the distance in m that it is proved to keep."""
    frame, floor = GridFrame.of(grid), Floor.of(grid)
    if not np.ptp(points, axis=0).any():  # turning on the spot: nothing to round
        return np.repeat(points[:1], 4, axis=0), float(grid.clearance(points[:1])[0])
    # rounded, so that the same way on a grid that was moved or turned becomes the same path
    polygon = free_polygon(floor, frame.cells(points).round(_DIGITS))
    start = certified_start(floor, polygon, max(clearance / frame.resolution, _LEAST))
    cells = relaxed(floor, start)
    curve = pieces(cells)
    # what was kept on the way, or what is left of it now if that is more
    proved = max(
        float(start.kept.min()),
        curve_clearance(floor, curve.places, curve.bends, _TOLERANCE)[0],
    )
    control_points = frame.world(cells)
    control_points[0], control_points[-1] = points[0], points[-1]
    return control_points, max(proved - frame.rounding, min(proved, 0.0)) * frame.resolution


_METHODS = {"spline": _plain, "certified": _certified}
