"""Headings along a way."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import wrap
from omnidrive.planning.polyline import travelled

_STILL = 1e-9
"""In m: what is shorter is rounding, and has no direction."""


def with_headings(
    points: Float[Array, "points 2"],
    start: float | None,
    goal: float | None,
    turn_within: float,
) -> Float[Array, "points 3"]:
    """Add to each point the direction in which it was reached, bent to the ends' headings.

    Args:
        points: x and y in m.
        start: Heading at the first point, in rad; None for the direction in which it is left.
        goal: Heading at the last point, in rad; None for the direction in which it is reached.
        turn_within: Distance over which the heading turns from an end's to the way's, in m.

    Returns:
        Columns x, y in m and heading in rad, unwrapped.
    """
    steps = np.diff(points, axis=0)
    moves = (np.abs(steps) > _STILL).any(axis=1)
    if moves.any():  # points in one place keep the direction in which it was reached
        steps = steps[np.maximum.accumulate(np.where(moves, np.arange(len(steps)), moves.argmax()))]
    yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]) if moves.any() else np.zeros(len(steps)))
    yaw = np.concatenate([yaw[:1], yaw])
    distance = travelled(points)
    if not moves.any():  # turning on the spot
        distance = np.linspace(0.0, 1.0, len(points))
    reach = max(min(turn_within, 0.5 * distance[-1]), 1e-9)
    for end, heading, away in ((0, start, distance), (-1, goal, distance[-1] - distance)):
        if heading is not None:
            turn = wrap(heading - float(yaw[end]))
            yaw = yaw + turn * np.maximum(1.0 - away / reach, 0.0)
    if start is not None:
        yaw = yaw + 2.0 * np.pi * np.round((start - yaw[0]) / (2.0 * np.pi))
    return np.column_stack([points, yaw])
