"""Studentised bootstrap: hand-computed cases, coverage, and agreement with SciPy."""

from math import isnan, sqrt

import numpy as np
import pytest
from scipy import stats

from omnidrive.evaluation.bootstrap import MIN_VALUES, bootstrap_means
from omnidrive.evaluation.uncertainty import estimate_mean, p_value

LAWS = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "gamma differences": lambda rng, shape: rng.gamma(3.0, size=shape) - rng.gamma(3.0, size=shape),
}


def test_interval_is_close_to_students_t_for_normal_values():
    values = stats.norm.ppf((np.arange(200) + 0.5) / 200)
    ours, students = bootstrap_means(values[:, None])[0].estimate, estimate_mean(values)
    assert ours.mean == pytest.approx(students.mean, abs=1e-12)
    assert ours.margin == pytest.approx(students.margin, rel=0.03)


def test_interval_agrees_with_brute_force():
    """Every resample of the definition, with a loop."""
    values = np.random.default_rng(5).exponential(size=12)
    rng, ratios = np.random.default_rng(9), []
    for _ in range(20_000):
        sample = rng.choice(values, len(values))
        error = sample.std(ddof=1) / sqrt(len(values))
        ratios.append(abs(sample.mean() - values.mean()) / error if error else np.inf)
    margin = np.quantile(ratios, 0.95) * values.std(ddof=1) / sqrt(len(values))
    found = bootstrap_means(values[:, None])[0].estimate
    assert found.margin == pytest.approx(margin, rel=0.05)


def test_p_value_and_interval_agree():
    rng = np.random.default_rng(3)
    tested = bootstrap_means(rng.normal(size=(25, 300)) + np.linspace(-1.0, 1.0, 300))
    for each in tested:
        assert (each.p < 0.05) == (each.estimate.low > 0.0 or each.estimate.high < 0.0)
    assert 0 < sum(each.p < 0.05 for each in tested) < 300


def test_p_value_agrees_with_permutation_test_of_scipy():
    values = np.random.default_rng(8).normal(0.35, 1.0, size=40)
    exact = stats.permutation_test(
        (values,), np.mean, permutation_type="samples", n_resamples=20_000,
        rng=np.random.default_rng(1),
    ).pvalue  # fmt: skip
    assert bootstrap_means(values[:, None])[0].p == pytest.approx(exact, abs=0.02)


def test_few_values_have_students_t():
    values = np.random.default_rng(2).normal(size=MIN_VALUES - 1)
    found = bootstrap_means(values[:, None])[0]
    assert found.estimate == estimate_mean(values)
    assert found.p == p_value(values)
    one = bootstrap_means(np.array([[2.0]]))[0]
    assert one.estimate.mean == 2.0
    assert isnan(one.estimate.low)
    assert isnan(one.p)


@pytest.mark.parametrize("count", [3, 30])
def test_equal_values_have_no_width(count):
    rounded = 0.1 + 1e-17 * np.arange(count)
    columns = np.column_stack([np.zeros(count), np.full(count, 0.3), rounded])
    zero, constant, rounded = bootstrap_means(columns)
    assert (zero.p, constant.p, rounded.p) == (1.0, 0.0, 0.0)
    assert constant.estimate[:3] == pytest.approx((0.3, 0.3, 0.3), abs=1e-15)
    assert rounded.estimate.margin == 0.0


def test_missing_values_are_left_out():
    values = np.random.default_rng(4).normal(size=(40, 2))
    values[5:15, 1] = np.nan
    first, second = bootstrap_means(values)
    known = values[np.isfinite(values[:, 1]), 1]
    assert first.estimate == pytest.approx(bootstrap_means(values[:, :1])[0].estimate)
    assert second.estimate == pytest.approx(bootstrap_means(known[:, None])[0].estimate)
    assert second.estimate.sample_size == 30


def test_equal_data_give_equal_intervals():
    values = np.random.default_rng(4).normal(size=(40, 2))
    assert bootstrap_means(values) == bootstrap_means(values.copy())


def flagged(law, studies, count, seed):
    """Share of studies of equal controllers in which a difference is claimed."""
    rng = np.random.default_rng(seed)
    return np.mean([t.p < 0.05 for t in bootstrap_means(LAWS[law](rng, (count, studies)))])


@pytest.mark.parametrize("law", LAWS)
def test_equal_controllers_are_rarely_told_apart(law):
    assert flagged(law, 300, 20, seed=11) == pytest.approx(0.05, abs=0.03)


@pytest.mark.long
@pytest.mark.parametrize("count", [20, 50, 200])
@pytest.mark.parametrize("law", LAWS)
def test_equal_controllers_are_told_apart_in_5_percent_of_1000_studies(law, count):
    assert flagged(law, 1000, count, seed=1) == pytest.approx(0.05, abs=0.014)
