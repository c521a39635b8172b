"""Minimum-time motion with a path that is free within a corridor, and free headings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, NoPathFound
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.planning.deadline import Deadline
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference.headings.initial_headings import (
    check_end_headings,
    initial_headings,
    with_end_headings,
)
from omnidrive.reference.path_optimisation.corridor import Corridor
from omnidrive.reference.path_optimisation.proved_path import ProofMap, fastest_proved
from omnidrive.reference.path_optimisation.transcription import InitialGuess, casadi, optimise_path
from omnidrive.reference.timing.jerk_timing import fastest_reference
from omnidrive.reference.timing.limits import LimitRows, MotionLimits, jerk_rows, limit_rows
from omnidrive.reference.timing.piecewise_path import PiecewisePath
from omnidrive.reference.timing.smooth_reference import SmoothReference
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.robot import Chassis

_PIECES = 48
"""Number of pieces of the new spline; more if the corridor has many boxes."""

_MAX_PIECES = 600
"""Largest number of pieces of the new spline."""

_SAME_YAW = 1e-12
"""Difference of the cosine of a heading from 1 that counts as rounding."""

_GAIN = 1e-6
"""Share of the duration that a faster motion must save; less counts as rounding."""


@dataclass(frozen=True, eq=False, slots=True)
class MinimumTime:
    """Fastest motion found.

    Attributes:
        reference: Fastest motion.
        path: Path of the motion.
        status: Origin of the motion. ``converged``: a local optimum of the discretised problem;
            ``capped``: the solver stopped before convergence with a faster motion; ``guess``: an
            initial guess is faster than the start path, and the solver found no faster motion;
            ``fallback``: the start path, because no faster motion was found.
        message: One sentence on the result.
        corridor: Corridor of the path; None if there is none, and with a footprint.
    """

    reference: TimedReference | SmoothReference
    path: SplinePath
    status: Literal["converged", "capped", "guess", "fallback"]
    message: str
    corridor: Corridor | None


def minimum_time(
    path: SplinePath,
    chassis: Chassis,
    limits: MotionLimits,
    free_space: OccupancyGrid,
    *,
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
    footprint: Float[Array, "corners 2"] | None = None,
    time_limit: float | None = None,
) -> MinimumTime:
    """Return the fastest motion from the start of ``path`` to its end in a corridor around it.

    The corridor consists of boxes of free cells. Each piece of the new path has its Bezier points
    in one box, and therefore stays in the box. Path and speeds are optimised together; then the
    timing along the new path is computed exactly. The start path is ``path`` with its own headings,
    changed near the ends to meet given end headings. The result is never slower than
    :func:`time_within_limits` along the start path, which is returned if no faster motion is found.
    With a footprint there is no corridor: the polygon is proved to be free along the new path, see
    :func:`~omnidrive.reference.path_optimisation.proved_path.fastest_proved`.

    Args:
        path: Path in free cells or, with a footprint, on which the polygon is free.
        chassis: Wheel kinematics and wheel speed limit.
        limits: All other limits.
        free_space: Free cells for the centre of the robot: obstacles are inflated by its size. With
            a footprint, free cells for the whole polygon: inflated by a margin at most.
        start_yaw: Heading at the start, in rad; None: free.
        goal_yaw: Heading at the goal, in rad, modulo whole turns; None: free.
        footprint: Corners (x, y) of a simple polygon in B, in m; None: only the centre counts.
        time_limit: Time for the optimisation, in s, positive, without the timing along the paths;
            the result then depends on the load of the computer. None: no limit.

    Raises:
        InvalidInput: An end heading is not finite or, with a footprint, not that of the path, or
            the footprint or the time limit is invalid.
        InvalidReference: The path does not move.
        MissingExtra: CasADi is not installed.
    """
    casadi()
    deadline = None if time_limit is None else Deadline.of(time_limit)
    rows, jerks, yaws = limit_rows(chassis, limits), jerk_rows(limits), (start_yaw, goal_yaw)
    polygon = None if footprint is None else Polygon.of(footprint)
    path = with_end_headings(path, *yaws) if polygon is None else _with_own_ends(path, yaws)
    start = fastest_reference(PiecewisePath.of(path), rows, jerks)
    if path.length == 0.0:
        return _fallback(path, start, None, "the path only turns on the spot")
    if polygon is None:
        found = _in_corridor(path, free_space, rows, yaws, deadline)
    else:
        found = _around_polygon(ProofMap(path, polygon, free_space), rows, yaws, deadline)
    if found.path is None:
        return _fallback(path, start, found.corridor, found.note)
    reference = fastest_reference(PiecewisePath.of(found.path), rows, jerks)
    if reference.duration >= start.duration * (1.0 - _GAIN):
        where = "" if found.corridor is None else " in the corridor"
        message = f"the best motion{where} takes {reference.duration:.3f} s"
        return _fallback(path, start, found.corridor, message)
    message = f"{reference.duration:.3f} s instead of {start.duration:.3f} s, {found.note}"
    return MinimumTime(reference, found.path, found.source, message, found.corridor)


class _Found(NamedTuple):
    """Path found, and a note on it; None: there is none, for the reason in the note."""

    path: SplinePath | None
    corridor: Corridor | None
    note: str
    source: Literal["guess", "converged", "capped"] = "guess"


def _in_corridor(
    path: SplinePath,
    free_space: OccupancyGrid,
    rows: tuple[LimitRows, ...],
    yaws: tuple[float | None, float | None],
    deadline: Deadline | None,
) -> _Found:
    """Return the fastest path in a corridor of free cells."""
    try:
        corridor = Corridor.along(path.poses(_fine_parameters(path))[:, :2], free_space)
    except NoPathFound as error:
        return _Found(None, None, f"there is no corridor around the path: {error}")
    pieces = corridor.pieces(_PIECES)
    if len(pieces) > _MAX_PIECES:
        return _Found(None, corridor, f"the corridor has too many boxes: {len(corridor.boxes)}")
    guesses = _guesses(path, corridor, pieces, rows, yaws)
    found = optimise_path(guesses, path.length, rows, deadline)
    faster = SplinePath(corridor.to_world(found.path.control_points))
    if not corridor.contains(faster.control_points, pieces):
        return _Found(None, corridor, "the motion found leaves the corridor")
    return _Found(faster, corridor, f"in {len(corridor.boxes)} boxes", found.source)


def _around_polygon(
    around: ProofMap,
    rows: tuple[LimitRows, ...],
    yaws: tuple[float | None, float | None],
    deadline: Deadline | None,
) -> _Found:
    """Return the fastest path on which the polygon is proved to be free."""
    count = len(around.start.control_points)
    if count > _MAX_PIECES:
        return _Found(None, None, f"the path has too many control points: {count}")
    found = fastest_proved(around, rows, (yaws[0] is not None, yaws[1] is not None), deadline)
    if found is None:
        return _Found(None, None, "no faster motion on which the polygon is free was found")
    note = (
        f"with the polygon proved to be free at {100.0 * found.share:.0f} % of the way from the "
        f"start path to optimum {found.rounds}"
    )
    return _Found(found.path, None, note, found.source)


def _with_own_ends(path: SplinePath, yaws: tuple[float | None, float | None]) -> SplinePath:
    """Return the path, whose headings at the ends have to be the given ones.

    Raises:
        InvalidInput: A given heading is not finite or not that of the path.
    """
    check_end_headings(*yaws)
    for name, yaw, own in zip(
        ("start", "goal"), yaws, path.control_points[[0, -1], 2], strict=True
    ):
        if yaw is not None and np.cos(yaw - own) < 1.0 - _SAME_YAW:
            raise InvalidInput(
                f"with a footprint, the heading at the {name} is that of the path, {own:.4g} rad, "
                f"not {yaw:.4g} rad: plan with it"
            )
    return path


def _fallback(
    path: SplinePath, start: TimedReference | SmoothReference, corridor: Corridor | None, why: str
) -> MinimumTime:
    message = f"start path at the limits, {start.duration:.3f} s: {why}"
    return MinimumTime(start, path, "fallback", message, corridor)


def _fine_parameters(path: SplinePath) -> Float[Array, " samples"]:
    """Return 20 parameters per piece, for which straight lines approximate the path."""
    return np.linspace(0.0, 1.0, 20 * (len(path.control_points) - 3) + 1)


def _guesses(
    path: SplinePath,
    corridor: Corridor,
    pieces: Int[Array, " pieces"],
    rows: tuple[LimitRows, ...],
    yaws: tuple[float | None, float | None],
) -> list[InitialGuess]:
    """Return splines near the path and in the corridor, with three kinds of headings.

    The splines and their bounds are in the frame of the corridor's grid. The limits hold in B and
    do not depend on the frame.
    """
    control = corridor.from_world(_refit(path, corridor, pieces))
    start, goal = (None if yaw is None else yaw - corridor.frame.yaw for yaw in yaws)
    ends = control[[0, -1], :2]
    control[1:-1, :2] = np.clip(control[:, :2], *corridor.control_point_bounds(pieces))[1:-1]
    low, high = np.full_like(control[:, :2], -np.inf), np.full_like(control[:, :2], np.inf)
    low[[0, -1]] = high[[0, -1]] = ends
    hull = corridor.bezier_bounds(pieces)
    hull[[0, -1], :2] = np.minimum(hull[[0, -1], :2], ends)  # the ends may be on a side
    hull[[0, -1], 2:] = np.maximum(hull[[0, -1], 2:], ends)
    return [
        InitialGuess(
            SplinePath(np.column_stack([control[:, :2], guess.yaw])),
            np.column_stack([low, guess.low]),
            np.column_stack([high, guess.high]),
            hull,
        )
        for guess in initial_headings(SplinePath(control), rows, start, goal)
    ]


def _refit(
    path: SplinePath, corridor: Corridor, pieces: Int[Array, " pieces"]
) -> Float[Array, "points 3"]:
    """Return control points on the path, those of each box spread evenly over its part.

    A control point is placed at the mean of its three inner knots (Greville sites; de Boor, "A
    Practical Guide to Splines", ch. XI).
    """
    poses = path.poses(_fine_parameters(path))
    distance = cumulative_length(poses[:, :2])
    starts = np.concatenate([[0.0], corridor.box_ends[:-1]])
    counts = np.bincount(pieces)
    knots = np.concatenate(
        [
            *(
                a + (b - a) * np.arange(n) / n
                for a, b, n in zip(starts, corridor.box_ends, counts, strict=True)
            ),
            corridor.box_ends[-1:],
        ]
    )
    padded = np.concatenate([[knots[0]] * 2, knots, [knots[-1]] * 2])
    sites = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    return np.stack([np.interp(sites, distance, column) for column in poses.T], axis=1)
