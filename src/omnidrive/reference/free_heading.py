"""Headings chosen for time along a path that is given."""

from __future__ import annotations

import numpy as np

from omnidrive.errors import InvalidReference
from omnidrive.planning import SplinePath
from omnidrive.reference.course import check_moves
from omnidrive.reference.heading_guess import heading_guesses
from omnidrive.reference.limits import LimitRows
from omnidrive.reference.transcription import Guess, optimised

MAX_POINTS = 1000
"""Most control points for which all headings are optimised together."""


def free_heading(
    path: SplinePath,
    limits: tuple[LimitRows, ...],
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
) -> SplinePath:
    """The same positions with the headings that make the motion from rest to rest fastest.

    A local optimum from one of three guesses, the path's own headings among them, or a guess.

    Args:
        path: Where to go.
        limits: What the motion keeps.
        start_yaw: Heading at the start, in rad; None leaves it open.
        goal_yaw: Heading at the goal, in rad; None leaves it open.

    Raises:
        InvalidInput: An end heading is not finite.
        InvalidReference: The path has more than 1000 control points, or does not travel.
        MissingExtra: CasADi is not installed.
    """
    check_moves(path, 2)
    points = path.control_points
    if len(points) > MAX_POINTS:
        raise InvalidReference(
            f"headings can be optimised along at most {MAX_POINTS} control points, the path has "
            f"{len(points)}; choose another heading, or a path with fewer"
        )
    guesses = [
        Guess(
            SplinePath(np.column_stack([points[:, :2], guess.yaw])),
            np.column_stack([points[:, :2], guess.low]),
            np.column_stack([points[:, :2], guess.high]),
        )
        for guess in heading_guesses(path, limits, start_yaw, goal_yaw)
    ]
    return optimised(guesses, path.length, limits).path
