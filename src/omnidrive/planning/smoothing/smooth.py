"""Smoothing of a grid path to a spline with a proved clearance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32

from omnidrive.arrays import Array
from omnidrive.choices import SmoothingName
from omnidrive.errors import InvalidInput, NoPathFound
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import check_choice
from omnidrive.planning.clearance import Obstacles, curve_clearance
from omnidrive.planning.curvature import curvature_peaks
from omnidrive.planning.grid_frame import GridFrame
from omnidrive.planning.headings import with_headings
from omnidrive.planning.path import SplinePath
from omnidrive.planning.pieces import pieces
from omnidrive.planning.polyline import resample
from omnidrive.planning.smoothing.fairing import NO_LIMITS, CurvatureLimits, FairSpline, fair_spline
from omnidrive.planning.smoothing.grid_path_spline import along_grid_path
from omnidrive.planning.smoothing.initial_spline import certified_initial_spline
from omnidrive.planning.smoothing.polygon import free_polygon

_MIN_CLEARANCE = 1e-6  # cells; required of the curved parts of a certified path
_TOLERANCE = 1e-3  # cells; of the proved clearance
_DIGITS = 9  # decimals of a position in cells
NO_COSTS = np.empty((0, 0), np.float32)


@dataclass(frozen=True, eq=False, slots=True)
class SmoothedPath:
    """Smooth path with a proved clearance.

    Attributes:
        path: The path.
        clearance: Proved lower bound on the distance in m from the path to all occupied cells. If
            the path may enter one, it is negative: minus the greatest possible depth.
        is_complete: Whether the smoothing ended before its time was over.
    """

    path: SplinePath
    clearance: float
    is_complete: bool = True


def smooth(
    grid: OccupancyGrid,
    points: Float[Array, "points 2"],
    *,
    method: SmoothingName = "certified",
    clearance: float = 0.0,
    yaws: tuple[float | None, float | None] = (None, None),
    turn_within: float = 1.0,
    costs: Float32[Array, "rows cols"] = NO_COSTS,
    limits: CurvatureLimits = NO_LIMITS,
    obstacles: Obstacles | None = None,
    is_over: Callable[[], bool] | None = None,
) -> SmoothedPath:
    """Smooth a grid path; the first and last point are kept.

    - ``"spline"``: the points are the control points, as in the paper. The spline may enter an
      obstacle if the grid path cuts corners or is any-angle; see :class:`SplinePath`.
    - ``"certified"``: the control points are moved toward low curvature, and each move is accepted
      only if the whole curve is proved to keep its distance from all obstacles. The method never
      fails: where no rounded corner can be proved, the path follows the polygon and turns on the
      spot, with three coincident control points at the corner.

    Args:
        grid: The inflated map, whose free cells the origin of B may enter.
        points: x and y in m of a polygon over free cells. Only its ends may differ from cell
            centres.
        method: Name of the method.
        clearance: Required distance in m of a certified path from occupied cells. Where the polygon
            itself keeps less than 5/4 of it, four fifths of the polygon's distance are required.
        yaws: Headings at start and goal in rad; None for the direction of the path.
        turn_within: Distance from each end over which the heading is blended from the given heading
            to the direction of the path, in m.
        costs: Cost of each cell of ``grid``: a certified path keeps to cells whose mean cost is at
            most that along the grid path plus 15 percent of ``1 + cost`` and 0.05; its curvature
            changes evenly. Empty: no costs.
        limits: Limits of the curvature of a certified path, in 1/m, and of its rate, in 1/m^2.
        obstacles: The occupied cells of ``grid``, if they are known.
        is_over: Whether the time for the smoothing is over. A certified path is then that of the
            moves so far or, before the first one, a spline along the grid path.

    Raises:
        NoPathFound: No certified path within the limits of the curvature was found.
        InvalidInput: The method is unknown, there is no point, a point is not finite, the polygon
            enters an obstacle (certified only), or ``clearance`` is negative or not finite.
    """
    check_choice("smoothing method", method, _METHODS)
    points = np.asarray(points, float)
    if len(points) == 0 or not np.isfinite(points).all():
        raise InvalidInput(
            "a path to smooth needs at least one point, and all points must be finite"
        )
    if not (np.isfinite(clearance) and clearance >= 0.0):
        raise InvalidInput(f"the clearance must be 0 m or more, got {clearance:g} m")
    obstacles = obstacles or Obstacles.of(grid)
    problem = _Problem(grid, points, clearance, costs, limits, obstacles, is_over)
    control_points, proved, is_complete = _METHODS[method](problem)
    path = SplinePath(with_headings(control_points, *yaws, turn_within))
    proved = path.clearance(grid)[0] if proved is None else proved
    return SmoothedPath(path, proved, is_complete)


class _Problem(NamedTuple):
    """Arguments of :func:`smooth` that the methods need."""

    grid: OccupancyGrid
    points: Float[Array, "points 2"]
    clearance: float
    costs: Float32[Array, "rows cols"]
    limits: CurvatureLimits
    obstacles: Obstacles
    is_over: Callable[[], bool] | None


_Smoothed = tuple[Float[Array, "more 2"], float | None, bool]
"""Control points, proved clearance in m, and whether the smoothing ended in time."""


def _plain(problem: _Problem) -> _Smoothed:
    """Return the points as control points, resampled to four if fewer, without a proof."""
    points = problem.points
    return points if len(points) >= 4 else resample(points, 4), None, True


def _certified(problem: _Problem) -> _Smoothed:
    """Return the control points of a relaxed spline, and its proved clearance in m."""
    grid, points, clearance, costs, limits, obstacles, is_over = problem
    frame = GridFrame.of(grid)
    if not np.ptp(points, axis=0).any():  # the robot turns on the spot
        return np.repeat(points[:1], 4, axis=0), float(grid.clearance(points[:1])[0]), True
    if is_over is not None and is_over():
        return _unsmoothed(problem, frame)
    # rounded, so that the result does not depend on the pose of the grid in W
    polygon = free_polygon(obstacles, frame.cells(points).round(_DIGITS), frame)
    if is_over is not None and is_over():
        return _unsmoothed(problem, frame)
    start = certified_initial_spline(
        obstacles, polygon, max(clearance / frame.resolution, _MIN_CLEARANCE), is_over
    )
    if start is None:
        return _unsmoothed(problem, frame)
    fair = fair_spline(obstacles, start, costs, limits.scaled(frame.resolution), is_over)
    if not fair.is_within:
        raise NoPathFound(_exceeded(frame, fair, limits))
    cells, is_complete = fair.control_points, fair.is_complete
    curve = pieces(cells)
    # the clearance proved during the relaxation, or that of the final curve if greater
    proved = float(start.clearances.min())
    is_complete = is_complete and (is_over is None or not is_over())
    if is_complete:
        clearances = curve.positions, curve.second_derivatives, _TOLERANCE
        proved = max(proved, curve_clearance(obstacles, *clearances)[0])
    control_points = frame.world(cells)
    control_points[0], control_points[-1] = points[0], points[-1]
    proved = max(proved - frame.rounding, min(proved, 0.0)) * frame.resolution
    return control_points, proved, is_complete


def _unsmoothed(problem: _Problem, frame: GridFrame) -> _Smoothed:
    """Return the path along the grid, where the time for the smoothing is over."""
    if problem.limits != NO_LIMITS:
        raise NoPathFound("no path within the limits of the curvature was found in time")
    return along_grid_path(problem.obstacles, frame, problem.points)


def _exceeded(frame: GridFrame, fair: FairSpline, limits: CurvatureLimits) -> str:
    """Return the message on a path that exceeds limits of the curvature."""
    cells = fair.control_points
    bend, change = curvature_peaks(pieces(cells))
    bend, change = bend / frame.resolution, change / frame.resolution**2
    piece = int(np.argmax(np.maximum(bend / limits.curvature, change / limits.rate)))
    x, y = frame.world(pieces(cells).positions)[piece]
    allowed = [
        f"{limit:g} {unit}"
        for limit, unit in zip(limits, ("1/m", "1/m^2"), strict=True)
        if np.isfinite(limit)
    ]
    in_time, advice = ("", "") if fair.is_complete else (" in time", " allow more time,")
    return (
        f"no path with a curvature within {' and '.join(allowed)} was found{in_time}: the best one "
        f"has {bend[piece]:.3g} 1/m and {change[piece]:.3g} 1/m^2 at ({x:.2f}, {y:.2f}) m;{advice} "
        "raise the limits, or lower the margin"
    )


_METHODS = {"spline": _plain, "certified": _certified}
