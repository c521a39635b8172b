"""Initial spline of the relaxation: along a polygon, with a proved clearance."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.planning.clearance import Obstacles, chord_clearances, piece_clearances
from omnidrive.planning.pieces import pieces

_CLEARANCE_FRACTION = 0.8  # share of the polygon's clearance that rounded corners must keep
_STRAIGHT = 1e-11  # square cells; rounding error of collinear points
TOLERANCE = 0.005  # cells; deviation of the spline from its chords
_NEIGHBOUR_FRACTIONS = (0.0, 0.25, 0.0625, 0.0)
"""Distance of the neighbours of a corner, as a share of the adjacent edge, by level."""


class InitialSpline(NamedTuple):
    """Spline with proved clearances, in cells.

    Attributes:
        control_points: Control points of a clamped uniform cubic B-spline.
        clearances: Proved distance of each piece from obstacles, at most the required clearance.
    """

    control_points: Float[Array, "points 2"]
    clearances: Float[Array, " pieces"]


def certified_initial_spline(
    obstacles: Obstacles,
    polygon: Float[Array, "points 2"],
    clearance: float,
    is_over: Callable[[], bool] | None = None,
) -> InitialSpline | None:
    """Return a spline along a polygon in short steps with the required or attainable clearance.

    Every piece keeps ``clearance`` (cells) or, if that is less, four fifths of the clearance of the
    polygon along it. Where the spline through all points violates this, the control point at a
    corner is replaced by three: the corner and a neighbour on each adjacent edge. The neighbours
    approach the corner until, in the limit of three coincident points, the spline follows the
    polygon. None if ``is_over`` before.
    """
    edges = chord_clearances(obstacles, polygon, clearance / _CLEARANCE_FRACTION)
    corners, levels = _corners(polygon), np.zeros(len(polygon), int)
    while is_over is None or not is_over():
        control_points, vertices = along(polygon, levels)
        curve = pieces(control_points)
        clearances = piece_clearances(
            obstacles, curve.positions, curve.second_derivatives, TOLERANCE, clearance
        )
        first, last = vertices[:-3], vertices[3:]
        edge_indices = np.minimum(np.add.outer(first - 1, np.arange(5)), last[:, None])
        available = edges[edge_indices.clip(0, len(edges) - 1)].min(axis=1)
        violating = clearances < np.minimum(clearance, _CLEARANCE_FRACTION * available)
        near = np.unique(np.add.outer(np.flatnonzero(violating), np.arange(4)))
        closer = np.unique(vertices[near])
        closer = closer[corners[closer] & (levels[closer] < len(_NEIGHBOUR_FRACTIONS) - 1)]
        if len(closer) == 0:
            return InitialSpline(control_points, clearances)
        levels[closer] += 1
    return None


def _corners(polygon: Float[Array, "points 2"]) -> Bool[Array, " points"]:
    """Whether the polygon changes its direction at each point."""
    before, after = np.diff(polygon, axis=0)[:-1], np.diff(polygon, axis=0)[1:]
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    back = (before * after).sum(axis=1) < 0.0
    return np.concatenate([[False], (np.abs(across) > _STRAIGHT) | back, [False]])


def along(
    polygon: Float[Array, "points 2"], levels: Int[Array, " points"]
) -> tuple[Float[Array, "more 2"], Int[Array, " more"]]:
    """Return control points on a polygon, and the index of the polygon vertex of each."""
    vertices = np.repeat(np.arange(len(polygon)), np.where(levels > 0, 3, 1))
    rank = np.arange(len(vertices)) - np.searchsorted(vertices, vertices)  # 0, 1, 2 at a corner
    toward = np.where(levels[vertices] > 0, rank - 1, 0)
    share = np.take(_NEIGHBOUR_FRACTIONS, levels[vertices])[:, None]
    neighbour = polygon[vertices + toward]
    return polygon[vertices] + share * (neighbour - polygon[vertices]), vertices
