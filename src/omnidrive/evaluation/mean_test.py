"""Intervals of means, and tests of paired differences, of values that may be skewed."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import cbrt, inf, isfinite, log2, nan, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import brentq
from scipy.special import ndtri, stdtr, stdtrit

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.evaluation.uncertainty import CONFIDENCE, MeanEstimate, estimate_mean, p_value

MIN_DIFFERENCES = 6
"""Fewer differences have no bounded interval: 2 / 2^5 is more than 5 %."""
MIN_VALUES = 10
"""Fewer values, too few to estimate a skewness, have Student's t as interval of their mean."""
MAX_FLIPPED = 100
"""More differences have Student's t, to which the sign-flip test tends, in its place."""

_ALPHA = 1.0 - CONFIDENCE
_UNITS = 4_096  # sum of the absolute differences in the units to which the sign-flip test rounds
_TOLERANCE = 1e-2  # of bounds, in standard errors
_ROUNDING = 1e-12  # relative variance below which all values count as equal


class TestedMean(NamedTuple):
    """A mean with its interval and the p-value of zero mean."""

    estimate: MeanEstimate
    p: float
    """Two-sided p-value; NaN for fewer than two values."""


def mean_intervals(columns: Float[Array, "values columns"]) -> list[MeanEstimate]:
    """Return mean and 95 % confidence interval of the independent values of each column.

    The interval is Hall's for skewed values, as in :func:`difference_tests`; fewer than
    :data:`MIN_VALUES` values have Student's t. NaNs are left out.
    """
    return [_mean_interval(column[np.isfinite(column)]) for column in columns.T]


def difference_tests(columns: Float[Array, "values columns"]) -> list[TestedMean]:
    """Return mean, 95 % confidence interval and p-value of the paired differences of each column.

    The p-value is the larger one of two tests, and the interval contains what either does not
    reject, so that p < 0.05 just where it excludes 0:

    * the sign-flip test of the mean (Fisher, "The Design of Experiments", 1935, section 21): each
      difference has either sign with equal probability if the two compared have equal
      distributions. It is exact at every number of differences and for every distribution. The
      differences are rounded to units of 1 / 4,096 of the sum of their absolute values, of which
      all 2^n signs are counted (Pagano & Tritchler, J. Am. Statist. Assoc. 78, 1983);
    * the t-test with Hall's correction of skewness (Hall, "On the removal of skewness by
      transformation", J. R. Statist. Soc. B 54, 1992), for differences of distributions that are
      not equal but have equal means. Its tails are separate: skewness away from 0 adds to the
      evidence, skewness towards 0 takes from it.

    n differences have p >= 2 / 2^n. More than :data:`MAX_FLIPPED` have Student's t-test in place of
    the sign-flip test. Nothing is drawn at random. NaNs are left out.
    """
    return [_tested_difference(column[np.isfinite(column)]) for column in columns.T]


def needed_differences(comparisons: int) -> int:
    """Return the number of differences whose least p-value passes Holm's correction.

    Args:
        comparisons: Number of comparisons in the family, at least 1.
    """
    return int(log2(2.0 * comparisons / _ALPHA)) + 1


def _mean_interval(values: Float[Array, " values"]) -> MeanEstimate:
    constant = _constant(values)
    if constant is not None:
        return constant.estimate
    return _Hall(values).interval() if len(values) >= MIN_VALUES else estimate_mean(values)


def _tested_difference(values: Float[Array, " values"]) -> TestedMean:
    count = len(values)
    if count < 2:
        return TestedMean(estimate_mean(values), nan)
    constant = _constant(values)
    if constant is not None:
        return constant
    hall, mean = _Hall(values), float(values.mean())
    if count > MAX_FLIPPED:
        student, corrected = estimate_mean(values), hall.interval()
        low, high = min(student.low, corrected.low), max(student.high, corrected.high)
        return TestedMean(MeanEstimate(mean, low, high, count), max(hall.p(), p_value(values)))
    p = max(hall.p(), sign_flip_p(values))
    if count < MIN_DIFFERENCES:
        return TestedMean(MeanEstimate(mean, -inf, inf, count), p)
    high = _bound(values, hall)
    low = -_bound(-values, _Hall(-values))
    return TestedMean(MeanEstimate(mean, low, high, count), p)


