"""Type reduction: the interval of centroids that a type-2 conclusion stands for."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled

Array = np.ndarray

KM, EKM, EIASC, IASC, NIE_TAN = range(5)  # the order of system.ALGORITHMS


@compiled
def moments(
    at: Float[Array, " points"], weights: Float[Array, " points"], begin: int, end: int
) -> tuple[float, float]:
    """Sum of the weights, and of weight times point, of the points from ``begin`` up to ``end``.

    Four sums side by side: a processor adds them at once.
    """
    a0, a1, a2, a3 = 0.0, 0.0, 0.0, 0.0
    m0, m1, m2, m3 = 0.0, 0.0, 0.0, 0.0
    x, w = at[begin:end], weights[begin:end]
    fours = len(w) // 4
    for k in range(fours):
        i = 4 * k
        a0, m0 = a0 + w[i], m0 + w[i] * x[i]
        a1, m1 = a1 + w[i + 1], m1 + w[i + 1] * x[i + 1]
        a2, m2 = a2 + w[i + 2], m2 + w[i + 2] * x[i + 2]
        a3, m3 = a3 + w[i + 3], m3 + w[i + 3] * x[i + 3]
    for i in range(4 * fours, len(w)):
        a0, m0 = a0 + w[i], m0 + w[i] * x[i]
    return (a0 + a1) + (a2 + a3), (m0 + m1) + (m2 + m3)


@compiled
def reduced(
    algorithm: int,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> tuple[float, float]:
    """Least and greatest ``sum(w x) / sum(w)`` over all weights lower <= w <= upper.

    Args:
        algorithm: Place in :data:`~omnidrive.fuzzy.system.ALGORITHMS`. All but Nie-Tan find the
            same two numbers, in different numbers of steps; Nie-Tan gives one number between them.
        at: The points x, in ascending order.
        lower: Least weight of each point, not negative.
        upper: Greatest weight of each point, at least one of them positive.
    """
    return least(algorithm, at, lower, upper), greatest(algorithm, at, lower, upper)


@compiled
def least(
    algorithm: int,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> float:
    """The least of :func:`reduced`: upper weights left of it, lower ones right of it."""
    if algorithm == NIE_TAN:
        return _middle(at, lower, upper)
    if algorithm in (EIASC, IASC):
        return _scanned(at, upper, lower)
    return _switched(at, upper, lower, _start(algorithm, 2.4, at, lower, upper))


@compiled
def greatest(
    algorithm: int,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> float:
    """The greatest of :func:`reduced`: lower weights left of it, upper ones right of it."""
    if algorithm == NIE_TAN:
        return _middle(at, lower, upper)
    if algorithm == EIASC:
        return _scanned_back(at, lower, upper)
    if algorithm == IASC:
        return _scanned(at, lower, upper)
    return _switched(at, lower, upper, _start(algorithm, 1.7, at, lower, upper))


@compiled
def _start(
    algorithm: int,
    part: float,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> int:
    """First guess of how many points are left of the mean."""
    if algorithm == EKM:
        return round(len(at) / part)  # Wu & Mendel 2009, "Enhanced Karnik-Mendel algorithms"
    return int(np.searchsorted(at, _middle(at, lower, upper)))


@compiled
def _middle(
    at: Float[Array, " points"], lower: Float[Array, " points"], upper: Float[Array, " points"]
) -> float:
    """Mean under the middles of the weights (Nie & Tan 2008); where Karnik & Mendel begin."""
    (a, am), (b, bm) = moments(at, lower, 0, len(at)), moments(at, upper, 0, len(at))
    return (am + bm) / (a + b)


@compiled
def _switched(
    at: Float[Array, " points"],
    before: Float[Array, " points"],
    after: Float[Array, " points"],
    start: int,
) -> float:
    """Fixed point of the mean whose weights are ``before`` left of it and ``after`` right of it.

    Karnik & Mendel 2001, "Centroid of a type-2 fuzzy set": from any guess it is reached in a few
    passes, monotonically after the first (Mendel & Liu 2007). Only what a pass changes is summed
    anew; the last mean is summed afresh, so that it is free of that rounding.
    """
    count, fresh = start, True
    area, moment = _sums(at, before, after, count)
    if area <= 0.0:  # a guess beyond all that weighs anything
        count = int(np.searchsorted(at, _middle(at, before, after)))
        area, moment = _sums(at, before, after, count)
    mean = moment / area if area > 0.0 else at[min(count, len(at) - 1)]
    for _ in range(len(at) + 1):
        found = count
        while found < len(at) and at[found] < mean:
            found += 1
        while found > 0 and at[found - 1] >= mean:
            found -= 1
        if found == count:
            break
        for i in range(min(found, count), max(found, count)):
            change = (before[i] - after[i]) * (1.0 if found > count else -1.0)
            area += change
            moment += change * at[i]
        count, fresh = found, False
        if area <= 0.0:  # the mean is the only point that weighs anything
            break
        mean = moment / area
    if not fresh:
        area, moment = _sums(at, before, after, count)
    return moment / area if area > 0.0 else mean


@compiled
def _sums(
    at: Float[Array, " points"],
    before: Float[Array, " points"],
    after: Float[Array, " points"],
    count: int,
) -> tuple[float, float]:
    """Sum of the weights and of weight times point, ``before`` for the first ``count`` points."""
    (a, am), (b, bm) = moments(at, before, 0, count), moments(at, after, count, len(at))
    return a + b, am + bm


@compiled
def _scanned(
    at: Float[Array, " points"], before: Float[Array, " points"], after: Float[Array, " points"]
) -> float:
    """As :func:`_switched`, by moving the switch from the left end as long as the mean follows.

    IASC (Duran, Bernal & Melgarejo 2008); for the least mean also EIASC (Wu & Nie 2011).
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
    """As :func:`_scanned`, from the right end: the second half of EIASC (Wu & Nie 2011)."""
    area, moment = _sums(at, before, after, len(at))
    count = len(at)
    while count > 0 and not (area > 0.0 and at[count - 1] * area <= moment):
        count -= 1
        area += after[count] - before[count]
        moment += (after[count] - before[count]) * at[count]
    area, moment = _sums(at, before, after, count)  # free of the rounding above
    return moment / area if area > 0.0 else at[max(count - 1, 0)]
