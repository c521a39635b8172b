"""Initial headings for the optimisation of a path."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.planning import SplinePath
from omnidrive.reference.timing.limits import LimitRows

_TURN_WITHIN = 0.2
"""Share of the control points over which the headings change to a given end heading."""


class InitialHeadings(NamedTuple):
    """Headings of all control points and their bounds, in rad, unwrapped."""

    yaw: Float[Array, " points"]
    low: Float[Array, " points"]
    high: Float[Array, " points"]


def initial_headings(
    path: SplinePath,
    limits: tuple[LimitRows, ...],
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
) -> list[InitialHeadings]:
    """Return three initial guesses of the headings along ``path``.

    They are the path's own headings, one constant heading, and the headings with the robot's
    fastest direction along the direction of travel.

    Args:
        path: Path to follow.
        limits: Limits that give the fastest direction of the robot.
        start_yaw: Heading at the start, in rad; None: free.
        goal_yaw: Heading at the goal, in rad, modulo whole turns; None: free.

    Raises:
        InvalidInput: An end heading is not finite.
    """
    check_end_headings(start_yaw, goal_yaw)
    own = path.control_points[:, 2]
    travel = directions_of_travel(path)
    side = _fastest_direction(limits, travel[0] - (own[0] if start_yaw is None else start_yaw))
    shapes = [own, np.full_like(own, own[0] if start_yaw is None else start_yaw), travel - side]
    return [meet_ends(shape, start_yaw, goal_yaw) for shape in shapes]


def with_end_headings(
    path: SplinePath, start_yaw: float | None, goal_yaw: float | None
) -> SplinePath:
    """Return the path with its headings changed near the ends to meet the given end headings.

    Raises:
        InvalidInput: An end heading is not finite.
    """
    check_end_headings(start_yaw, goal_yaw)
    if start_yaw is None and goal_yaw is None:
        return path
    yaw = meet_ends(path.control_points[:, 2], start_yaw, goal_yaw).yaw
    return SplinePath(np.column_stack([path.control_points[:, :2], yaw]))


def check_end_headings(start_yaw: float | None, goal_yaw: float | None) -> None:
    """Check that given end headings, in rad, are finite.

    Raises:
        InvalidInput: One is not.
    """
    for name, yaw in (("start", start_yaw), ("goal", goal_yaw)):
        if yaw is not None and not np.isfinite(yaw):
            raise InvalidInput(f"the heading at the {name} must be a finite angle, got {yaw:g} rad")


def meet_ends(
    yaw: Float[Array, " points"], start_yaw: float | None, goal_yaw: float | None
) -> InitialHeadings:
    """Shift headings by whole turns to the start, and change them to meet the end headings."""
    if start_yaw is not None:
        yaw = yaw + 2.0 * pi * np.round((start_yaw - yaw[0]) / (2.0 * pi))
    share = np.linspace(0.0, 1.0, len(yaw)) / _TURN_WITHIN
    low, high = np.full_like(yaw, -np.inf), np.full_like(yaw, np.inf)
    if start_yaw is not None:
        yaw = yaw + (start_yaw - yaw[0]) * np.maximum(1.0 - share, 0.0)
        low[0] = high[0] = start_yaw
    if goal_yaw is not None:
        goal_yaw = goal_yaw + 2.0 * pi * float(np.round((yaw[-1] - goal_yaw) / (2.0 * pi)))
        yaw = yaw + (goal_yaw - yaw[-1]) * np.maximum(1.0 - share[::-1], 0.0)
        low[-1] = high[-1] = goal_yaw
    return InitialHeadings(yaw, low, high)


def directions_of_travel(path: SplinePath) -> Float[Array, " points"]:
    """Return the direction of travel at each control point, in rad, unwrapped.

    At a control point without motion it is that of the one before.
    """
    points = path.control_points[:, :2]
    chords = np.vstack([points[1] - points[0], points[2:] - points[:-2], points[-1] - points[-2]])
    moving = np.linalg.norm(chords, axis=1) > 1e-9
    if not moving.any():
        return np.zeros(len(points))
    latest = np.maximum.accumulate(np.where(moving, np.arange(len(points)), np.argmax(moving)))
    return np.unwrap(np.arctan2(chords[latest, 1], chords[latest, 0]))


def _fastest_direction(limits: tuple[LimitRows, ...], preferred: float) -> float:
    """Return the direction in B, in rad, of highest speed; among equals the nearest to one."""
    kind = "speed" if any(group.kind == "speed" for group in limits) else "twist rate"
    angles = np.arange(360) * pi / 180.0
    vectors = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    load = np.zeros(len(angles))
    for group in limits:
        if group.kind == kind:
            load = np.maximum(load, group.shares(vectors))
    best = angles[load <= 1.001 * load.min()]
    return float(best[np.argmax(np.cos(best - preferred))])
