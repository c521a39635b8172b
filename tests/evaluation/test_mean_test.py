"""Intervals of means and tests of paired differences: closed cases, error, power."""

from itertools import product
from math import inf, isnan, sqrt

import numpy as np
import pytest
from scipy import stats

from omnidrive.evaluation.statistics.mean_test import (
    MAX_FLIPPED,
    MIN_DIFFERENCES,
    MIN_VALUES,
    difference_tests,
    mean_intervals,
    needed_differences,
    sign_flip_p,
)
from omnidrive.evaluation.statistics.uncertainty import estimate_mean, p_value

EQUAL = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "Laplace": lambda rng, shape: rng.laplace(size=shape),
    "Student, 3 degrees": lambda rng, shape: rng.standard_t(3, size=shape),
    "mostly 0": lambda rng, shape: rng.normal(size=shape) * (rng.random(shape) < 0.3),
    "lognormal runs": lambda rng, shape: rng.lognormal(size=shape) - rng.lognormal(size=shape),
    "exponential runs": lambda rng, shape: np.subtract(*rng.exponential(size=(2, *shape))),
}
"""Differences of two equally distributed runs, which are symmetric."""

SKEWED = {
    "exponential": lambda rng, shape: rng.exponential(size=shape) - 1.0,
    "lognormal": lambda rng, shape: rng.lognormal(size=shape) - np.exp(0.5),
}
"""Skewed differences of mean 0."""


def twice(error):
    """Return differences of a controller that is twice as bad but for 20 % of noise."""
    return lambda rng, shape: error(rng, shape) * (2.0 * rng.lognormal(0.0, 0.2, shape) - 1.0)


WORSE = {
    "twice exponential": twice(lambda rng, shape: rng.exponential(size=shape)),
    "twice lognormal": twice(lambda rng, shape: rng.lognormal(size=shape)),
    "gamma": lambda rng, shape: rng.gamma(0.5, size=shape),
    "spikes": lambda rng, shape: (
        rng.normal(1.0, 0.3, shape) + (rng.random(shape) < 0.1) * rng.exponential(10.0, shape)
    ),
}
"""Skewed differences of a controller that is worse in nearly every repetition."""

BETTER_IN_7_OF_8 = np.array([-1.04, -0.79, -0.76, -0.74, -0.58, -0.45, -0.42, 0.30])
"""Mean -0.56, standardised -1.40, skewness 1.19: the one bad repetition is towards 0."""


def one(values):
    return difference_tests(np.asarray(values, dtype=float)[:, None])[0]


def outside(estimate):
    return estimate.low > 0.0 or estimate.high < 0.0


def issue_like(count=24, mean=84.6, half_width=32.8):
    """Return right-skewed positive differences of a mean and a half width of Student's t."""
    values = stats.lognorm.ppf((np.arange(count) + 0.5) / count, 1.0)
    spread = half_width * sqrt(count) / stats.t.ppf(0.975, count - 1)
    values = (values - values.mean()) / values.std(ddof=1) * spread + mean
    return np.where(values > 0.0, values, 1.0)


@pytest.mark.parametrize("count", [6, 12, 24, 40])
def test_differences_of_one_sign_have_the_least_p_value(count):
    values = np.random.default_rng(count).lognormal(size=count)
    assert sign_flip_p(values) == 2.0 / 2**count
    assert sign_flip_p(-values) == 2.0 / 2**count


def test_sign_flip_test_agrees_with_all_signs():
    values = np.array([3.0, -1.0, 4.0, 2.0, -2.0, 5.0, 0.0, 6.0])
    sums = [abs(np.dot(signs, values)) for signs in product((-1.0, 1.0), repeat=len(values))]
    assert sign_flip_p(values) == np.mean(np.array(sums) >= values.sum())


@pytest.mark.parametrize("seed", range(5))
def test_sign_flip_test_agrees_with_scipy(seed):
    values = np.random.default_rng(seed).normal(0.4, 1.0, size=12)
    exact = stats.permutation_test(
        (values,), np.mean, permutation_type="samples", n_resamples=np.inf
    ).pvalue
    assert sign_flip_p(values) == pytest.approx(exact, abs=1e-3)


