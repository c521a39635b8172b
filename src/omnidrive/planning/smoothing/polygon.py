"""The polygon that a search found, in cells: checked, and ready to carry a spline."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.planning.clearance import Floor, chord_clearances

_LONGEST = 1.5  # cells; longer steps are divided
_MOST_POINTS = 1_000_000


def free_polygon(floor: Floor, points: Float[Array, "points 2"]) -> Float[Array, "more 2"]:
    """The polygon through ``points`` (cells), which enters no obstacle, in short steps.

    An end may lie anywhere in its cell. If the step from it crosses a corner of an obstacle, the
    polygon passes the centre of that cell first, from where the search saw the next one.

    Raises:
        InvalidInput: It enters an obstacle elsewhere, or is too long.
    """
    polygon = divided(points)
    if _entered(floor, polygon) is None:
        return polygon
    start, goal = np.floor(points[:1]) + 0.5, np.floor(points[-1:]) + 0.5
    polygon = divided(np.vstack([points[:1], start, points[1:-1], goal, points[-1:]]))
    entered = _entered(floor, polygon)
    if entered is None:
        return polygon
    col, row = np.floor(polygon[entered]).astype(int).tolist()
    raise InvalidInput(
        f"the way to smooth enters an obstacle by the cell in row {row}, column {col}; "
        "it must lie in free cells"
    )


def divided(points: Float[Array, "points 2"]) -> Float[Array, "more 2"]:
    """The same polygon with points at most 1.5 cells apart, none twice, and at least four.

    Raises:
        InvalidInput: That would be more than a million.
    """
    apart = np.any(np.diff(points, axis=0) != 0.0, axis=1)
    points = points[np.concatenate([[True], apart])]
    if len(points) == 1:
        return np.repeat(points, 4, axis=0)
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    parts = np.where(lengths > _LONGEST, np.ceil(lengths), 1.0)
    parts = np.maximum(parts, ceil(3 / len(steps)))
    if parts.sum() > _MOST_POINTS:
        raise InvalidInput(
            f"the way to smooth is {lengths.sum():.3g} cells long; the most is {_MOST_POINTS}"
        )
    step = np.repeat(np.arange(len(steps)), parts.astype(int))
    first = np.concatenate([[0], np.cumsum(parts)[:-1]])[step]
    share = (np.arange(len(step)) - first) / parts[step]
    return np.vstack([points[step] + share[:, None] * steps[step], points[-1:]])


def _entered(floor: Floor, polygon: Float[Array, "points 2"]) -> int | None:
    """Number of the first edge that enters an obstacle."""
    inside = np.flatnonzero(chord_clearances(floor, polygon, 0.0) < 0.0)
    return int(inside[0]) if len(inside) else None
