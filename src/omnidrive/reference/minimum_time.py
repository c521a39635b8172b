"""Minimum time: the path may move within a corridor, the heading is free."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import NoPathFound
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference.corridor import Corridor
from omnidrive.reference.course import Course
from omnidrive.reference.course_timing import time_course
from omnidrive.reference.heading_guess import heading_guesses, with_end_headings
from omnidrive.reference.limits import LimitRows, MotionLimits, limit_rows
from omnidrive.reference.timed import TimedReference
from omnidrive.reference.transcription import Guess, casadi, optimised
from omnidrive.robot import Chassis

_PIECES = 48
"""Of the new spline, along all of the way, or more if there are many boxes."""

_MAX_PIECES = 600

_GAIN = 1e-6
"""Share of the time that a faster motion has to save: less is rounding."""


@dataclass(frozen=True, eq=False, slots=True)
class MinimumTime:
    """The fastest motion found.

    Attributes:
        reference: It.
        path: Its path.
        status: ``converged``: a local optimum of the discretised problem; ``capped``: the solver
            stopped before, with a faster motion all the same; ``guess``: so is what the solver
            began with, and it found nothing better; ``fallback``: nothing faster than the start
            path was found, which is returned.
        message: What happened, in a sentence.
        corridor: Where the path could move; None if there was none.
    """

    reference: TimedReference
    path: SplinePath
    status: Literal["converged", "capped", "guess", "fallback"]
    message: str
    corridor: Corridor | None


def minimum_time(
    path: SplinePath,
    chassis: Chassis,
    limits: MotionLimits,
    free: OccupancyGrid,
    *,
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
) -> MinimumTime:
    """Fastest motion from the start of ``path`` to its end through a corridor around it.

    The corridor is boxes of free cells. Every piece of the new path has its Bezier points in one
    box, so that it cannot leave it. Times are optimised together with the path, then
    computed exactly along it. The result is never slower than :func:`time_within_limits` along
    the start path, which is ``path`` with its own headings, bent to those given at the ends: if
    nothing faster is found, it is that.

    Args:
        path: A way that stays in free cells.
        chassis: Its wheel matrix and its wheels' top speed.
        limits: All other limits.
        free: Where the robot's centre may be: obstacles inflated by its size.
        start_yaw: Heading at the start, in rad; None leaves it open.
        goal_yaw: Heading at the goal, in rad, modulo whole turns; None leaves it open.

    Raises:
        InvalidInput: An end heading is not finite.
        InvalidReference: The path stands still.
        MissingExtra: CasADi is not installed.
    """
    casadi()
    rows = limit_rows(chassis, limits)
    path = with_end_headings(path, start_yaw, goal_yaw)
    start = time_course(Course.of(path), rows)
    if path.length == 0.0:
        return _fallback(path, start, None, "the path only turns")
    try:
        corridor = Corridor.along(path.poses(_fine(path))[:, :2], free)
    except NoPathFound as error:
        return _fallback(path, start, None, f"there is no corridor around the path: {error}")
    pieces = corridor.pieces(_PIECES)
    if len(pieces) > _MAX_PIECES:
        return _fallback(
            path, start, corridor, f"the corridor has {len(corridor.boxes)} boxes, too many"
        )
    guesses = _guesses(path, corridor, pieces, rows, (start_yaw, goal_yaw))
    found = optimised(guesses, path.length, rows)
    faster = SplinePath(corridor.to_world(found.path.control_points))
    if not corridor.contains(faster.control_points, pieces):
        return _fallback(path, start, corridor, "the motion found leaves the corridor")
    reference = time_course(Course.of(faster), rows)
    if reference.duration >= start.duration * (1.0 - _GAIN):
        message = f"the best motion in the corridor takes {reference.duration:.3f} s"
        return _fallback(path, start, corridor, message)
    message = (
        f"{reference.duration:.3f} s instead of {start.duration:.3f} s, "
        f"in {len(corridor.boxes)} boxes"
    )
    return MinimumTime(reference, faster, found.source, message, corridor)


def _fallback(
    path: SplinePath, start: TimedReference, corridor: Corridor | None, why: str
) -> MinimumTime:
    message = f"the start path at its limits, in {start.duration:.3f} s: {why}"
    return MinimumTime(start, path, "fallback", message, corridor)


def _fine(path: SplinePath) -> Float[Array, " samples"]:
    """Parameters close enough for straight lines between: 20 on every piece."""
    return np.linspace(0.0, 1.0, 20 * (len(path.control_points) - 3) + 1)


def _guesses(
    path: SplinePath,
    corridor: Corridor,
    pieces: Int[Array, " pieces"],
    rows: tuple[LimitRows, ...],
    yaws: tuple[float | None, float | None],
) -> list[Guess]:
    """Splines near the path and in the corridor, with three kinds of headings, and their bounds.

    They are in the frame of the corridor's grid; limits are the robot's, so that nothing else
    changes with it.
    """
    control = corridor.from_world(_refitted(path, corridor, pieces))
    start, goal = (None if yaw is None else yaw - corridor.frame.yaw for yaw in yaws)
    ends = control[[0, -1], :2]
    control[1:-1, :2] = np.clip(control[:, :2], *corridor.bounds(pieces))[1:-1]
    low, high = np.full_like(control[:, :2], -np.inf), np.full_like(control[:, :2], np.inf)
    low[[0, -1]] = high[[0, -1]] = ends
    hull = corridor.hull(pieces)
    hull[[0, -1], :2] = np.minimum(hull[[0, -1], :2], ends)  # they may be on a side
    hull[[0, -1], 2:] = np.maximum(hull[[0, -1], 2:], ends)
    return [
        Guess(
            SplinePath(np.column_stack([control[:, :2], guess.yaw])),
            np.column_stack([low, guess.low]),
            np.column_stack([high, guess.high]),
            hull,
        )
        for guess in heading_guesses(SplinePath(control), rows, start, goal)
    ]


def _refitted(
    path: SplinePath, corridor: Corridor, pieces: Int[Array, " pieces"]
) -> Float[Array, "points 3"]:
    """Control points on the path, those of each box spread evenly over its part of the way.

    A control point belongs at the mean of its three inner knots (de Boor, ch. XI, Greville sites).
    """
    poses = path.poses(_fine(path))
    distance = cumulative_length(poses[:, :2])
    starts = np.concatenate([[0.0], corridor.ends[:-1]])
    counts = np.bincount(pieces)
    knots = np.concatenate(
        [
            *(
                a + (b - a) * np.arange(n) / n
                for a, b, n in zip(starts, corridor.ends, counts, strict=True)
            ),
            corridor.ends[-1:],
        ]
    )
    padded = np.concatenate([[knots[0]] * 2, knots, [knots[-1]] * 2])
    sites = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    return np.stack([np.interp(sites, distance, column) for column in poses.T], axis=1)
