"""Studentised bootstrap of means and paired differences."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from math import ceil, inf
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, UInt16

from omnidrive.arrays import Array
from omnidrive.evaluation.uncertainty import CONFIDENCE, MeanEstimate, estimate_mean, p_value

MIN_VALUES, MAX_VALUES = 10, 2_000
"""Numbers of values for which intervals are bootstrapped; fewer and more have Student's t."""

_RESAMPLES = 4_999
_BLOCK = 1_000_000  # draws at once, a limit of memory
_SEED = 20_080_229  # of the resamples; equal data give equal intervals
_ROUNDING = 1e-12  # relative variance below which all values count as equal


class TestedMean(NamedTuple):
    """A mean with its interval and the p-value of zero mean."""

    estimate: MeanEstimate
    p: float
    """Two-sided p-value; NaN for fewer than two values."""


def bootstrap_means(columns: Float[Array, "values columns"]) -> list[TestedMean]:
    """Return mean, 95 % confidence interval and p-value of the independent values of each column.

    Symmetric bootstrap-t: the distribution over resamples of the absolute deviation of the mean
    from that of the values, in standard errors of the resample, replaces Student's t (Hall, "The
    Bootstrap and Edgeworth Expansion", 1992, section 3.6). The error of its coverage for n values
    is of order n^-2, that of Student's t and of BCa of order n^-1. The p-value is that of the same
    distribution, so that p < 0.05 just where the interval excludes 0; where no resample deviates as
    much, which means p < 0.0002, it is that of Student's t, if that is less. All columns have the
    same resamples, which depend on the number of values only. NaNs of a column are left out. Fewer
    than :data:`MIN_VALUES` values, too few for resamples, and more than :data:`MAX_VALUES`, whose
    mean is normally distributed, have Student's t.
    """
    known = np.isfinite(columns)
    found: list[TestedMean | None] = [None] * columns.shape[1]
    for pattern, members in _by_pattern(known):
        values = columns[pattern][:, members]
        for k, tested in zip(members, _test_columns(values), strict=True):
            found[k] = tested
    return [each for each in found if each is not None]


def _by_pattern(known: Bool[Array, "values columns"]) -> Iterator[tuple[Array, list[int]]]:
    """Yield each pattern of known values with the columns that have it."""
    members: dict[bytes, list[int]] = {}
    for k in range(known.shape[1]):
        members.setdefault(known[:, k].tobytes(), []).append(k)
    for columns in members.values():
        yield known[:, columns[0]], columns


def _test_columns(values: Float[Array, "values columns"]) -> list[TestedMean]:
    """Return the tested mean of every column; all values are finite."""
    count = len(values)
    simple = [TestedMean(estimate_mean(column), p_value(column)) for column in values.T]
    if not MIN_VALUES <= count <= MAX_VALUES:
        return [_with_constant(each, column) for each, column in zip(simple, values.T, strict=True)]
    means, spread = values.mean(axis=0), values.std(axis=0, ddof=1)
    constant = spread**2 <= _ROUNDING * np.mean(values**2, axis=0)
    scaled = (values - means) / np.where(constant, 1.0, spread)
    ratios = np.sort(_resampled_ratios(np.where(constant, 0.0, scaled)), axis=0)
    quantile = ratios[ceil((_RESAMPLES + 1) * CONFIDENCE) - 1]
    found = []
    for k, each in enumerate(simple):
        if constant[k]:
            found.append(_with_constant(each, values[:, k]))
            continue
        error = spread[k] / np.sqrt(count)
        mean, margin = float(means[k]), float(quantile[k] * error)
        beyond = _RESAMPLES - int(np.searchsorted(ratios[:, k], abs(mean) / error))
        p = (beyond + 1) / (_RESAMPLES + 1)
        p = min(p, each.p) if beyond == 0 else p
        found.append(TestedMean(MeanEstimate(mean, mean - margin, mean + margin, count), p))
    return found


def _with_constant(tested: TestedMean, values: Float[Array, " values"]) -> TestedMean:
    """Return the tested mean; equal values have an interval of no width, whatever their rounding.

    Without a spread there is no evidence against a zero mean only if the mean is 0.
    """
    if len(values) < 2 or values.std() ** 2 > _ROUNDING * np.mean(values**2):
        return tested
    mean = float(values.mean())
    p = 1.0 if mean == 0.0 else 0.0
    return TestedMean(MeanEstimate(mean, mean, mean, len(values)), p)


def _resampled_ratios(values: Float[Array, "values columns"]) -> Float[Array, "resamples columns"]:
    """Return the absolute mean over its standard error, for every resample of centred values.

    A resample of equal values has no standard error: its ratio is infinite, which widens the
    interval, or 0 if its mean is 0.
    """
    count, parts = len(values), []
    moments = np.concatenate([values, values**2], axis=1)
    block = max(_BLOCK // count, 1)
    weights = _resample_weights(count)
    for start in range(0, _RESAMPLES, block):
        sums = weights[start : start + block].astype(np.float64) @ moments / count
        means, squares = np.split(sums, 2, axis=1)
        variances = (squares - means**2) * count / (count - 1)
        flat = variances <= _ROUNDING
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = np.abs(means) / np.sqrt(variances / count)
        parts.append(np.where(flat, np.where(np.abs(means) < 1e-9, 0.0, inf), ratios))
    return np.concatenate(parts)


@lru_cache(maxsize=4)
def _resample_weights(count: int) -> UInt16[Array, "resamples values"]:
    """Return how often each of ``count`` values is in each resample."""
    rng, block = np.random.default_rng([_SEED, count]), max(_BLOCK // count, 1)
    parts = []
    for start in range(0, _RESAMPLES, block):
        rows = min(block, _RESAMPLES - start)
        draws = rng.integers(0, count, (rows, count)) + count * np.arange(rows)[:, None]
        weights = np.bincount(draws.ravel(), minlength=rows * count).reshape(rows, count)
        parts.append(weights.astype(np.uint16))
    return np.concatenate(parts)
