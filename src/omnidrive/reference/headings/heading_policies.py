"""Headings along a given path by rules: toward a point, early or late turns, fastest direction."""

from __future__ import annotations

from math import pi

import numpy as np

from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.planning import SplinePath
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference.headings.initial_headings import directions_of_travel, meet_ends
from omnidrive.reference.timing.piecewise_path import PiecewisePath, check_path_moves

_TURN_WITHIN = 1.0
"""Distance over which the headings `goal-first` and `goal-last` turn, m."""
_NEAR = 1e-3
"""Distance from the target of `face` below which it has no direction, m."""
_OFFSETS = 24
"""Angles between heading and direction of travel that `fastest` tries, evenly over a turn."""


def facing(
    path: SplinePath,
    target: tuple[float, float],
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
) -> SplinePath:
    """Return the path with headings toward a point (x, y) in W, m.

    The headings are those of the control points, so that between them the heading deviates by the
    bend of the path within a control step. Given end headings are met over a fifth of the control
    points.

    Raises:
        InvalidInput: The target is not finite.
        InvalidReference: The path passes through the target.
    """
    if not np.isfinite(target).all():
        raise InvalidInput(f"the target of heading 'face' must be finite, got {target} m")
    points = path.control_points[:, :2]
    toward = np.array(target) - points
    if np.linalg.norm(toward, axis=1).min() < _NEAR:
        raise InvalidReference(
            f"the path passes through the target ({target[0]:g}, {target[1]:g}) m, so that the "
            "heading cannot point at it; choose another target"
        )
    yaw = np.unwrap(np.arctan2(toward[:, 1], toward[:, 0]))
    return _with(path, meet_ends(yaw, start_yaw, goal_yaw).yaw)


def turning_once(
    path: SplinePath, start_yaw: float | None, goal_yaw: float | None, *, early: bool
) -> SplinePath:
    """Return the path with the heading of the start and then that of the goal.

    Args:
        path: Path to follow.
        start_yaw: Heading at the start, rad; None: that of the path there.
        goal_yaw: Heading at the goal, rad, modulo whole turns; None: that of the path there.
        early: Turn within a metre from the start; otherwise within a metre before the goal.
    """
    own = path.control_points[:, 2]
    first = own[0] if start_yaw is None else start_yaw
    last = own[-1] if goal_yaw is None else goal_yaw
    last += 2.0 * pi * round((first - last) / (2.0 * pi))
    distance = cumulative_length(path.control_points[:, :2])
    if distance[-1] == 0.0:
        distance = np.linspace(0.0, 1.0, len(own))
    within = min(_TURN_WITHIN, distance[-1])
    away = distance if early else distance - (distance[-1] - within)
    share = np.clip(away / within, 0.0, 1.0)
    yaw = first + (last - first) * share
    yaw[0], yaw[-1] = first, last
    return _with(path, yaw)


def fast_candidates(
    path: SplinePath, start_yaw: float | None, goal_yaw: float | None
) -> list[PiecewisePath]:
    """Return paths with constant angles between heading and direction of travel.

    An omni robot's top speed depends on the direction in B: the fastest motion has a fast direction
    along the path. The candidates are the tangent, the headings of the path, one constant heading,
    and offsets from the tangent in steps of 15 degrees, all met with the end headings.
    """
    check_path_moves(path, 2)
    travel = directions_of_travel(path)
    own = path.control_points[:, 2]
    shapes = [own, np.full_like(own, own[0] if start_yaw is None else start_yaw)]
    shapes += [travel + 2.0 * pi * k / _OFFSETS for k in range(_OFFSETS)]
    found = [
        PiecewisePath.of(_with(path, meet_ends(yaw, start_yaw, goal_yaw).yaw)) for yaw in shapes
    ]
    if start_yaw is None and goal_yaw is None:
        try:
            found.append(PiecewisePath.of(path, "tangent"))
        except InvalidReference:  # it has no direction of travel somewhere
            return found
    return found


def _with(path: SplinePath, yaw: np.ndarray) -> SplinePath:
    """Return the path with other headings of its control points."""
    return SplinePath(np.column_stack([path.control_points[:, :2], yaw]))
