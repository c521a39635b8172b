"""Type reduction: the interval of centroids that a type-2 conclusion stands for."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, compiled_sums
from omnidrive.fuzzy.unsafe_views import part

KM, EKM, EIASC, IASC, NIE_TAN = range(5)  # the order of system.ALGORITHMS


@compiled_sums
def moments(
    at: Float[Array, " points"], weights: Float[Array, " points"], begin: int, end: int
) -> tuple[float, float]:
    """Sum of the weights, and of weight times point, of the points from ``begin`` up to ``end``."""
    area, moment, x, w = 0.0, 0.0, part(at, begin, end), part(weights, begin, end)
    for i in range(len(x)):
        area += w[i]
        moment += w[i] * x[i]
    return area, moment


@compiled
def reduced(
    algorithm: int,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> tuple[float, float]:
    """Least and greatest ``sum(w x) / sum(w)`` over all weights lower <= w <= upper.

    Args:
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`. All but Nie-Tan find the
            same two numbers, in different numbers of steps; Nie-Tan gives one number between them.
        at: The points x, in ascending order.
        lower: Least weight of each point, not negative.
        upper: Greatest weight of each point; if all are zero, so there is no mean, it is nan.
    """
    mean = middle(at, lower, upper)
    if algorithm == KM and not np.isnan(mean):  # both begin at one point, with the same four sums
        count = _left_of(at, mean, _place(at, mean))
        (a, am), (b, bm) = moments(at, lower, 0, count), moments(at, lower, count, len(at))
        (c, cm), (d, dm) = moments(at, upper, 0, count), moments(at, upper, count, len(at))
        return (
            _switched(at, upper, lower, count, c + b, cm + bm, 1),
            _switched(at, lower, upper, count, a + d, am + dm, -1),
        )
    return (
        least_from(mean, algorithm, at, lower, upper),
        greatest_from(mean, algorithm, at, lower, upper),
    )


@compiled
def middle(
    at: Float[Array, " points"], lower: Float[Array, " points"], upper: Float[Array, " points"]
) -> float:
    """Mean under the middles of the weights (Nie & Tan 2008); where Karnik & Mendel begin."""
    area, moment = _both(at, lower, upper)
    return moment / area if area > 0.0 else np.nan


@compiled_sums
def _both(
    at: Float[Array, " points"], lower: Float[Array, " points"], upper: Float[Array, " points"]
) -> tuple[float, float]:
    """As :func:`moments`, of the sums of two kinds of weights."""
    area, moment = 0.0, 0.0
    for i in range(len(at)):
        weight = lower[i] + upper[i]
        area += weight
        moment += weight * at[i]
    return area, moment


@compiled
def least_from(
    mean: float,
    algorithm: int,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> float:
    """The least of :func:`reduced`, given :func:`middle`: upper weights left of it, lower right."""
    if algorithm == NIE_TAN or np.isnan(mean):
        return mean
    if algorithm in (EIASC, IASC):
        return _scanned(at, upper, lower)
    count = round(len(at) / 2.4) if algorithm == EKM else _left_of(at, mean, _place(at, mean))
    return _switched(at, upper, lower, count, *_sums(at, upper, lower, count), 1)


@compiled
def greatest_from(
    mean: float,
    algorithm: int,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> float:
    """The greatest of :func:`reduced`: lower weights left of it, upper ones right of it."""
    if algorithm == NIE_TAN or np.isnan(mean):
        return mean
    if algorithm in (EIASC, IASC):  # from the left, IASC would subtract down to nothing
        return _scanned_back(at, lower, upper)
    count = round(len(at) / 1.7) if algorithm == EKM else _left_of(at, mean, _place(at, mean))
    return _switched(at, lower, upper, count, *_sums(at, lower, upper, count), -1)


@compiled
def _switched(  # noqa: PLR0917
    at: Float[Array, " points"],
    before: Float[Array, " points"],
    after: Float[Array, " points"],
    count: int,
    area: float,
    moment: float,
    inward: int,
) -> float:
    """Fixed point of the mean with one kind of weights left of it and the other right of it.

    Karnik & Mendel 2001, "Centroid of a type-2 fuzzy set": from any guess it is reached in a few
    passes, monotonically after the first (Mendel & Liu 2007). Theirs is the mean under the middles
    of the weights; EKM's is a fixed part of the points (Wu & Mendel 2009).

    Args:
        at: The points.
        before: Weights left of the mean.
        after: Weights right of it.
        count: How many points lie left of it, at first.
        area: Sum of the weights if so.
        moment: Sum of weight times point if so.
        inward: From the end that is sought to the other: 1 for the least mean, -1 for the greatest.
    """
    last, exact = len(at), area
    mean: float = at[min(count, last - 1)]
    for _ in range(last + 1):
        lost = area <= 0.0  # beyond all that weighs anything: then every lower weight is zero
        while area <= 0.0 and 0 <= count + inward <= last:
            k = count if inward > 0 else count - 1
            area = inward * (before[k] - after[k])
            moment, count = area * at[k], count + inward
        if area <= 0.0:
            break
        mean, begin = moment / area, count
        if lost:
            break
        while count < last and at[count] < mean:
            change = before[count] - after[count]
            area, moment, count = area + change, moment + change * at[count], count + 1
        while count > 0 and at[count - 1] >= mean:
            count -= 1
            change = after[count] - before[count]
            area, moment = area + change, moment + change * at[count]
        if count == begin:
            break
        if area < 0.5 * exact:  # free of the rounding of what was taken away
            area, moment = _sums(at, before, after, count)
            exact = area
    return mean


@compiled
def _place(at: Float[Array, " points"], mean: float) -> int:
    """About how many points lie left of ``mean``, which lies among them: if they are even."""
    width = at[-1] - at[0]
    return int((mean - at[0]) / width * len(at)) if width > 0.0 else 0


@compiled
def _left_of(at: Float[Array, " points"], mean: float, guess: int) -> int:
    """How many points lie left of ``mean``, sought from ``guess`` on."""
    count = min(max(guess, 0), len(at))
    while count < len(at) and at[count] < mean:
        count += 1
    while count > 0 and at[count - 1] >= mean:
        count -= 1
    return count


@compiled
def _sums(
    at: Float[Array, " points"],
    before: Float[Array, " points"],
    after: Float[Array, " points"],
    count: int,
) -> tuple[float, float]:
    """Sum of the weights and of weight times point, ``before`` for the first ``count`` points."""
    a, am = moments(at, before, 0, count)
    b, bm = moments(at, after, count, len(at))
    return a + b, am + bm


@compiled
def _scanned(
    at: Float[Array, " points"], before: Float[Array, " points"], after: Float[Array, " points"]
) -> float:
    """As :func:`_switched`, by moving the switch from the left end as long as the mean follows.

    The least mean of IASC (Duran, Bernal & Melgarejo 2008) and of EIASC (Wu & Nie 2011).
    """
    area, moment = _sums(at, before, after, 0)
    count = 0
    while count < len(at) and not (area > 0.0 and at[count] * area >= moment):
        area += before[count] - after[count]
        moment += (before[count] - after[count]) * at[count]
        count += 1
    area, moment = _sums(at, before, after, count)  # free of the rounding above
    return moment / area if area > 0.0 else at[min(count, len(at) - 1)]


@compiled
def _scanned_back(
    at: Float[Array, " points"], before: Float[Array, " points"], after: Float[Array, " points"]
) -> float:
    """As :func:`_scanned`, from the right end: the greatest mean of EIASC (Wu & Nie 2011)."""
    area, moment = _sums(at, before, after, len(at))
    count = len(at)
    while count > 0 and not (area > 0.0 and at[count - 1] * area <= moment):
        count -= 1
        area += after[count] - before[count]
        moment += (after[count] - before[count]) * at[count]
    area, moment = _sums(at, before, after, count)  # free of the rounding above
    return moment / area if area > 0.0 else at[max(count - 1, 0)]