def test_skewness_is_corrected_as_by_hall():
    values = np.random.default_rng(5).exponential(size=200)
    w, a = values.mean() / values.std(), stats.skew(values)
    (found,) = mean_intervals(values[:, None])
    for bound, tail in ((found.low, 0.975), (found.high, 0.025)):
        w = (values.mean() - bound) / values.std()
        g = w + a * w**2 / 3.0 + a**2 * w**3 / 27.0 + a / 1200.0
        assert sqrt(200) * g == pytest.approx(stats.t.ppf(tail, 199), rel=1e-9)


def test_symmetric_values_have_students_t():
    values = np.array([-5.0, -4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0, 5.0]) + 1.0
    (found,) = mean_intervals(values[:, None])
    ours, students = found.margin, estimate_mean(values).margin
    assert ours == pytest.approx(students * sqrt(9 / 10), rel=1e-9)


@pytest.mark.parametrize("count", [6, 12, 40, 101])
def test_p_value_and_interval_agree(count):
    rng = np.random.default_rng(3)
    columns = rng.lognormal(size=(count, 200)) - np.linspace(0.0, 3.0, 200)
    found = difference_tests(np.column_stack([columns, -columns]))
    for each, mirrored in zip(found[:200], found[200:], strict=True):
        assert (each.p < 0.05) == outside(each.estimate)
        assert mirrored.p == pytest.approx(each.p)
        assert each.estimate.low <= each.estimate.mean <= each.estimate.high
    assert 0 < sum(each.p < 0.05 for each in found) < 400


@pytest.mark.parametrize("count", [12, 40])
def test_bounds_are_where_a_test_begins_to_reject(count):
    values = np.random.default_rng(2).standard_t(3, size=count)
    found = one(values).estimate
    step = 0.02 * values.std()
    for bound, away in ((found.low, -step), (found.high, step)):
        assert one(values - bound - away).p < 0.05
        assert one(values - bound + away).p >= 0.05


def test_few_differences_show_nothing():
    for count in range(2, MIN_DIFFERENCES):
        found = one(np.arange(count) + 10.0)
        assert found.p >= 0.05
        assert (found.estimate.low, found.estimate.high) == (-inf, inf)
    assert one(np.arange(MIN_DIFFERENCES) + 10.0).p == 2.0 / 2**MIN_DIFFERENCES
    assert isnan(one([2.0]).p)
    assert isnan(one([2.0]).estimate.low)


def test_needed_differences_pass_holms_correction():
    assert needed_differences(1) == MIN_DIFFERENCES
    for comparisons in (1, 3, 21, 1000):
        needed = needed_differences(comparisons)
        assert comparisons * 2.0 / 2**needed < 0.05 <= comparisons * 4.0 / 2**needed


def test_many_differences_have_students_t():
    values = np.random.default_rng(1).standard_t(3, size=MAX_FLIPPED + 1) + 0.2
    assert one(values) == (estimate_mean(values), p_value(values))


def test_sign_flip_test_tends_to_students_t():
    values = np.random.default_rng(1).normal(0.2, size=MAX_FLIPPED)
    found, students = one(values), estimate_mean(values)
    assert found.p == pytest.approx(p_value(values), abs=0.005)
    assert found.estimate.low == pytest.approx(students.low, abs=0.05 * students.margin)
    assert found.estimate.high == pytest.approx(students.high, abs=0.05 * students.margin)


@pytest.mark.parametrize("count", [6, 9, 12])
def test_interval_has_bounds_among_the_means_of_all_subsets(count):
    """The sign-flip test of a mean counts the subsets whose mean exceeds it."""
    values = np.random.default_rng(count).lognormal(size=count)
    subsets = np.array(list(product((0.0, 1.0), repeat=count)))[1:]
    means = np.sort(subsets @ values / subsets.sum(axis=1))
    rejected = int(0.025 * 2**count)  # subsets in a tail, one of which is the empty one
    found = one(values).estimate
    tolerance = 0.03 * values.std() / sqrt(count)
    assert found.low == pytest.approx(means[rejected - 1], abs=tolerance)
    assert found.high == pytest.approx(means[-rejected], abs=tolerance)


def test_few_values_have_students_t():
    values = np.random.default_rng(2).normal(size=MIN_VALUES - 1)
    assert mean_intervals(values[:, None]) == [estimate_mean(values)]


