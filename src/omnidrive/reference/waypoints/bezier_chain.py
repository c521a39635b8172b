"""Chains of cubic Bezier curves: evaluation and least-squares fit."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array

_CORNER = np.cos(np.deg2rad(30.0))  # of the smallest turn of a polyline that counts as a corner
_MAX_RUN = 256  # points that one curve fits, which keeps the effort linear
_ROUNDS = 4  # of Newton's method on the points' parameters


class BezierChain(NamedTuple):
    """Consecutive cubic Bezier curves, and the parameters of the points they were fitted to.

    Attributes:
        controls: Start, two control points and end of each curve, in m.
        parameters: Parameter of each point: index of its curve plus the curve's parameter in
            [0, 1].
    """

    controls: Float[Array, "curves 4 2"]
    parameters: Float[Array, " points"]


def chain_points(
    controls: Float[Array, "curves 4 2"], parameters: Float[Array, " n"]
) -> Float[Array, "n 2"]:
    """Return points at parameters from 0 to the number of curves; the integer part is the curve."""
    curve = np.minimum(parameters.astype(int), len(controls) - 1)
    return _evaluate(controls[curve], parameters - curve)


def step_counts(
    controls: Float[Array, "curves 4 2"], tolerance: float, spacing: float
) -> list[int]:
    """Return the number of equal parameter steps of each curve for a polyline approximation.

    The chords are within ``tolerance`` (m) of the curve: a chord over a step h differs from it by
    at most max|B''| h^2 / 8, and the second derivative, which is linear, is largest at an end (de
    Boor, "A Practical Guide to Splines", ch. II). No chord is longer than ``spacing`` (m), because
    max|B'| is at most three times the longest side of the control polygon.
    """
    sides = np.diff(controls, axis=1)
    speed = 3.0 * np.linalg.norm(sides, axis=2).max(axis=1)
    second = 6.0 * np.linalg.norm(np.diff(sides, axis=1), axis=2).max(axis=1)
    steps = np.maximum(speed / spacing, np.sqrt(second / (8.0 * tolerance)))
    counts: list[int] = np.ceil(np.maximum(steps, 1.0)).astype(int).tolist()
    return counts


def fit_chain(points: Float[Array, "points 2"], tolerance: float) -> BezierChain:
    """Fit a chain from the first to the last point that passes every point within ``tolerance``.

    A curve that misses a point is split at the point with the largest distance. Neighbouring curves
    share the tangent, except at corners of more than 30 degrees. Two points alone are joined by a
    straight line. Schneider, "An algorithm for automatically fitting digitized curves", Graphics
    Gems, 1990.

    Args:
        points: Points in order, in m; consecutive points differ.
        tolerance: Largest distance, in m.
    """
    arriving, leaving, corner = _tangents(points)
    cuts = sorted({*np.flatnonzero(corner).tolist(), *range(0, len(points) - 1, _MAX_RUN)})
    waiting = list(pairwise(cuts))[::-1]
    controls: list[Float[Array, "4 2"]] = []
    parameters = [np.zeros(1)]
    while waiting:
        a, b = waiting.pop()
        curve, u, worst = _curve(points[a : b + 1], leaving[a], arriving[b], tolerance)
        if worst is None:
            parameters.append(len(controls) + u[1:])
            controls.append(curve)
        else:
            waiting += [(a + worst, b), (a, a + worst)]
    return BezierChain(np.array(controls), np.concatenate(parameters))


def _tangents(
    points: Float[Array, "n 2"],
) -> tuple[Float[Array, "n 2"], Float[Array, "n 2"], Bool[Array, " n"]]:
    """Return unit tangents before and after each point, and which points are corners.

    The tangents are those of the parabola through three neighbours, one-sided at corners. The ends
    count as corners.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    steps /= lengths[:, None]
    corner = np.ones(len(points), dtype=bool)
    corner[1:-1] = (steps[:-1] * steps[1:]).sum(axis=1) < _CORNER
    arriving, leaving = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    share = (lengths[:-1] / (lengths[:-1] + lengths[1:]))[:, None]
    change = steps[1:] - steps[:-1]
    smooth = ~corner[1:-1, None]
    middle = steps[:-1] + share * change
    arriving[1:-1] = np.where(smooth, middle, arriving[1:-1])
    leaving[1:-1] = np.where(smooth, middle, leaving[1:-1])
    arriving[2:] = np.where(
        smooth & corner[2:, None], steps[1:] + (1.0 - share) * change, arriving[2:]
    )
    leaving[:-2] = np.where(smooth & corner[:-2, None], steps[:-1] - share * change, leaving[:-2])
    return _unit(arriving), _unit(leaving), corner


