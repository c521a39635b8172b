"""Confidence intervals and significance tests, compared with SciPy."""

from math import isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from omnidrive.evaluation.statistics.uncertainty import estimate_mean, holm, p_value
from tests.examples import examples


@examples(50)
@given(seed=st.integers(0, 2**32), count=st.integers(2, 60), shift=st.floats(-2, 2))
def test_interval_and_p_value_match_scipy_paired_test(seed, count, shift):
    a, b = np.random.default_rng(seed).normal(size=(2, count))
    a += shift
    expected = stats.ttest_rel(a, b)
    low, high = expected.confidence_interval(0.95)
    actual = estimate_mean(a - b)
    assert (actual.low, actual.high) == pytest.approx((low, high), rel=1e-9)
    assert actual.mean == pytest.approx(np.mean(a - b))
    assert p_value(a - b) == pytest.approx(expected.pvalue, rel=1e-9)


def test_coverage_of_interval():
    draws = np.random.default_rng(1).normal(3.0, 2.0, size=(2000, 8))
    covered = [e.low <= 3.0 <= e.high for e in map(estimate_mean, draws)]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.02)


def test_too_few_values_have_no_interval():
    assert isnan(estimate_mean(np.array([])).mean)
    one = estimate_mean(np.array([2.0]))
    assert (one.mean, one.sample_size) == (2.0, 1)
    assert isnan(one.low)
    assert isnan(p_value(np.array([2.0])))


def test_values_without_spread():
    assert estimate_mean(np.full(5, 0.5))[:3] == (0.5, 0.5, 0.5)
    assert p_value(np.full(5, 0.5)) == 0.0
    assert p_value(np.zeros(5)) == 1.0


def test_holm_example():
    """Holm 1979: 0.01 * 4, 0.015 * 3, 0.03 * 2, and 0.04 raised to its predecessor."""
    assert holm([0.03, 0.01, 0.04, 0.015]) == pytest.approx([0.06, 0.04, 0.06, 0.045])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([1.0, 2.0, 3.0], ("+2.0", "2.5", "\N{MINUS SIGN}0.5", "+4.5")),
        ([-0.0101, -0.0102, -0.0103], ("\N{MINUS SIGN}0.01020", "0.00025",
                                       "\N{MINUS SIGN}0.01045", "\N{MINUS SIGN}0.00995")),
        ([2.0], ("2.00", "–", "–", "–")),
        ([2.0, 2.0], ("+2.0000", "0.0000", "+2.0000", "+2.0000")),
        ([0.0, 0.0], ("0", "0", "0", "0")),
        ([1e-12, 3e-12], ("0", "0", "0", "0")),
        ([-1.0, 0.999], ("+0.0", "12.7", "\N{MINUS SIGN}12.7", "+12.7")),
        ([1e-7, 1.1e-6], ("+6.0e\N{MINUS SIGN}07", "6.4e-06", "\N{MINUS SIGN}5.8e\N{MINUS SIGN}06",
                          "+7.0e\N{MINUS SIGN}06")),
    ],
)  # fmt: skip
def test_text_has_two_digits_of_margin(values, texts):
    assert estimate_mean(np.array(values)).text() == texts
