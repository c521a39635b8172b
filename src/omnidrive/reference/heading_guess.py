"""Headings from which an optimiser may start."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.planning import SplinePath
from omnidrive.reference.limits import LimitRows

_TURN_WITHIN = 0.2
"""Share of the control points over which a guess turns away from a given end heading."""


class HeadingGuess(NamedTuple):
    """Headings of all control points, in rad, unwrapped, and the bounds that they stay in."""

    yaw: Float[Array, " points"]
    low: Float[Array, " points"]
    high: Float[Array, " points"]


def heading_guesses(
    path: SplinePath,
    limits: tuple[LimitRows, ...],
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
) -> list[HeadingGuess]:
    """Three guesses: the path's own headings, one heading, and the robot's fastest side ahead.

    Args:
        path: Where to go.
        limits: They say in which direction the robot is fastest.
        start_yaw: Heading at the start, in rad; None leaves it open.
        goal_yaw: Heading at the goal, in rad, modulo whole turns; None leaves it open.

    Raises:
        InvalidInput: An end heading is not finite.
    """
    check_end_headings(start_yaw, goal_yaw)
    own = path.control_points[:, 2]
    travel = _directions(path)
    side = _fastest_side(limits, travel[0] - (own[0] if start_yaw is None else start_yaw))
    shapes = [own, np.full_like(own, own[0] if start_yaw is None else start_yaw), travel - side]
    return [_held(shape, start_yaw, goal_yaw) for shape in shapes]


def with_end_headings(
    path: SplinePath, start_yaw: float | None, goal_yaw: float | None
) -> SplinePath:
    """The path with its own headings bent to those at the ends; as it is where none is given.

    Raises:
        InvalidInput: An end heading is not finite.
    """
    check_end_headings(start_yaw, goal_yaw)
    if start_yaw is None and goal_yaw is None:
        return path
    yaw = _held(path.control_points[:, 2], start_yaw, goal_yaw).yaw
    return SplinePath(np.column_stack([path.control_points[:, :2], yaw]))


def check_end_headings(start_yaw: float | None, goal_yaw: float | None) -> None:
    """Refuse headings at the ends, in rad, that are no angles; None is none.

    Raises:
        InvalidInput: One is not finite.
    """
    for name, yaw in (("start", start_yaw), ("goal", goal_yaw)):
        if yaw is not None and not np.isfinite(yaw):
            raise InvalidInput(f"the heading at the {name} must be a finite angle, got {yaw:g} rad")


def _held(
    yaw: Float[Array, " points"], start_yaw: float | None, goal_yaw: float | None
) -> HeadingGuess:
    """The guess shifted by whole turns toward the start, and bent to the given end headings."""
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
    return HeadingGuess(yaw, low, high)


def _directions(path: SplinePath) -> Float[Array, " points"]:
    """Direction of travel at every control point, in rad, unwrapped; as before where it rests."""
    points = path.control_points[:, :2]
    chords = np.vstack([points[1] - points[0], points[2:] - points[:-2], points[-1] - points[-2]])
    moving = np.linalg.norm(chords, axis=1) > 1e-9
    if not moving.any():
        return np.zeros(len(points))
    latest = np.maximum.accumulate(np.where(moving, np.arange(len(points)), np.argmax(moving)))
    return np.unwrap(np.arctan2(chords[latest, 1], chords[latest, 0]))


def _fastest_side(limits: tuple[LimitRows, ...], wanted: float) -> float:
    """Direction in B, in rad, where the robot is fastest; of equal ones the nearest ``wanted``."""
    kind = "speed" if any(group.kind == "speed" for group in limits) else "twist rate"
    angles = np.arange(360) * pi / 180.0
    vectors = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    load = np.zeros(len(angles))
    for group in limits:
        if group.kind == kind:
            shares = group.rows @ vectors
            peak = np.linalg.norm(shares, axis=0) if group.round else np.abs(shares).max(axis=0)
            load = np.maximum(load, peak)
    best = angles[load <= 1.001 * load.min()]
    return float(best[np.argmax(np.cos(best - wanted))])
