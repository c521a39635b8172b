"""Chains of cubic Bezier curves: points on them, and the chain that follows given points."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array

_CORNER = np.cos(np.deg2rad(30.0))  # a polyline that turns more than 30 degrees has a corner there
_LONGEST_RUN = 256  # points that one curve may have to follow, so that the work stays in proportion
_ROUNDS = 4  # of Newton's method on the points' parameters


class Chain(NamedTuple):
    """Cubic Bezier curves end to end, and where on them the points they were fitted to lie.

    Attributes:
        controls: Each curve's start, two control points and end, in m.
        parameters: Of each point: the number of its curve plus the curve's parameter in [0, 1].
    """

    controls: Float[Array, "curves 4 2"]
    parameters: Float[Array, " points"]


def points_at(
    controls: Float[Array, "curves 4 2"], parameters: Float[Array, " n"]
) -> Float[Array, "n 2"]:
    """Points at parameters from 0 to the number of curves; the integer part picks the curve."""
    curve = np.minimum(parameters.astype(int), len(controls) - 1)
    return _evaluate(controls[curve], parameters - curve)


def even_parameters(
    controls: Float[Array, "curves 4 2"], tolerance: float, spacing: float
) -> list[int]:
    """How many equal steps of its parameter divide each curve finely enough.

    Straight lines between the points are then within ``tolerance`` (m) of the curve: a chord over
    a step h departs from it by at most max|B''| h^2 / 8, and the second derivative, which is
    linear, is largest at an end (de Boor, "A Practical Guide to Splines", ch. II). No step is
    longer than ``spacing`` (m), as max|B'| is at most three times the longest side of the controls.
    """
    sides = np.diff(controls, axis=1)
    speed = 3.0 * np.linalg.norm(sides, axis=2).max(axis=1)
    bend = 6.0 * np.linalg.norm(np.diff(sides, axis=1), axis=2).max(axis=1)
    steps = np.maximum(speed / spacing, np.sqrt(bend / (8.0 * tolerance)))
    counts: list[int] = np.ceil(np.maximum(steps, 1.0)).astype(int).tolist()
    return counts


def fit(points: Float[Array, "points 2"], tolerance: float) -> Chain:
    """The chain through the first and last point that passes every point within ``tolerance`` m.

    Where a curve cannot, it is split at the point it misses most; neighbours share the tangent,
    except at corners of more than 30 degrees. Two points alone are joined by a straight line.
    Schneider, "An algorithm for automatically fitting digitized curves", Graphics Gems, 1990.

    Args:
        points: In order, no two in a row the same.
        tolerance: In m.
    """
    arriving, leaving, corner = _tangents(points)
    cuts = sorted({*np.flatnonzero(corner).tolist(), *range(0, len(points) - 1, _LONGEST_RUN)})
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
    return Chain(np.array(controls), np.concatenate(parameters))


def _tangents(
    points: Float[Array, "n 2"],
) -> tuple[Float[Array, "n 2"], Float[Array, "n 2"], Bool[Array, " n"]]:
    """Unit tangents before and after each point, and which points are corners, the ends too.

    They are those of the parabola through three neighbours, on one side of a corner alone.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    steps /= lengths[:, None]
    corner = np.ones(len(points), dtype=bool)
    corner[1:-1] = (steps[:-1] * steps[1:]).sum(axis=1) < _CORNER
    arriving, leaving = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    share = (lengths[:-1] / (lengths[:-1] + lengths[1:]))[:, None]
    bend = steps[1:] - steps[:-1]
    smooth = ~corner[1:-1, None]
    middle = steps[:-1] + share * bend
    arriving[1:-1] = np.where(smooth, middle, arriving[1:-1])
    leaving[1:-1] = np.where(smooth, middle, leaving[1:-1])
    arriving[2:] = np.where(
        smooth & corner[2:, None], steps[1:] + (1.0 - share) * bend, arriving[2:]
    )
    leaving[:-2] = np.where(smooth & corner[:-2, None], steps[:-1] - share * bend, leaving[:-2])
    return _unit(arriving), _unit(leaving), corner


def _unit(vectors: Float[Array, "n 2"]) -> Float[Array, "n 2"]:
    unit: Float[Array, "n 2"] = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return unit


def _curve(
    points: Float[Array, "n 2"], leaving: Float[Array, 2], arriving: Float[Array, 2],
    tolerance: float,
) -> tuple[Float[Array, "4 2"], Float[Array, " n"], int | None]:  # fmt: skip
    """One curve, the points' parameters, and which point it misses most; None if by little."""
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
        u = _nearer(points, curve, u)
    return curve, u, 1 + int(np.argmax(misses[1:-1]))


def _least_squares(
    points: Float[Array, "n 2"], u: Float[Array, " n"], leaving: Float[Array, 2],
    arriving: Float[Array, 2],
) -> Float[Array, "4 2"]:  # fmt: skip
    """The curve with given ends and tangents, whose control lengths fit the points best."""
    start, end = points[0], points[-1]
    b0, b1, b2, b3 = _bernstein(u)
    along, against = b1[:, None] * leaving, -b2[:, None] * arriving
    rest = points - np.outer(b0 + b1, start) - np.outer(b2 + b3, end)
    basis = np.stack([along.ravel(), against.ravel()], axis=1)
    reach = np.linalg.lstsq(basis, rest.ravel(), rcond=None)[0]
    chord = float(np.linalg.norm(end - start))
    if not (1e-3 * chord < reach.min() and reach.max() < 3.0 * chord):  # it would turn back or loop
        reach = np.full(2, chord / 3.0)
    return np.stack([start, start + reach[0] * leaving, end - reach[1] * arriving, end])


def _nearer(
    points: Float[Array, "n 2"], curve: Float[Array, "4 2"], u: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Parameters of points of the curve nearer to the given ones: one step of Newton's method."""
    first = 3.0 * np.diff(curve, axis=0)
    second = 2.0 * np.diff(first, axis=0)
    away = _evaluate(curve, u) - points
    v = np.outer((1.0 - u) ** 2, first[0]) + np.outer(2.0 * u * (1.0 - u), first[1])
    v += np.outer(u**2, first[2])
    a = np.outer(1.0 - u, second[0]) + np.outer(u, second[1])
    slope = (v * v).sum(axis=1) + (away * a).sum(axis=1)
    step = (away * v).sum(axis=1) / np.where(slope > 1e-12, slope, np.inf)
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
