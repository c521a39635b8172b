"""Headings optimised for time along a given path."""

from __future__ import annotations

import numpy as np

from omnidrive.errors import InvalidReference
from omnidrive.planning import SplinePath
from omnidrive.reference.headings.initial_headings import initial_headings
from omnidrive.reference.path_optimisation.transcription import InitialGuess, optimise_path
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.piecewise_path import check_path_moves

MAX_POINTS = 1000
"""Largest number of control points whose headings are optimised together."""


def free_heading(
    path: SplinePath,
    limits: tuple[LimitRows, ...],
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
) -> SplinePath:
    """Return the path with the headings of the fastest motion from rest to rest.

    The result is a local optimum from one of three initial guesses, among them the path's own
    headings, or one of these guesses.

    Args:
        path: Path to follow; its positions are kept.
        limits: Limits of the motion.
        start_yaw: Heading at the start, in rad; None: free.
        goal_yaw: Heading at the goal, in rad; None: free.

    Raises:
        InvalidInput: An end heading is not finite.
        InvalidReference: The path has more than 1000 control points, or its position does not
            change.
        MissingExtra: CasADi is not installed.
    """
    check_path_moves(path, 2)
    points = path.control_points
    if len(points) > MAX_POINTS:
        raise InvalidReference(
            f"headings can be optimised for at most {MAX_POINTS} control points, the path has "
            f"{len(points)}; choose another heading, or a path with fewer control points"
        )
    guesses = [
        InitialGuess(
            SplinePath(np.column_stack([points[:, :2], guess.yaw])),
            np.column_stack([points[:, :2], guess.low]),
            np.column_stack([points[:, :2], guess.high]),
        )
        for guess in initial_headings(path, limits, start_yaw, goal_yaw)
    ]
    return optimise_path(guesses, path.length, limits).path
