"""Type reduction: the interval of centroids that a type-2 conclusion stands for."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.pid.sets import Footprint, lagged

Array = np.ndarray


@compiled
def karnik_mendel(
    at: Float[Array, " points"], lower: Float[Array, " points"], upper: Float[Array, " points"]
) -> tuple[float, float]:
    """Least and greatest ``sum(w x) / sum(w)`` over all weights lower <= w <= upper.

    The Karnik-Mendel algorithm (Karnik & Mendel 2001, "Centroid of a type-2 fuzzy set"): the least
    mean has the upper weights left of itself and the lower weights right of itself, the greatest
    the other way round; iterating on that from any mean converges to it in a few passes (Mendel &
    Liu 2007), monotonically after the first.

    Args:
        at: The points x, in ascending order.
        lower: Least weight of each point, not negative.
        upper: Greatest weight of each point, at least one of them positive.
    """
    area, moment = 0.0, 0.0
    for i in range(len(at)):
        area += lower[i] + upper[i]
        moment += (lower[i] + upper[i]) * at[i]
    start = moment / area
    return _switch(at, upper, lower, start), _switch(at, lower, upper, start)


@compiled
def _switch(
    at: Float[Array, " points"],
    before: Float[Array, " points"],
    after: Float[Array, " points"],
    mean: float,
) -> float:
    """Fixed point of the mean whose weights are ``before`` left of it and ``after`` right of it."""
    last = -1
    for _ in range(len(at) + 1):
        area, moment, count = 0.0, 0.0, 0
        for i in range(len(at)):
            left = at[i] < mean
            weight = before[i] if left else after[i]
            count += left
            area += weight
            moment += weight * at[i]
        if count == last or area <= 0.0:  # area is 0 where the mean is the only point, rounded
            break
        mean, last = moment / area, count
    return mean


_Triangle = tuple[float, float, float]


def set_centroids(sets: Float[Array, "sets 3"], footprint: Footprint) -> Float[Array, "sets 2"]:
    """Least and greatest centroid of each interval type-2 triangle, exact (not sampled).

    The greatest is minus the least of the mirrored triangle.
    """
    scale, lower = footprint.scale, lagged(sets, footprint)
    return np.array(
        [
            (_least_centroid(up, low, scale), -_least_centroid(_mirror(up), _mirror(low), scale))
            for up, low in zip(map(tuple, sets.tolist()), map(tuple, lower.tolist()), strict=True)
        ]
    )


def _mirror(triangle: _Triangle) -> _Triangle:
    a, b, c = triangle
    return -c, -b, -a


def _least_centroid(upper: _Triangle, lower: _Triangle, scale: float) -> float:
    """Continuous Karnik-Mendel: Newton's method on a convex function (Liu & Mendel 2011).

    It descends to the solution, so it has arrived when it descends no more.
    """
    split = upper[2]
    lower_area, lower_moment = _left_part(lower, split)
    while True:
        area, moment = _left_part(upper, split)
        cut_area, cut_moment = _left_part(lower, split)
        area += scale * (lower_area - cut_area)
        moment += scale * (lower_moment - cut_moment)
        if area <= 0.0 or not moment / area < split:
            return split
        split = moment / area


def _left_part(triangle: _Triangle, split: float) -> tuple[float, float]:
    """Area and first moment about x = 0 of the part of a triangle of height 1 left of ``split``."""
    a, b, c = triangle
    if split <= a:
        return 0.0, 0.0
    if split < b:
        area = 0.5 * (split - a) ** 2 / (b - a)
        return area, area * (a + 2.0 / 3.0 * (split - a))
    area, moment = 0.5 * (c - a), (c - a) * (a + b + c) / 6.0
    if split >= c:
        return area, moment
    tail = 0.5 * (c - split) ** 2 / (c - b)
    return area - tail, moment - tail * (c - 2.0 / 3.0 * (c - split))
