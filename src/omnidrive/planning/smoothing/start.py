"""Control points to begin with: a spline along a polygon that is proved to keep off obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.planning.clearance import Floor, chord_clearances, piece_clearances
from omnidrive.planning.pieces import pieces

_SHARE = 0.8  # of the polygon's clearance that a spline with rounded corners must keep
_STRAIGHT = 1e-11  # square cells: rounding on one line
TOLERANCE = 0.005  # cells, between spline and chords
_CLOSER = (0.0, 0.25, 0.0625, 0.0)  # of the way to the next point: where a corner's neighbours lie


class Start(NamedTuple):
    """Where the relaxation begins, in cells.

    Attributes:
        control_points: Of a clamped uniform cubic B-spline.
        kept: Distance from obstacles that each piece is proved to keep, at most what was asked.
    """

    control_points: Float[Array, "points 2"]
    kept: Float[Array, " pieces"]


def certified_start(floor: Floor, polygon: Float[Array, "points 2"], clearance: float) -> Start:
    """Spline along a polygon in short steps that keeps as much as is asked or can be had.

    Every piece keeps ``clearance`` (cells) or, where that is less, four fifths of what the polygon
    itself keeps along it. Where the spline on all points does not, the corners get neighbours,
    ever closer; three points in one place are the last resort, and there the spline is the
    polygon itself.
    """
    edges = chord_clearances(floor, polygon, clearance / _SHARE)
    corners, levels = _corners(polygon), np.zeros(len(polygon), int)
    while True:
        control_points, owners = _along(polygon, levels)
        curve = pieces(control_points)
        kept = piece_clearances(floor, curve.places, curve.bends, TOLERANCE, clearance)
        first, last = owners[:-3], owners[3:]
        seen = np.minimum(np.add.outer(first - 1, np.arange(5)), last[:, None])
        had = edges[seen.clip(0, len(edges) - 1)].min(axis=1)
        short = kept < np.minimum(clearance, _SHARE * had)
        near = np.unique(np.add.outer(np.flatnonzero(short), np.arange(4)))
        closer = np.unique(owners[near])
        closer = closer[corners[closer] & (levels[closer] < len(_CLOSER) - 1)]
        if len(closer) == 0:
            return Start(control_points, kept)
        levels[closer] += 1


def _corners(polygon: Float[Array, "points 2"]) -> Bool[Array, " points"]:
    """Where the polygon changes its direction."""
    before, after = np.diff(polygon, axis=0)[:-1], np.diff(polygon, axis=0)[1:]
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    back = (before * after).sum(axis=1) < 0.0
    return np.concatenate([[False], (np.abs(across) > _STRAIGHT) | back, [False]])


def _along(
    polygon: Float[Array, "points 2"], levels: Int[Array, " points"]
) -> tuple[Float[Array, "more 2"], Int[Array, " more"]]:
    """Control points on a polygon, and to which of its points each belongs."""
    owners = np.repeat(np.arange(len(polygon)), np.where(levels > 0, 3, 1))
    place = np.arange(len(owners)) - np.searchsorted(owners, owners)  # 0, 1, 2 at a corner
    toward = np.where(levels[owners] > 0, place - 1, 0)
    share = np.take(_CLOSER, levels[owners])[:, None]
    neighbour = polygon[owners + toward]
    return polygon[owners] + share * (neighbour - polygon[owners]), owners
