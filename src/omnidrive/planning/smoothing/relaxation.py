"""Coordinate descent on a spline's control points with a proved clearance."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.clearance import Obstacles, Piece, piece_at, piece_clearance
from omnidrive.planning.pieces import KnotWeights, knot_weights
from omnidrive.planning.smoothing.initial_spline import TOLERANCE, InitialSpline

STRIDES, WIDE_STRIDES = (16, 8, 4, 2, 1), (64, 32, 16, 8, 4, 2, 1)
"""Distances between the centres of consecutive moves, in control points."""
_SMALLEST = 1e-4  # cells; shorter moves are skipped
_STEP_FRACTIONS = (1.0, 0.35, 0.12)  # of the best step, tried in turn
_PART = 12 * STRIDES[0]  # control points between two looks at the clock
_SAMPLES = 4  # points of a piece at which its cost is evaluated
_AROUND = 8  # pieces on both sides over which the costs of the initial spline are averaged
COST_TOLERANCE = (0.15, 0.05)
"""Largest rise of a piece's mean cost above that of the initial spline around it: a share of
``1 + cost``, and an amount."""


class _Spline(NamedTuple):
    """Control points of the spline and its values at the knots, in cells."""

    control_points: Float[Array, "points 2"]
    positions: Float[Array, "knots 2"]
    second_derivatives: Float[Array, "knots 2"]
    weights: KnotWeights
    clearances: Float[Array, " pieces"]
    """Distance from obstacles that each piece must keep."""
    costs: Float32[Array, "rows cols"]
    """Cost of each cell; empty without costs."""
    cost_limits: Float[Array, " pieces"]
    """Largest mean cost of each piece."""
    second_weights: Float[Array, " knots"]
    """Weights of the squared second derivatives at the knots in the sum."""
    third_weights: Float[Array, " pieces"]
    """Weights of the squared third derivatives of the pieces; empty: none of them counts."""


class Relaxation:
    """Coordinate descent on a spline that keeps its proved clearance.

    It lowers the weighted sum of the squared second derivatives at the knots, and of the squared
    third derivatives of the pieces if they have weights: each move shifts a window of neighbouring
    control points to the minimum along its direction, or a fraction of it, wide windows first. A
    move is accepted only if every piece that it changes is proved to keep its clearance. The sum is
    therefore non-increasing, and the proof holds for the whole curve after every move. The end
    points are fixed.

    With costs a move is also rejected if it raises the mean cost of a piece above that of the
    initial spline around it by more than :data:`COST_TOLERANCE`: the path keeps to the cells of low
    cost that the search has chosen.

    Args:
        obstacles: Occupied cells.
        start: Initial spline.
        costs: Cost of each cell; empty: none.
        strides: Distances between the centres of consecutive moves, in control points.
    """

    def __init__(
        self,
        obstacles: Obstacles,
        start: InitialSpline,
        costs: Float32[Array, "rows cols"],
        strides: tuple[int, ...],
    ) -> None:
        count = len(start.control_points)
        self._obstacles = obstacles
        self._spline = _Spline(
            start.control_points.copy(),
            np.empty((count - 2, 2)),
            np.empty((count - 2, 2)),
            knot_weights(count),
            start.clearances,
            costs,
            np.empty(count - 3),
            np.ones(count - 2),
            np.empty(0),
        )
        _update(self._spline, 0, count - 3)
        if costs.size > 0:
            _set_cost_limits(self._spline)
        strides = tuple(stride for stride in strides if 4 * stride <= count or stride == 1)
        self._moves = {stride: move_weights_of(stride) for stride in strides}

    @property
    def control_points(self) -> Float[Array, "points 2"]:
        """Control points so far, in cells."""
        return self._spline.control_points

    def set_weights(self, second: Float[Array, " knots"], third: Float[Array, " pieces"]) -> None:
        """Set the weights of the squared second and third derivatives."""
        self._spline = self._spline._replace(second_weights=second, third_weights=third)

    def run(self, cycles: int, is_over: Callable[[], bool] | None = None) -> bool:
        """Try up to ``cycles`` moves about each control point with each stride.

        Returns whether it ended before ``is_over``, which is called every few hundred moves: the
        spline is certified after each.
        """
        count = len(self.control_points)
        for cycle in range(cycles):
            accepted = 0
            for stride, weights in self._moves.items():
                part = count - 2 if is_over is None else _PART
                for first in range(1, count - 1, part):
                    if is_over is not None and is_over():
                        return False
                    accepted += _sweep(
                        self._spline, self._obstacles, weights, stride, cycle % 2 == 1,
                        first, min(first + part, count - 1),
                    )  # fmt: skip
            if accepted == 0:
                break
        return True


def move_weights_of(stride: int) -> Float[Array, " window"]:
    """Return the weights of the control points in a move: a cubic B-spline over four strides."""
    if stride == 1:
        return np.ones(1)
    x = np.abs(np.arange(1 - 2 * stride, 2 * stride)) / stride
    return np.where(x < 1.0, 1.0 - 1.5 * x**2 + 0.75 * x**3, 0.25 * (2.0 - x) ** 3)


@compiled
def _sweep(  # noqa: PLR0917
    spline: _Spline,
    obstacles: Obstacles,
    move_weights: Float[Array, " window"],
    stride: int,
    backward: bool,
    first: int,
    end: int,
) -> int:
    """Try a move about every ``stride``-th inner control point; return how many were accepted.

    The control points are those from ``first`` to before ``end``, backward counted from the last.
    """
    last = len(spline.control_points) - 1
    accepted = 0
    for k in range(first, end, stride):
        if _move(spline, obstacles, move_weights, last - k if backward else k):
            accepted += 1
    return accepted


@compiled
def _move(
    spline: _Spline, obstacles: Obstacles, move_weights: Float[Array, " window"], middle: int
) -> bool:
    """Move the control points about ``middle`` as far as proved; return whether they moved."""
    reach, last_knot = len(move_weights) // 2, len(spline.positions) - 1
    first, last = max(1, middle - reach), min(last_knot + 1, middle + reach)
    left = middle - reach  # control point of the first weight
    dx, dy = _best_step(spline, move_weights, first, last, left)
    if abs(dx) + abs(dy) < _SMALLEST:
        return False
    before = spline.control_points[first : last + 1].copy()
    low, high = max(first - 2, 0), min(last, last_knot)
    for size in _STEP_FRACTIONS:
        for k in range(first, last + 1):
            share = size * move_weights[k - left]
            spline.control_points[k, 0] = before[k - first, 0] + share * dx
            spline.control_points[k, 1] = before[k - first, 1] + share * dy
        _update(spline, low, high)
        if _keeps_clearance(spline, obstacles, max(low - 1, 0), min(high, last_knot - 1)):
            return True
    spline.control_points[first : last + 1] = before
    _update(spline, low, high)
    return False


@compiled
def _best_step(
    spline: _Spline, move_weights: Float[Array, " window"], first: int, last: int, left: int
) -> tuple[float, float]:
    """Return the step (cells) that minimises the sum of the squared second derivatives.

    Args:
        spline: The spline.
        move_weights: Weights of the control points, the first of which is ``left``.
        first: First control point that moves.
        last: Last control point that moves.
        left: Control point of the first weight.
    """
    second, thirds = spline.second_derivatives, spline.third_weights
    square = x = y = before = 0.0
    for j in range(max(first - 2, 0), min(last + 1, len(second))):
        change = second_derivative_change(spline.weights, move_weights, j, first, last, left)
        weighted = spline.second_weights[j] * change
        square += weighted * change
        x -= weighted * second[j, 0]
        y -= weighted * second[j, 1]
        if thirds.size > 0 and j > 0:
            weighted = thirds[j - 1] * (change - before)
            square += weighted * (change - before)
            x -= weighted * (second[j, 0] - second[j - 1, 0])
            y -= weighted * (second[j, 1] - second[j - 1, 1])
        before = change
    return (x / square, y / square) if square > 0.0 else (0.0, 0.0)


@inlined
def second_derivative_change(  # noqa: PLR0917
    weights: KnotWeights,
    move_weights: Float[Array, " window"],
    j: int,
    first: int,
    last: int,
    left: int,
) -> float:
    """Return the derivative of the second derivative at knot j with respect to the step."""
    change = 0.0
    for k in range(max(first - j, 0), min(last - j, 2) + 1):
        change += weights.second_derivatives[j, k] * move_weights[j + k - left]
    return change


@compiled
def _update(spline: _Spline, first: int, last: int) -> None:
    """Update positions and second derivatives at the knots ``first`` to ``last``."""
    update_knots(
        spline.weights, spline.control_points, spline.positions, spline.second_derivatives,
        first, last,
    )  # fmt: skip


@inlined
def update_knots(  # noqa: PLR0917
    weights: KnotWeights,
    control_points: Float[Array, "points axes"],
    positions: Float[Array, "knots axes"],
    second_derivatives: Float[Array, "knots axes"],
    first: int,
    last: int,
) -> None:
    """Fill in positions and second derivatives at the knots ``first`` to ``last``."""
    for j in range(first, last + 1):
        for axis in range(control_points.shape[1]):
            position = second = 0.0
            for k in range(3):
                position += weights.positions[j, k] * control_points[j + k, axis]
                second += weights.second_derivatives[j, k] * control_points[j + k, axis]
            positions[j, axis], second_derivatives[j, axis] = position, second


@compiled
def _keeps_clearance(spline: _Spline, obstacles: Obstacles, first: int, last: int) -> bool:
    """Whether the pieces ``first`` to ``last`` are proved to keep their clearance, and cheap."""
    for j in range(first, last + 1):
        piece = piece_at(spline.positions, spline.second_derivatives, j)
        if spline.costs.size > 0 and _mean_cost(spline.costs, piece) > spline.cost_limits[j]:
            return False
        bound, _ = piece_clearance(obstacles, piece, TOLERANCE, spline.clearances[j])
        if bound < spline.clearances[j]:
            return False
    return True


@compiled
def _set_cost_limits(spline: _Spline) -> None:
    """Set the largest mean cost of each piece from the costs of the pieces around it."""
    count = len(spline.cost_limits)
    costs, share, amount = np.empty(count), COST_TOLERANCE[0], COST_TOLERANCE[1]
    for j in range(count):
        costs[j] = _mean_cost(
            spline.costs, piece_at(spline.positions, spline.second_derivatives, j)
        )
    for j in range(count):
        around = costs[max(j - _AROUND, 0) : j + _AROUND + 1].mean()
        spline.cost_limits[j] = max(costs[j], around + share * (1.0 + around) + amount)


@inlined
def _mean_cost(costs: Float32[Array, "rows cols"], piece: Piece) -> float:
    """Return the mean cost at points of a piece, interpolated between the centres of the cells."""
    rows, cols = costs.shape
    total = 0.0
    for k in range(_SAMPLES):
        s = (k + 0.5) / _SAMPLES
        p = s * (1.0 - s) * (2.0 - s) / 6.0
        q = s * (1.0 - s) * (1.0 + s) / 6.0
        x = piece.ax + s * piece.cx - p * piece.ux - q * piece.vx - 0.5
        y = piece.ay + s * piece.cy - p * piece.uy - q * piece.vy - 0.5
        x, y = min(max(x, 0.0), cols - 1.0), min(max(y, 0.0), rows - 1.0)
        col, row = int(x), int(y)
        right, up = min(col + 1, cols - 1), min(row + 1, rows - 1)
        u, v = x - col, y - row
        low = (1.0 - u) * costs[row, col] + u * costs[row, right]
        high = (1.0 - u) * costs[up, col] + u * costs[up, right]
        total += (1.0 - v) * low + v * high
    return total / _SAMPLES
