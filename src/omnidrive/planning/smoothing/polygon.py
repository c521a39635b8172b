"""Preparation of a grid path for smoothing: collision check and subdivision, in cells."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.planning.clearance import Obstacles, chord_clearances
from omnidrive.planning.grid_frame import GridFrame

_MAX_STEP = 1.5  # cells; longer steps are subdivided
_MAX_POINTS = 1_000_000


def free_polygon(
    obstacles: Obstacles, points: Float[Array, "points 2"], frame: GridFrame
) -> Float[Array, "more 2"]:
    """Return the polygon through ``points`` (cells) in short steps, after a collision check.

    The first and last point may lie anywhere in their cells. If the step from an end crosses the
    corner of an obstacle, the centre of the end's cell is inserted, from which the search has
    checked the next step.

    Args:
        obstacles: The occupied cells.
        points: Corners of the polygon, in cells.
        frame: Frame of the cells, for messages in W.

    Raises:
        InvalidInput: The polygon enters an obstacle elsewhere, or is too long.
    """
    polygon = subdivide(points)
    if _first_blocked_edge(obstacles, polygon) is None:
        return polygon
    start, goal = np.floor(points[:1]) + 0.5, np.floor(points[-1:]) + 0.5
    polygon = subdivide(np.vstack([points[:1], start, points[1:-1], goal, points[-1:]]))
    entered = _first_blocked_edge(obstacles, polygon)
    if entered is None:
        return polygon
    x, y = frame.world(polygon[entered : entered + 1])[0].tolist()
    raise InvalidInput(
        f"the path to smooth enters an obstacle near ({x:g}, {y:g}) m; it must lie in free cells"
    )


def subdivide(points: Float[Array, "points 2"]) -> Float[Array, "more 2"]:
    """Return the polygon without repeated points, in at least 3 steps of at most 1.5 cells.

    Raises:
        InvalidInput: The result would have more than a million points.
    """
    apart = np.any(np.diff(points, axis=0) != 0.0, axis=1)
    points = points[np.concatenate([[True], apart])]
    if len(points) == 1:
        return np.repeat(points, 4, axis=0)
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    parts = np.where(lengths > _MAX_STEP, np.ceil(lengths), 1.0)
    parts = np.maximum(parts, ceil(3 / len(steps)))
    if parts.sum() > _MAX_POINTS:
        raise InvalidInput(
            f"the path to smooth is {lengths.sum():.3g} cells long; the maximum is {_MAX_POINTS}"
        )
    step = np.repeat(np.arange(len(steps)), parts.astype(int))
    first = np.concatenate([[0], np.cumsum(parts)[:-1]])[step]
    share = (np.arange(len(step)) - first) / parts[step]
    return np.vstack([points[step] + share[:, None] * steps[step], points[-1:]])


def _first_blocked_edge(obstacles: Obstacles, polygon: Float[Array, "points 2"]) -> int | None:
    """Return the index of the first edge that enters an obstacle, None if there is none."""
    inside = np.flatnonzero(chord_clearances(obstacles, polygon, 0.0) < 0.0)
    return int(inside[0]) if len(inside) else None
