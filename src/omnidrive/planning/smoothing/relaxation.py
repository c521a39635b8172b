"""Relaxation of a spline's control points toward low curvature within a proved clearance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.compiled import compiled
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.clearance import piece_clearance
from omnidrive.planning.pieces import KnotWeights, knot_weights
from omnidrive.planning.smoothing.start import Start

Array = np.ndarray

_STRIDES = (16, 8, 4, 2, 1)  # control points between the middles of neighbouring moves
_CYCLES = 10  # through all of them
_SMALLEST = 1e-4  # cells; shorter moves are left out
_TRIES = (1.0, 0.35, 0.12)  # of the best move
_TOLERANCE = 0.005  # cells, between spline and chords


class _Spline(NamedTuple):
    """Control points, and what the spline is at its knots; in cells."""

    control_points: Float[Array, "points 2"]
    points: Float[Array, "knots 2"]
    bends: Float[Array, "knots 2"]
    weights: KnotWeights


class _Floor(NamedTuple):
    """Where the spline may be: squares to keep off, and the distance for each piece, in cells."""

    occupied: Bool[Array, "rows cols"]
    walled: bool
    kept: Float[Array, " pieces"]


def relaxed(grid: OccupancyGrid, start: Start, cycles=_CYCLES) -> Float[Array, "points 2"]:
    n = len(start.control_points)
    spline = _Spline(start.control_points.copy(), np.empty((n - 2, 2)), np.empty((n - 2, 2)), knot_weights(n))
    floor = _Floor(grid.occupied, grid.walled, start.kept)
    for cycle in range(cycles):
        moves = 0
        for stride in _STRIDES:
            if 4 * stride <= n or stride == 1:
                moves += _sweep(spline, floor, _bump(stride), stride, cycle % 2 == 1)
        if moves == 0:
            break
    return spline.control_points


def _bump(stride: int) -> Float[Array, " window"]:
    """Shares of neighbouring control points in a move: a cubic B-spline over four strides."""
    if stride == 1:
        return np.ones(1)
    x = np.abs(np.arange(1 - 2 * stride, 2 * stride)) / stride
    return np.where(x < 1.0, 1.0 - 1.5 * x**2 + 0.75 * x**3, 0.25 * (2.0 - x) ** 3)


@compiled
def _sweep(spline, floor, bump, stride, backward):
    n = len(spline.control_points)
    _refresh(spline, 0, n - 3)
    moves = 0
    for k in range(1, n - 1, stride):
        if _nudge(spline, floor, n - 1 - k if backward else k, bump):
            moves += 1
    return moves


@compiled
def _refresh(spline, first, last):
    for j in range(first, last + 1):
        for c in range(2):
            p = q = 0.0
            for k in range(3):
                p += spline.weights.points[j, k] * spline.control_points[j + k, c]
                q += spline.weights.bends[j, k] * spline.control_points[j + k, c]
            spline.points[j, c], spline.bends[j, c] = p, q


@compiled
def _step(spline, bump, first, last, middle):
    top = fx = fy = 0.0
    for j in range(max(first - 2, 0), min(last + 1, len(spline.bends))):
        share = 0.0
        for k in range(3):
            at = j + k
            if first <= at <= last:
                share += spline.weights.bends[j, k] * bump[at - middle]
        bx, by = spline.bends[j]
        top += share * share
        fx -= share * bx
        fy -= share * by
    if top <= 0.0:
        return 0.0, 0.0
    return fx / top, fy / top


@compiled
def _nudge(spline, floor, i, bump):
    n, reach = len(spline.control_points), len(bump) // 2
    first, last = max(1, i - reach), min(n - 2, i + reach)
    dx, dy = _step(spline, bump, first, last, i - reach)
    if abs(dx) + abs(dy) < _SMALLEST:
        return False
    before = spline.control_points[first : last + 1].copy()
    low, high = max(first - 2, 0), min(last, n - 3)
    for size in _TRIES:
        for k in range(first, last + 1):
            share = size * bump[k - i + reach]
            spline.control_points[k, 0] = before[k - first, 0] + share * dx
            spline.control_points[k, 1] = before[k - first, 1] + share * dy
        _refresh(spline, low, high)
        if _is_kept(spline, floor, max(low - 1, 0), min(high, n - 4)):
            return True
    spline.control_points[first : last + 1] = before
    _refresh(spline, low, high)
    return False


@compiled
def _is_kept(spline, floor, first, last):
    for j in range(first, last + 1):
        bound, _ = piece_clearance(floor.occupied, floor.walled, spline.points, spline.bends, j, _TOLERANCE, floor.kept[j])
        if bound < floor.kept[j]:
            return False
    return True