def _constant(values: Float[Array, " values"]) -> TestedMean | None:
    """Return the tested mean of equal values, whatever their rounding; None: they differ.

    The p-value is 1 if their mean is 0, and otherwise 0.
    """
    if len(values) < 2 or values.std() ** 2 > _ROUNDING * np.mean(values**2):
        return None
    mean = float(values.mean())
    return TestedMean(MeanEstimate(mean, mean, mean, len(values)), 1.0 if mean == 0.0 else 0.0)


class _Hall:
    """t-test with Hall's transformation g(w) = w + a w^2 / 3 + a^2 w^3 / 27 + a / (6 n).

    w is mean over standard deviation (ddof 0), and a the skewness; sqrt(n) g has nearly Student's
    distribution with n - 1 degrees of freedom.
    """

    def __init__(self, values: Float[Array, " values"]) -> None:
        self.count, self.mean = len(values), float(values.mean())
        self.spread = float(values.std())
        self.skewness = float(np.mean(((values - self.mean) / self.spread) ** 3))
        self.shift = self.skewness / (6.0 * self.count)

    def p(self) -> float:
        """Return the two-sided p-value of zero mean."""
        w, a = self.mean / self.spread, self.skewness
        g = w + a * w**2 / 3.0 + a**2 * w**3 / 27.0 + self.shift
        return 2.0 * float(stdtr(self.count - 1, -sqrt(self.count) * abs(g)))

    def interval(self) -> MeanEstimate:
        """Return the means that are not rejected."""
        t = _quantile(self.count - 1) / sqrt(self.count)
        low, high = (self.mean - self.spread * self._inverse(g) for g in (t, -t))
        return MeanEstimate(self.mean, low, high, self.count)

    def _inverse(self, g: float) -> float:
        a, y = self.skewness, g - self.shift
        return 3.0 * (cbrt(1.0 + a * y) - 1.0) / a if abs(a) > 1e-5 else y - a * y**2 / 3.0


@lru_cache(maxsize=1024)
def _quantile(degrees: int) -> float:
    """Return the two-sided quantile of Student's t."""
    return float(stdtrit(degrees, 0.5 + 0.5 * CONFIDENCE))


def sign_flip_p(values: Float[Array, " values"]) -> float:
    """Return the two-sided p-value of the sign-flip test of zero mean, by all 2^n signs."""
    total = float(np.abs(values).sum())
    if total == 0.0:
        return 1.0
    units = np.rint(np.abs(values) * (_UNITS / total)).astype(np.int64)
    positive = int(units[values > 0.0].sum())
    return min(1.0, 2.0 * _share_at_most(units, min(positive, int(units.sum()) - positive)))


@compiled
def _share_at_most(units: Int[Array, " values"], limit: int) -> float:
    """Return the share of all subsets of the units whose sum is at most a limit."""
    shares = np.zeros(limit + 1)  # of the subsets of the units so far, by their sum
    shares[0] = 1.0
    reached = 0
    for unit in units:
        reached = min(reached + unit, limit)
        for k in range(reached, unit - 1, -1):
            shares[k] = 0.5 * (shares[k] + shares[k - unit])
        for k in range(min(unit, limit + 1)):
            shares[k] *= 0.5
    total = 0.0
    for share in shares:
        total += share
    return total


def _bound(values: Float[Array, " values"], hall: _Hall) -> float:
    """Return the upper bound of the means that one of the tests does not reject."""
    error = float(values.std(ddof=1)) / sqrt(len(values))
    start = hall.interval().high
    excess = _excess(values)
    inside, outside = start, nan
    if start < 0.0 and excess(0.0) >= 0.0:
        inside = 0.0  # the verdict about 0 is that of the p-value
    elif excess(start) < 0.0:
        return start
    elif start < 0.0:
        outside = 0.0
    step = error
    while not isfinite(outside):
        if excess(inside + step) < 0.0:
            outside = inside + step
        else:
            inside, step = inside + step, 2.0 * step
    root = float(brentq(excess, inside, outside, xtol=_TOLERANCE * error))
    return root if root < outside else 0.5 * (inside + outside)


def _excess(values: Float[Array, " values"]) -> Callable[[float], float]:
    """Return the function of a mean that is negative where the sign-flip test rejects it."""
    limit = float(ndtri(0.5 * _ALPHA))
    return lambda mean: float(ndtri(0.5 * sign_flip_p(values - mean))) - limit or 1e-9
