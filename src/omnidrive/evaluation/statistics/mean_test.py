"""Intervals of means, and tests of paired differences, of values that may be skewed."""

from __future__ import annotations

from collections.abc import Callable
from math import cbrt, inf, log2, nan, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import brentq
from scipy.special import ndtri, stdtrit

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.evaluation.statistics.uncertainty import (
    CONFIDENCE,
    MeanEstimate,
    estimate_mean,
    p_value,
)

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

    The interval has Hall's correction of skewness (Hall, "On the removal of skewness by
    transformation", J. R. Statist. Soc. B 54, 1992); fewer than :data:`MIN_VALUES` values have
    Student's t. NaNs are left out.
    """
    return [_mean_interval(column[np.isfinite(column)]) for column in columns.T]


def difference_tests(columns: Float[Array, "values columns"]) -> list[TestedMean]:
    """Return mean, 95 % confidence interval and p-value of the paired differences of each column.

    The test is the sign-flip test of the mean (Fisher, "The Design of Experiments", 1935, section
    21): each difference has either sign with equal probability if the two compared have equal
    distributions. It is exact at every number of differences and for every distribution. The
    differences are rounded to units of 1 / 4,096 of the sum of their absolute values, of which all
    2^n signs are counted (Pagano & Tritchler, J. Am. Statist. Assoc. 78, 1983).

    The interval contains the means that the test does not reject, so that p < 0.05 just where it
    excludes 0. For differences that are not symmetric about their mean both are approximate, as
    are those of Student's t-test.

    n differences have p >= 2 / 2^n. More than :data:`MAX_FLIPPED` have Student's t-test instead.
    Nothing is drawn at random. NaNs are left out.
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
    return _hall_interval(values) if len(values) >= MIN_VALUES else estimate_mean(values)


def _tested_difference(values: Float[Array, " values"]) -> TestedMean:
    count = len(values)
    if count < 2:
        return TestedMean(estimate_mean(values), nan)
    constant = _constant(values)
    if constant is not None:
        return constant
    if count > MAX_FLIPPED:
        return TestedMean(estimate_mean(values), p_value(values))
    low, high = -inf, inf
    if count >= MIN_DIFFERENCES:
        low, high = -_upper_bound(-values), _upper_bound(values)
    return TestedMean(MeanEstimate(float(values.mean()), low, high, count), sign_flip_p(values))


def _constant(values: Float[Array, " values"]) -> TestedMean | None:
    """Return the tested mean of equal values, whatever their rounding; None: they differ.

    The p-value is 1 if their mean is 0, and otherwise 0.
    """
    if len(values) < 2 or values.std() ** 2 > _ROUNDING * np.mean(values**2):
        return None
    mean = float(values.mean())
    return TestedMean(MeanEstimate(mean, mean, mean, len(values)), 1.0 if mean == 0.0 else 0.0)


def _hall_interval(values: Float[Array, " values"]) -> MeanEstimate:
    """Return the means at which Hall's g(w) = w + a w^2 / 3 + a^2 w^3 / 27 + a / (6 n) is small.

    w is mean over standard deviation (ddof 0), and a the skewness; sqrt(n) g has nearly Student's
    distribution with n - 1 degrees of freedom.
    """
    count, mean, spread = len(values), float(values.mean()), float(values.std())
    skewness = float(np.mean(((values - mean) / spread) ** 3))
    quantile = float(stdtrit(count - 1, 0.5 + 0.5 * CONFIDENCE)) / sqrt(count)
    low, high = (
        mean - spread * _hall_inverse(g - skewness / (6.0 * count), skewness)
        for g in (quantile, -quantile)
    )
    return MeanEstimate(mean, low, high, count)


def _hall_inverse(y: float, a: float) -> float:
    """Return w of y = w + a w^2 / 3 + a^2 w^3 / 27."""
    return 3.0 * (cbrt(1.0 + a * y) - 1.0) / a if abs(a) > 1e-5 else y - a * y**2 / 3.0


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


def _upper_bound(values: Float[Array, " values"]) -> float:
    """Return the upper bound of the means that the sign-flip test does not reject.

    All signs are equal beyond the largest value, which :data:`MIN_DIFFERENCES` are enough to
    reject, and the p-value of the mean itself is 1.
    """
    error = float(values.std(ddof=1)) / sqrt(len(values))
    excess = _excess(values)
    inside, outside = float(values.mean()), float(values.max()) + error
    if inside < 0.0 < outside:  # the verdict about 0 is that of the p-value
        inside, outside = (0.0, outside) if excess(0.0) >= 0.0 else (inside, 0.0)
    root = float(brentq(excess, inside, outside, xtol=_TOLERANCE * error))
    return root if root < outside else 0.5 * (inside + outside)


def _excess(values: Float[Array, " values"]) -> Callable[[float], float]:
    """Return the function of a mean that is negative where the sign-flip test rejects it."""
    limit = float(ndtri(0.5 * _ALPHA))
    return lambda mean: float(ndtri(0.5 * sign_flip_p(values - mean))) - limit or 1e-9
