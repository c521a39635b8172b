"""Type reduction: the interval of the centroids of an interval type-2 set.

Mendel, "Uncertain Rule-Based Fuzzy Systems", 2nd ed. 2017.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, compiled_sums
from omnidrive.compiled.views import unsafe_slice

KM, EKM, EIASC, IASC, NIE_TAN = range(5)
"""Indices in :data:`~omnidrive.fuzzy.system.ALGORITHMS`: Karnik-Mendel, enhanced Karnik-Mendel,
(enhanced) iterative algorithm with stop condition, Nie-Tan."""


@compiled_sums
def moments(
    points: Float[Array, " points"], weights: Float[Array, " points"], begin: int, end: int
) -> tuple[float, float]:
    """Return sum(w) and sum(w x) over ``points[begin:end]``; the bounds are not checked."""
    area, moment, x, w = (
        0.0,
        0.0,
        unsafe_slice(points, begin, end),
        unsafe_slice(weights, begin, end),
    )
    for i in range(len(x)):
        area += w[i]
        moment += w[i] * x[i]
    return area, moment


@compiled
def type_reduce(
    algorithm: int,
    points: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> tuple[float, float]:
    """Return the least and the greatest ``sum(w x) / sum(w)`` over all weights lower <= w <= upper.

    Args:
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`. All but Nie-Tan find the
            same two numbers in different numbers of steps; Nie-Tan yields one number between them,
            twice.
        points: The points x, in ascending order.
        lower: Least weight of each point, not negative.
        upper: Greatest weight of each point; if all are zero, both results are nan.
    """
    mean = nie_tan(points, lower, upper)
    if algorithm == KM and not np.isnan(mean):
        # both ends start from the same count and share its sums: a and b of the lower weights left
        # and right of the mean, c and d of the upper weights; am to dm are those of weight x point
        count = _left_count(points, mean, _guess_left_count(points, mean))
        (a, am), (b, bm) = (
            moments(points, lower, 0, count),
            moments(points, lower, count, len(points)),
        )
        (c, cm), (d, dm) = (
            moments(points, upper, 0, count),
            moments(points, upper, count, len(points)),
        )
        return (
            _karnik_mendel(points, upper, lower, count, c + b, cm + bm, 1),
            _karnik_mendel(points, lower, upper, count, a + d, am + dm, -1),
        )
    return (
        left_end(mean, algorithm, points, lower, upper),
        right_end(mean, algorithm, points, lower, upper),
    )


@compiled
def nie_tan(
    points: Float[Array, " points"], lower: Float[Array, " points"], upper: Float[Array, " points"]
) -> float:
    """Return the mean of the points with the midpoints of their weights (Nie & Tan 2008).

    KM starts from it. If all weights are zero, it is nan.
    """
    area, moment = _sum_moments(points, lower, upper)
    return moment / area if area > 0.0 else np.nan


@compiled_sums
def _sum_moments(
    points: Float[Array, " points"], lower: Float[Array, " points"], upper: Float[Array, " points"]
) -> tuple[float, float]:
    """Return sum(w) and sum(w x) for w = lower + upper."""
    area, moment = 0.0, 0.0
    for i in range(len(points)):
        weight = lower[i] + upper[i]
        area += weight
        moment += weight * points[i]
    return area, moment


@compiled
def left_end(
    mean: float,
    algorithm: int,
    points: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> float:
    """Return the least mean: with upper weights left of it and lower weights right of it.

    Args:
        mean: Result of :func:`nie_tan`.
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        points: The points, in ascending order.
        lower: Least weight of each point, not negative.
        upper: Greatest weight of each point.
    """
    if algorithm == NIE_TAN or np.isnan(mean):
        return mean
    if algorithm in (EIASC, IASC):
        return _scan_from_left(points, upper, lower)
    count = (
        round(len(points) / 2.4)
        if algorithm == EKM
        else _left_count(points, mean, _guess_left_count(points, mean))
    )
    return _karnik_mendel(
        points, upper, lower, count, *_switched_moments(points, upper, lower, count), 1
    )


@compiled
def right_end(
    mean: float,
    algorithm: int,
    points: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> float:
    """Return the greatest mean: with lower weights left of it and upper weights right of it.

    The arguments are those of :func:`left_end`.
    """
    if algorithm == NIE_TAN or np.isnan(mean):
        return mean
    if algorithm in (EIASC, IASC):  # IASC scans from the left, which would lose digits
        return _scan_from_right(points, lower, upper)
    count = (
        round(len(points) / 1.7)
        if algorithm == EKM
        else _left_count(points, mean, _guess_left_count(points, mean))
    )
    return _karnik_mendel(
        points, lower, upper, count, *_switched_moments(points, lower, upper, count), -1
    )


@compiled
def _karnik_mendel(  # noqa: PLR0917
    points: Float[Array, " points"],
    before: Float[Array, " points"],
    after: Float[Array, " points"],
    count: int,
    area: float,
    moment: float,
    inward: int,
) -> float:
    """Return the mean with the weights ``before`` left of itself and ``after`` right of itself.

    The fixed-point iteration of Karnik & Mendel 2001, "Centroid of a type-2 fuzzy set". It
    converges in a few passes from any start, monotonically after the first pass (Mendel & Liu
    2007). KM starts at the Nie-Tan mean, EKM at a fixed fraction of the points: 1 / 2.4 for the
    least mean, 1 / 1.7 for the greatest (Wu & Mendel 2009).

    Args:
        points: The points.
        before: Weights of the points left of the mean.
        after: Weights of the other points.
        count: Initial number of points left of the mean.
        area: Sum of the weights with that number.
        moment: Sum of weight times point with that number.
        inward: Change of ``count`` away from the end that is sought: 1 for the least mean, -1 for
            the greatest.
    """
    total, summed_area = len(points), area
    mean: float = points[min(count, total - 1)]
    for _ in range(total + 1):
        weightless = area <= 0.0  # only if all lower weights are zero
        while area <= 0.0 and 0 <= count + inward <= total:
            k = count if inward > 0 else count - 1
            area = inward * (before[k] - after[k])
            moment, count = area * points[k], count + inward
        if area <= 0.0:
            break
        mean, previous_count = moment / area, count
        if weightless:  # the mean is the outermost point with a weight
            break
        while count < total and points[count] < mean:
            change = before[count] - after[count]
            area, moment, count = area + change, moment + change * points[count], count + 1
        while count > 0 and points[count - 1] >= mean:
            count -= 1
            change = after[count] - before[count]
            area, moment = area + change, moment + change * points[count]
        if count == previous_count:
            break
        if area < 0.5 * summed_area:  # the updates cancelled: compute the sums again
            area, moment = _switched_moments(points, before, after, count)
            summed_area = area
    return mean


@compiled
def _guess_left_count(points: Float[Array, " points"], mean: float) -> int:
    """Estimate how many points lie left of ``mean``, as if they were evenly spaced."""
    width = points[-1] - points[0]
    return int((mean - points[0]) / width * len(points)) if width > 0.0 else 0


@compiled
def _left_count(points: Float[Array, " points"], mean: float, guess: int) -> int:
    """Return how many points lie left of ``mean``, by a linear search from ``guess``."""
    count = min(max(guess, 0), len(points))
    while count < len(points) and points[count] < mean:
        count += 1
    while count > 0 and points[count - 1] >= mean:
        count -= 1
    return count


@compiled
def _switched_moments(
    points: Float[Array, " points"],
    before: Float[Array, " points"],
    after: Float[Array, " points"],
    count: int,
) -> tuple[float, float]:
    """Return sum(w) and sum(w x), w = ``before`` for the first ``count`` points, else ``after``."""
    a, am = moments(points, before, 0, count)
    b, bm = moments(points, after, count, len(points))
    return a + b, am + bm


@compiled
def _scan_from_left(
    points: Float[Array, " points"], before: Float[Array, " points"], after: Float[Array, " points"]
) -> float:
    """Return the mean of :func:`_karnik_mendel` by a scan of the switch point from the left end.

    IASC (Duran, Bernal & Melgarejo 2008) and EIASC (Wu & Nie 2011) find the least mean in this way.
    """
    area, moment = _switched_moments(points, before, after, 0)
    count = 0
    while count < len(points) and not (area > 0.0 and points[count] * area >= moment):
        area += before[count] - after[count]
        moment += (before[count] - after[count]) * points[count]
        count += 1
    # the updates may have cancelled: compute the sums again
    area, moment = _switched_moments(points, before, after, count)
    return moment / area if area > 0.0 else points[min(count, len(points) - 1)]


@compiled
def _scan_from_right(
    points: Float[Array, " points"], before: Float[Array, " points"], after: Float[Array, " points"]
) -> float:
    """Return the mean of :func:`_karnik_mendel` by a scan of the switch point from the right end.

    EIASC (Wu & Nie 2011) finds the greatest mean in this way.
    """
    area, moment = _switched_moments(points, before, after, len(points))
    count = len(points)
    while count > 0 and not (area > 0.0 and points[count - 1] * area <= moment):
        count -= 1
        area += after[count] - before[count]
        moment += (after[count] - before[count]) * points[count]
    # the updates may have cancelled: compute the sums again
    area, moment = _switched_moments(points, before, after, count)
    return moment / area if area > 0.0 else points[max(count - 1, 0)]
