"""Always valid intervals: hand-computed cases, width, and the error over all sample sizes."""

from math import inf, isfinite, log, sqrt

import numpy as np
import pytest

from omnidrive.evaluation.statistics.confidence_sequence import (
    always_valid_mean,
    always_valid_p,
    values_needed,
)
from omnidrive.evaluation.statistics.uncertainty import estimate_mean

LAWS = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "heavy tails": lambda rng, shape: rng.standard_t(3, size=shape),
    "two values": lambda rng, shape: rng.choice([-1.0, 1.0], size=shape),
    "mostly equal": lambda rng, shape: rng.normal(size=shape) * (rng.random(shape) < 0.15),
    "differences of skewed errors": lambda rng, shape: (
        rng.lognormal(size=shape) - rng.lognormal(size=shape)
    ),
}


SKEWED = {
    "exponential": lambda rng, shape: rng.exponential(size=shape) - 1.0,
    "lognormal": lambda rng, shape: rng.lognormal(size=shape) - np.exp(0.5),
}
"""Skewed differences of mean 0, whose error the documentation states."""


def test_bound_is_where_the_martingale_reaches_its_limit():
    values = np.random.default_rng(1).normal(0.3, 2.0, size=50)
    found = always_valid_mean(values)
    for bound in (found.low, found.high):
        total, power = np.sum(values - bound), np.sum((values - bound) ** 2)
        ratio = 70.0 * power / (70.0 * power - total**2)
        assert sqrt(20.0 / 70.0) * ratio**25 == pytest.approx(20.0, rel=1e-9)
        assert always_valid_p(values - bound) == pytest.approx(0.05, rel=1e-9)


def test_width_tends_to_that_of_the_asymptotic_sequence():
    """Waudby-Smith et al. 2024, theorem 2.2, with rho^2 = 1 / 20 for unit variance."""
    values = np.tile([-1.0, 1.0], 50_000)
    rho = 1.0 / 20.0
    n = len(values)
    expected = sqrt(2.0 * (n * rho + 1.0) / (n**2 * rho) * log(sqrt(n * rho + 1.0) / 0.05))
    assert always_valid_mean(values).margin == pytest.approx(expected, rel=1e-3)


def test_interval_is_wider_than_a_fixed_one_and_unbounded_for_few_values():
    values = np.random.default_rng(2).normal(size=400)
    for count in (20, 100, 400):
        ratio = always_valid_mean(values[:count]).margin / estimate_mean(values[:count]).margin
        assert 1.4 < ratio < 2.8
    assert always_valid_mean(values[:12]).margin == inf
    assert isfinite(always_valid_mean(values[:13]).margin)
    assert always_valid_mean(values[:1]).margin == inf


def test_p_value_and_interval_agree():
    for shift in np.linspace(-1.0, 1.0, 41):
        values = np.random.default_rng(3).normal(size=60) + shift
        found = always_valid_mean(values)
        assert (always_valid_p(values) < 0.05) == (found.low > 0.0 or found.high < 0.0)
    assert always_valid_p(np.zeros(40)) == 1.0


def test_values_needed_is_the_first_narrow_enough_number():
    pattern = np.array([-1.0, 1.0])
    needed = int(values_needed(1.0, 0.2))
    even = needed + needed % 2
    assert always_valid_mean(np.tile(pattern, even // 2)).margin <= 0.2
    assert always_valid_mean(np.tile(pattern, even // 2 - 1)).margin > 0.2
    assert values_needed(1.0, 1e-9) == inf
    assert values_needed(0.0, 1e-3) == 13.0


def ever_flagged(law, studies, longest, seed, shortest=1):
    """Share of studies of equal controllers in which an interval excludes 0 at any size."""
    rng = np.random.default_rng(seed)
    count = 0
    for values in {**LAWS, **SKEWED}[law](rng, (studies, longest)):
        sums, powers = np.cumsum(values), np.cumsum(values**2)
        sizes = np.arange(1, longest + 1)
        suspect = np.flatnonzero(
            (sums**2 > 4.0 * powers) & (sizes >= shortest)
        )  # all others have p > 0.05
        count += any(always_valid_p(values[: sizes[k]]) < 0.05 for k in suspect)
    return count / studies


@pytest.mark.parametrize("law", LAWS)
def test_equal_controllers_are_rarely_told_apart_at_any_time(law):
    assert ever_flagged(law, 100, 300, seed=5) <= 0.08


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_at_most_5_percent_of_1000_sequential_studies_ever_tell_equal_controllers_apart(law):
    assert ever_flagged(law, 1000, 2000, seed=6) <= 0.05


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "shortest", "share"),
    [("exponential", 13, 0.076), ("exponential", 100, 0.049),
     ("lognormal", 13, 0.16), ("lognormal", 100, 0.088), ("lognormal", 200, 0.053)],
)  # fmt: skip
def test_stated_error_of_skewed_differences(law, shortest, share):
    assert ever_flagged(law, 1000, 2000, 6, shortest) == pytest.approx(share, abs=0.02)
