"""Smoothing of a sequence of poses to a spline with a proved clearance of the polygon."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int64

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.planning.footprint.motion_proof import (
    Motion,
    Squares,
    keeps_margin,
    proved_margins,
)
from omnidrive.planning.pieces import KnotWeights, knot_weights, pieces
from omnidrive.planning.smoothing.initial_spline import along
from omnidrive.planning.smoothing.relaxation import (
    move_weights_of,
    second_derivative_change,
    update_knots,
)

_STRIDES = (16, 8, 4, 2, 1)  # distances between the centres of consecutive moves, in control points
_CYCLES = 6  # over all strides
_LOOK = 16  # moves between two looks at the clock
_SMALLEST = 1e-4  # cells or radii; shorter moves are skipped
_STEP_FRACTIONS = (1.0, 0.35, 0.12)  # of the best step, tried in turn
_MAX_STEP = 1.5  # cells; longer steps are subdivided
_FRACTION = 0.8  # share of the proved margin of the polyline that smoothed pieces must keep
_LADDER = np.array([1.0, 0.5, 0.25, 0.1, 0.02]) / _FRACTION  # margins to prove, by that required
_LEAST = 1e-6  # cells; required of every piece that is not the polyline
_LEVELS = 3  # ways to round a corner; the last is the corner itself
HALVINGS = 5
"""Of a piece, to prove that it keeps its margin during the relaxation."""


class PoseSpline(NamedTuple):
    """Control points (x, y, yaw) of a spline, its values at the knots, and the margins of pieces.

    The margin of a piece is 0 where it follows the polyline of the search.
    """

    control_points: Float[Array, "points 3"]
    motion: Motion
    weights: KnotWeights
    margins: Float[Array, " pieces"]


def smooth_poses(
    squares: Squares,
    shape: Motion,
    poses: Float[Array, "poses 3"],
    margin: float,
    is_over: Callable[[], bool] = lambda: False,
) -> tuple[Float[Array, "points 3"], bool]:
    """Return the control points (cells, rad) of a smooth spline along poses, and whether it ended.

    As in :mod:`omnidrive.planning.smoothing`: coordinate descent on the sum of the squared second
    derivatives, in which a move is accepted only if every piece that it changes is proved to keep
    its margin. Where no rounded corner is proved, three coincident control points keep the corner,
    and the spline follows the polyline, which is free.

    Args:
        squares: The occupied squares.
        shape: The polygon; its poses are not used.
        poses: Poses of the polyline; the motion along each edge is free.
        margin: Required margin in cells where the polyline itself keeps 5/4 of it, otherwise about
            four fifths of the margin of the polyline.
        is_over: Whether the time of the smoothing is over.
    """
    polyline = subdivided(poses, shape.radius)
    spline = _initial_spline(squares, shape, polyline, margin)
    weights = {stride: move_weights_of(stride) for stride in _STRIDES}
    count = len(spline.control_points)
    strides = [stride for stride in _STRIDES if 4 * stride <= count or stride == 1]
    for cycle in range(_CYCLES):
        accepted = 0
        for stride in strides:
            moved = np.arange(1, count - 1, stride)
            moved = count - 1 - moved if cycle % 2 == 1 else moved
            for first in range(0, len(moved), _LOOK):
                if is_over():
                    return spline.control_points, False
                part = moved[first : first + _LOOK]
                accepted += _sweep(spline, squares, weights[stride], part)
        if accepted == 0:
            break
    return spline.control_points, True


def subdivided(poses: Float[Array, "poses 3"], radius: float) -> Float[Array, "more 3"]:
    """Return a polyline through the corners of ``poses`` in at least 3 steps of about a cell.

    The length of a turn is that of the farthest corner's way, at ``radius``.
    """
    poses = poses[np.concatenate([[True], np.any(np.diff(poses, axis=0) != 0.0, axis=1)])]
    if len(poses) == 1:
        return np.repeat(poses, 4, axis=0)
    steps = np.diff(poses, axis=0)
    directions = steps * (1.0, 1.0, radius)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    changes = np.any(np.abs(np.diff(directions, axis=0)) > 1e-9, axis=1)
    poses = poses[np.concatenate([[True], changes, [True]])]
    steps = np.diff(poses, axis=0)
    lengths = np.linalg.norm(steps * (1.0, 1.0, radius), axis=1)
    parts = np.where(lengths > _MAX_STEP, np.ceil(lengths), 1.0)
    parts = np.maximum(parts, np.ceil(3 / len(steps))).astype(int)
    step = np.repeat(np.arange(len(steps)), parts)
    first = np.concatenate([[0], np.cumsum(parts)[:-1]])[step]
    share = (np.arange(len(step)) - first) / parts[step]
    return np.vstack([poses[step] + share[:, None] * steps[step], poses[-1:]])


def _initial_spline(
    squares: Squares, shape: Motion, polyline: Float[Array, "points 3"], margin: float
) -> PoseSpline:
    """Return a spline along the polyline whose corners are as round as the margins allow."""
    edges = proved_margins(
        squares, shape._replace(poses=polyline, second_derivatives=np.zeros_like(polyline)),
        margin * _LADDER, HALVINGS,
    )  # fmt: skip
    changes, levels = _direction_changes(polyline), np.zeros(len(polyline), int)
    while True:
        control_points, vertices = along(polyline, levels)
        curve = pieces(control_points)
        motion = shape._replace(
            poses=np.ascontiguousarray(curve.positions),
            second_derivatives=np.ascontiguousarray(curve.second_derivatives),
        )
        first, last = vertices[:-3], vertices[3:]
        near = np.minimum(np.add.outer(first - 1, np.arange(5)), last[:, None])
        required = _FRACTION * edges[near.clip(0, len(edges) - 1)].min(axis=1)
        required = np.minimum(np.maximum(required, _LEAST), margin)
        violating = _violating(squares, motion, required)
        around = np.unique(np.add.outer(np.flatnonzero(violating), np.arange(4)))
        closer = np.unique(vertices[around])
        closer = closer[changes[closer] & (levels[closer] < _LEVELS)]
        if len(closer) == 0:
            margins = np.where(violating, 0.0, required)
            return PoseSpline(control_points, motion, knot_weights(len(control_points)), margins)
        levels[closer] += 1


@compiled
def _violating(
    squares: Squares, motion: Motion, margins: Float[Array, " pieces"]
) -> Bool[Array, " pieces"]:
    """Return for each piece whether its margin is not proved."""
    found = np.empty(len(margins), np.bool_)
    for j in range(len(margins)):
        found[j] = not keeps_margin(squares, motion, j, margins[j], HALVINGS)
    return found


def _direction_changes(polyline: Float[Array, "points 3"]) -> Bool[Array, " points"]:
    """Whether the polyline changes its direction at each point."""
    steps = np.diff(polyline, axis=0)
    directions = steps / np.maximum(np.linalg.norm(steps, axis=1), 1e-300)[:, None]
    changes = np.any(np.abs(np.diff(directions, axis=0)) > 1e-9, axis=1)
    return np.concatenate([[False], changes, [False]])


@compiled
def _sweep(
    spline: PoseSpline,
    squares: Squares,
    move_weights: Float[Array, " window"],
    middles: Int64[Array, " moves"],
) -> int:
    """Try a move about each of some inner control points; return how many were accepted."""
    accepted = 0
    for middle in middles:
        if _move(spline, squares, move_weights, middle):
            accepted += 1
    return accepted


@compiled
def _move(
    spline: PoseSpline, squares: Squares, move_weights: Float[Array, " window"], middle: int
) -> bool:
    """Move the control points about ``middle`` as far as proved; return whether they moved."""
    reach, last_knot = len(move_weights) // 2, len(spline.motion.poses) - 1
    first, last = max(1, middle - reach), min(last_knot + 1, middle + reach)
    left = middle - reach  # control point of the first weight
    low, high = max(first - 2, 0), min(last, last_knot)
    for j in range(max(low - 1, 0), min(high, last_knot - 1) + 1):
        if spline.margins[j] == 0.0 and len(move_weights) > 1:
            return False  # only a piece's own control points may leave the polyline
    step = _best_step(spline, move_weights, first, last, left)
    if abs(step[0]) + abs(step[1]) + spline.motion.radius * abs(step[2]) < _SMALLEST:
        return False
    before = spline.control_points[first : last + 1].copy()
    for size in _STEP_FRACTIONS:
        for k in range(first, last + 1):
            share = size * move_weights[k - left]
            for axis in range(3):
                moved = before[k - first, axis] + share * step[axis]
                spline.control_points[k, axis] = moved
        _update(spline, low, high)
        if _keeps_margins(spline, squares, max(low - 1, 0), min(high, last_knot - 1)):
            return True
    spline.control_points[first : last + 1] = before
    _update(spline, low, high)
    return False


@compiled
def _best_step(
    spline: PoseSpline, move_weights: Float[Array, " window"], first: int, last: int, left: int
) -> Float[Array, " xyyaw"]:
    """Return the step (cells, rad) that minimises the sum of the squared second derivatives.

    See the function of this name in :mod:`omnidrive.planning.smoothing.relaxation`.
    """
    square, step = 0.0, np.zeros(3)
    second = spline.motion.second_derivatives
    for j in range(max(first - 2, 0), min(last + 1, len(second))):
        change = second_derivative_change(spline.weights, move_weights, j, first, last, left)
        square += change * change
        for axis in range(3):
            step[axis] -= change * second[j, axis]
    return step / square if square > 0.0 else step


@compiled
def _update(spline: PoseSpline, first: int, last: int) -> None:
    """Update poses and second derivatives at the knots ``first`` to ``last``."""
    motion = spline.motion
    update_knots(
        spline.weights, spline.control_points, motion.poses, motion.second_derivatives, first, last
    )


@compiled
def _keeps_margins(spline: PoseSpline, squares: Squares, first: int, last: int) -> bool:
    """Whether the pieces ``first`` to ``last`` are proved to keep their margin."""
    for j in range(first, last + 1):
        if not keeps_margin(squares, spline.motion, j, max(spline.margins[j], _LEAST), HALVINGS):
            return False
    return True
