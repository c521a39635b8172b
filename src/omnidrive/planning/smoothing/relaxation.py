"""Relaxation of a spline's control points toward low curvature within a proved clearance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.planning.clearance import Floor, piece_at, piece_clearance
from omnidrive.planning.pieces import KnotWeights, knot_weights
from omnidrive.planning.smoothing.start import TOLERANCE, Start

_STRIDES = (16, 8, 4, 2, 1)  # control points from one move's middle to the next's
_CYCLES = 10  # through all strides: the curvature hardly falls after
_SMALLEST = 1e-4  # cells; shorter moves are left out
_SHARES = (1.0, 0.35, 0.12)  # of the best move, tried in turn


class _Spline(NamedTuple):
    """Control points, and what the spline is at its knots; in cells."""

    control_points: Float[Array, "points 2"]
    places: Float[Array, "knots 2"]
    bends: Float[Array, "knots 2"]
    weights: KnotWeights
    kept: Float[Array, " pieces"]
    """Distance from obstacles that each piece must keep."""


def relaxed(floor: Floor, start: Start) -> Float[Array, "points 2"]:
    """Control points (cells) of a smoother spline that keeps all that ``start`` keeps.

    Minimises the sum of the squared second derivatives at the knots by moves of neighbouring
    control points, wide ones first. Each goes to the least sum along its direction, or part of
    the way, and is taken only if every piece that it changes is proved to keep its distance. So
    the sum only falls, and the proof of the whole curve holds after every move. The ends stay.
    """
    count = len(start.control_points)
    spline = _Spline(
        start.control_points.copy(),
        np.empty((count - 2, 2)),
        np.empty((count - 2, 2)),
        knot_weights(count),
        start.kept,
    )
    _update(spline, 0, count - 3)
    strides = [stride for stride in _STRIDES if 4 * stride <= count or stride == 1]
    shares = {stride: _shares(stride) for stride in strides}
    for cycle in range(_CYCLES):
        taken = 0
        for stride in strides:
            taken += _sweep(spline, floor, shares[stride], stride, cycle % 2 == 1)
        if taken == 0:
            break
    return spline.control_points


def _shares(stride: int) -> Float[Array, " window"]:
    """Shares of neighbouring control points in a move: a cubic B-spline over four strides."""
    if stride == 1:
        return np.ones(1)
    x = np.abs(np.arange(1 - 2 * stride, 2 * stride)) / stride
    return np.where(x < 1.0, 1.0 - 1.5 * x**2 + 0.75 * x**3, 0.25 * (2.0 - x) ** 3)


@compiled
def _sweep(
    spline: _Spline, floor: Floor, shares: Float[Array, " window"], stride: int, backward: bool
) -> int:
    """Try a move about every ``stride``-th control point but the ends; how many were taken."""
    last = len(spline.control_points) - 1
    taken = 0
    for k in range(1, last, stride):
        if _move(spline, floor, shares, last - k if backward else k):
            taken += 1
    return taken


@compiled
def _move(spline: _Spline, floor: Floor, shares: Float[Array, " window"], middle: int) -> bool:
    """Move the control points about ``middle`` as far as is proved; False if they stay."""
    reach, last_knot = len(shares) // 2, len(spline.places) - 1
    first, last = max(1, middle - reach), min(last_knot + 1, middle + reach)
    left = middle - reach  # where the shares begin
    dx, dy = _best_step(spline, shares, first, last, left)
    if abs(dx) + abs(dy) < _SMALLEST:
        return False
    before = spline.control_points[first : last + 1].copy()
    low, high = max(first - 2, 0), min(last, last_knot)
    for size in _SHARES:
        for k in range(first, last + 1):
            share = size * shares[k - left]
            spline.control_points[k, 0] = before[k - first, 0] + share * dx
            spline.control_points[k, 1] = before[k - first, 1] + share * dy
        _update(spline, low, high)
        if _is_kept(spline, floor, max(low - 1, 0), min(high, last_knot - 1)):
            return True
    spline.control_points[first : last + 1] = before
    _update(spline, low, high)
    return False


@compiled
def _best_step(
    spline: _Spline, shares: Float[Array, " window"], first: int, last: int, left: int
) -> tuple[float, float]:
    """Step of the shares that leaves the least sum of squared second derivatives, in cells.

    Args:
        spline: The spline.
        shares: Of the control points from ``left`` on.
        first: First control point that moves.
        last: Last control point that moves.
        left: See ``shares``.
    """
    square = x = y = 0.0
    for j in range(max(first - 2, 0), min(last + 1, len(spline.bends))):
        change = 0.0  # of the second derivative at knot j with the step
        for k in range(max(first - j, 0), min(last - j, 2) + 1):
            change += spline.weights.bends[j, k] * shares[j + k - left]
        square += change * change
        x -= change * spline.bends[j, 0]
        y -= change * spline.bends[j, 1]
    return (x / square, y / square) if square > 0.0 else (0.0, 0.0)


@compiled
def _update(spline: _Spline, first: int, last: int) -> None:
    """Places and second derivatives at the knots from ``first`` to ``last``."""
    for j in range(first, last + 1):
        for axis in range(2):
            place = bend = 0.0
            for k in range(3):
                place += spline.weights.places[j, k] * spline.control_points[j + k, axis]
                bend += spline.weights.bends[j, k] * spline.control_points[j + k, axis]
            spline.places[j, axis], spline.bends[j, axis] = place, bend


@compiled
def _is_kept(spline: _Spline, floor: Floor, first: int, last: int) -> bool:
    """Whether the pieces from ``first`` to ``last`` are proved to keep their distance."""
    for j in range(first, last + 1):
        piece = piece_at(spline.places, spline.bends, j)
        bound, _ = piece_clearance(floor, piece, TOLERANCE, spline.kept[j])
        if bound < spline.kept[j]:
            return False
    return True