@pytest.mark.parametrize("count", [3, 30])
def test_equal_values_have_no_width(count):
    rounded = 0.1 + 1e-17 * np.arange(count)
    columns = np.column_stack([np.zeros(count), np.full(count, 0.3), rounded])
    zero, constant, rounded = difference_tests(columns)
    assert (zero.p, constant.p, rounded.p) == (1.0, 0.0, 0.0)
    assert constant.estimate[:3] == pytest.approx((0.3, 0.3, 0.3), abs=1e-15)
    assert rounded.estimate.margin == 0.0
    assert [each.margin for each in mean_intervals(columns)] == [0.0, 0.0, 0.0]


def test_missing_values_are_left_out():
    values = np.random.default_rng(4).normal(size=(40, 2))
    values[5:15, 1] = np.nan
    first, second = difference_tests(values)
    known = values[np.isfinite(values[:, 1]), 1]
    assert first == one(values[:, 0])
    assert second == one(known)
    assert mean_intervals(values)[1] == mean_intervals(known[:, None])[0]


def test_large_skewed_difference_is_shown():
    """Positive in all of 24 repetitions, and skewed away from 0."""
    values = issue_like()
    assert values.mean() == pytest.approx(84.6, abs=3.0)
    assert estimate_mean(values).low == pytest.approx(51.8, abs=4.0)
    assert (values > 0.0).all()
    assert stats.skew(values) > 2.0
    found = one(values)
    assert 21 * found.p < 0.05
    assert found.estimate.low > 40.0


def test_large_difference_with_one_bad_repetition_is_shown():
    """Student's t-test and the exact test agree; an interval of +-3 standard errors does not."""
    values = BETTER_IN_7_OF_8
    assert values.mean() == pytest.approx(-0.56)
    assert values.mean() / values.std(ddof=1) == pytest.approx(-1.40, abs=0.01)
    assert stats.skew(values) == pytest.approx(1.19, abs=0.01)
    assert estimate_mean(values)[1:3] == pytest.approx((-0.89, -0.23), abs=0.01)
    assert p_value(values) == pytest.approx(0.005, abs=1e-3)
    for sign in (1.0, -1.0):
        assert one(sign * values).p == 4.0 / 2**8
    assert one(values).estimate[1:3] == pytest.approx((-0.86, -0.22), abs=0.01)


def test_outlier_towards_zero_takes_from_the_evidence():
    values = np.append(np.full(23, -1.0) + 0.01 * np.arange(23), 12.0)
    assert p_value(values) == pytest.approx(0.45, abs=0.1)
    assert one(values).p > 0.05


def flagged(law, studies, count, seed):
    """Share of studies in which a difference is claimed."""
    rng = np.random.default_rng(seed)
    return np.mean([each.p < 0.05 for each in difference_tests(law(rng, (count, studies)))])


@pytest.mark.parametrize("law", EQUAL)
def test_equal_controllers_are_rarely_told_apart(law):
    assert flagged(EQUAL[law], 300, 12, seed=11) <= 0.09


@pytest.mark.parametrize("law", WORSE)
def test_skewed_differences_are_found(law):
    assert flagged(WORSE[law], 100, 12, seed=12) >= 0.95


@pytest.mark.parametrize(("count", "power"), [(8, 0.75), (12, 0.9), (20, 0.98)])
def test_large_differences_with_skewness_towards_zero_are_found(count, power):
    assert flagged(lambda rng, shape: 2.4 - rng.exponential(size=shape), 300, count, 13) >= power


@pytest.mark.long
@pytest.mark.parametrize("count", [3, 6, 8, 12, 20, 40, 200])
@pytest.mark.parametrize("law", EQUAL)
def test_equal_controllers_are_told_apart_in_5_percent_of_studies(law, count):
    assert flagged(EQUAL[law], 2000, count, seed=1) <= 0.064


@pytest.mark.parametrize("count", [8, *(pytest.param(n, marks=pytest.mark.long) for n in (12, 40))])
@pytest.mark.parametrize("law", SKEWED)
def test_skewed_differences_of_mean_zero_are_claimed_no_more_than_by_students_t(law, count):
    def students(rng, shape):
        values = SKEWED[law](rng, shape)
        return np.mean([p_value(column) < 0.05 for column in values.T])

    found = flagged(SKEWED[law], 500, count, seed=1)
    assert found <= students(np.random.default_rng(1), (count, 500)) + 0.01
    assert found <= 0.19


@pytest.mark.long
@pytest.mark.parametrize("count", [8, 12, 20, 40])
@pytest.mark.parametrize("law", WORSE)
def test_95_percent_of_skewed_differences_are_found(law, count):
    assert flagged(WORSE[law], 1000, count, seed=2) >= 0.95