def _unit(vectors: Float[Array, "n 2"]) -> Float[Array, "n 2"]:
    unit: Float[Array, "n 2"] = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return unit


def _curve(
    points: Float[Array, "n 2"], leaving: Float[Array, 2], arriving: Float[Array, 2],
    tolerance: float,
) -> tuple[Float[Array, "4 2"], Float[Array, " n"], int | None]:  # fmt: skip
    """Fit one curve; return it, the parameters, and the index of the worst point or None."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    if len(points) == 2:
        thirds = points[0] + np.outer(np.arange(4) / 3.0, points[1] - points[0])
        thirds[3] = points[1]
        return thirds, u, None
    for _ in range(_ROUNDS):
        curve = _least_squares(points, u, leaving, arriving)
        misses = np.linalg.norm(_evaluate(curve, u) - points, axis=1)
        if misses.max() <= tolerance:
            return curve, u, None
        u = _reparameterize(points, curve, u)
    return curve, u, 1 + int(np.argmax(misses[1:-1]))


def _least_squares(
    points: Float[Array, "n 2"], u: Float[Array, " n"], leaving: Float[Array, 2],
    arriving: Float[Array, 2],
) -> Float[Array, "4 2"]:  # fmt: skip
    """Return the curve with given ends and tangents whose control lengths fit the points best."""
    start, end = points[0], points[-1]
    b0, b1, b2, b3 = _bernstein(u)
    along, against = b1[:, None] * leaving, -b2[:, None] * arriving
    rest = points - np.outer(b0 + b1, start) - np.outer(b2 + b3, end)
    basis = np.stack([along.ravel(), against.ravel()], axis=1)
    lengths = np.linalg.lstsq(basis, rest.ravel(), rcond=None)[0]
    chord = float(np.linalg.norm(end - start))
    if not (1e-3 * chord < lengths.min() and lengths.max() < 3.0 * chord):  # reversal or loop
        lengths = np.full(2, chord / 3.0)
    return np.stack([start, start + lengths[0] * leaving, end - lengths[1] * arriving, end])


def _reparameterize(
    points: Float[Array, "n 2"], curve: Float[Array, "4 2"], u: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Return parameters of curve points nearer to the given points, by one Newton step."""
    first = 3.0 * np.diff(curve, axis=0)
    second = 2.0 * np.diff(first, axis=0)
    away = _evaluate(curve, u) - points
    v = np.outer((1.0 - u) ** 2, first[0]) + np.outer(2.0 * u * (1.0 - u), first[1])
    v += np.outer(u**2, first[2])
    a = np.outer(1.0 - u, second[0]) + np.outer(u, second[1])
    derivative = (v * v).sum(axis=1) + (away * a).sum(axis=1)
    step = (away * v).sum(axis=1) / np.where(derivative > 1e-12, derivative, np.inf)
    moved = np.clip(u - step, 0.0, 1.0)
    moved[0], moved[-1] = 0.0, 1.0
    return np.maximum.accumulate(moved)


def _evaluate(controls: Float[Array, "*n 4 2"], u: Float[Array, " n"]) -> Float[Array, "n 2"]:
    weights = np.stack(_bernstein(u), axis=-1)
    points: Float[Array, "n 2"] = (weights[:, :, None] * controls).sum(axis=1)
    return points


def _bernstein(u: Float[Array, " n"]) -> tuple[Float[Array, " n"], ...]:
    v = 1.0 - u
    return v**3, 3.0 * v * v * u, 3.0 * v * u * u, u**3
