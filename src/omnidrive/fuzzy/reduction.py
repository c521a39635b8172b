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
    if algorithm in (KM, EKM):
        sums = running_sums(at, lower, upper)
        return _switched(algorithm, 2.4, at, sums, 1), _switched(algorithm, 1.7, at, sums, 0)
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
        return _middle(running_sums(at, lower, upper))
    if algorithm in (EIASC, IASC):
        return _scanned(at, upper, lower)
    return _switched(algorithm, 2.4, at, running_sums(at, lower, upper), 1)


@compiled
def greatest(
    algorithm: int,
    at: Float[Array, " points"],
    lower: Float[Array, " points"],
    upper: Float[Array, " points"],
) -> float:
    """The greatest of :func:`reduced`: lower weights left of it, upper ones right of it."""
    if algorithm == NIE_TAN:
        return _middle(running_sums(at, lower, upper))
    if algorithm in (EIASC, IASC):  # from the left, IASC would subtract down to nothing
        return _scanned_back(at, lower, upper)
    return _switched(algorithm, 1.7, at, running_sums(at, lower, upper), 0)


@compiled
def running_sums(
    at: Float[Array, " points"], lower: Float[Array, " points"], upper: Float[Array, " points"]
) -> Float[Array, "sums 4"]:
    """Sums over the points before each: lower weight, it times point, and of the upper weight."""
    sums = np.empty((len(at) + 1, 4))
    a, am, b, bm = 0.0, 0.0, 0.0, 0.0
    for i in range(len(at)):
        sums[i, 0], sums[i, 1], sums[i, 2], sums[i, 3] = a, am, b, bm
        x, low, high = at[i], lower[i], upper[i]
        a, am, b, bm = a + low, am + low * x, b + high, bm + high * x
    sums[len(at), 0], sums[len(at), 1] = a, am
    sums[len(at), 2], sums[len(at), 3] = b, bm
    return sums


@compiled
def _middle(sums: Float[Array, "sums 4"]) -> float:
    """Mean under the middles of the weights (Nie & Tan 2008); where Karnik & Mendel begin."""
    last = len(sums) - 1
    middle: float = (sums[last, 1] + sums[last, 3]) / (sums[last, 0] + sums[last, 2])
    return middle


@compiled
def _switched(
    algorithm: int,
    part: float,
    at: Float[Array, " points"],
    sums: Float[Array, "sums 4"],
    before: int,
) -> float:
    """Fixed point of the mean with one kind of weights left of it and the other right of it.

    Karnik & Mendel 2001, "Centroid of a type-2 fuzzy set": from any guess it is reached in a few
    passes, monotonically after the first (Mendel & Liu 2007). Theirs is the mean under the middles
    of the weights; EKM's is a fixed part of the points (Wu & Mendel 2009).

    Args:
        algorithm: KM or EKM.
        part: By what EKM divides the number of points for its guess.
        at: The points.
        sums: Their :func:`running_sums`.
        before: 0 for lower weights left of the mean, 1 for upper ones.
    """
    last = len(at)
    p, q = 2 * before, 2 - 2 * before  # columns of the weights before and after the mean
    count = round(last / part) if algorithm == EKM else _left_of(at, _middle(sums), last // 2)
    mean: float = at[min(count, last - 1)]
    for _ in range(last + 1):
        area = sums[count, p] + (sums[last, q] - sums[count, q])
        lost = area <= 0.0  # beyond all that weighs anything: then every lower weight is zero
        while area <= 0.0 and 0 < count + before < last + 1:
            count += 2 * before - 1
            area = sums[count, p] + (sums[last, q] - sums[count, q])
        if area <= 0.0:
            break
        mean = (sums[count, p + 1] + (sums[last, q + 1] - sums[count, q + 1])) / area
        found = _left_of(at, mean, count)
        if lost or found == count:
            break
        count = found
    return mean


@compiled
def _left_of(at: Float[Array, " points"], mean: float, guess: int) -> int:
    """How many points lie left of ``mean``, sought from ``guess`` on."""
    count = guess
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
    (a, am), (b, bm) = moments(at, before, 0, count), moments(at, after, count, len(at))
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
