"""Headings along a polyline."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import wrap
from omnidrive.planning.polyline import cumulative_length

_STILL = 1e-9
"""Length in m below which a step is rounding error and has no direction."""


def with_headings(
    points: Float[Array, "points 2"],
    start: float | None,
    goal: float | None,
    turn_within: float,
) -> Float[Array, "points 3"]:
    """Add to each point the direction of the step to it, blended into the headings at the ends.

    Args:
        points: x and y in m.
        start: Heading at the first point, in rad; None for the direction of the first step.
        goal: Heading at the last point, in rad; None for the direction of the last step.
        turn_within: Distance from each end over which the heading is blended, in m.

    Returns:
        Columns x, y in m and heading in rad, unwrapped.
    """
    steps = np.diff(points, axis=0)
    moves = (np.abs(steps) > _STILL).any(axis=1)
    if moves.any():  # coincident points keep the direction of the last step
        steps = steps[np.maximum.accumulate(np.where(moves, np.arange(len(steps)), moves.argmax()))]
    yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]) if moves.any() else np.zeros(len(steps)))
    yaw = np.concatenate([yaw[:1], yaw])
    distance = cumulative_length(points)
    if not moves.any():  # turning on the spot
        distance = np.linspace(0.0, 1.0, len(points))
    blend = max(min(turn_within, 0.5 * distance[-1]), 1e-9)
    for end, heading, away in ((0, start, distance), (-1, goal, distance[-1] - distance)):
        if heading is not None:
            turn = wrap(heading - float(yaw[end]))
            yaw = yaw + turn * np.maximum(1.0 - away / blend, 0.0)
    if start is not None:
        yaw = yaw + 2.0 * np.pi * np.round((start - yaw[0]) / (2.0 * np.pi))
    return np.column_stack([points, yaw])
