"""Variance shares: hand-computed cases and known models."""

from math import isnan

import numpy as np
import pytest

from omnidrive.evaluation.statistics.run_table import RunTable
from omnidrive.evaluation.statistics.variance_shares import variance_shares
from tests.evaluation.synthetic_runs import synthetic_table


def shares(table):
    runs = RunTable(table)
    return {each.factor: each for each in variance_shares(runs, "me", runs.tasks[0])}


def test_shares_of_an_additive_model():
    """Variances 4 (mass: -2, 2), 1 (friction: -1, 1) and 5 (repetition and run)."""
    axes = {"mass": [-2.0, 2.0], "friction": [-1.0, 1.0], "lag": [0.0, 1.0]}
    table = synthetic_table(
        {"a": 0.0, "b": 0.0}, repetitions=200, axes=axes, common=2.0, own=1.0,
        value=lambda _, f: f["mass"] + f["friction"],
    )  # fmt: skip
    found = shares(table)
    assert list(found)[:2] == ["mass", "friction"]
    assert found["mass"].share == pytest.approx(0.4, abs=0.05)
    assert found["friction"].share == pytest.approx(0.1, abs=0.03)
    assert found["lag"].share < 0.01
    assert found["controller"].share < 0.01
    assert found["mass"].low < 0.4 < found["mass"].high


def test_share_of_a_pure_effect_is_one():
    axes = {"mass": [1.0, 2.0, 4.0]}
    table = synthetic_table({"a": 0.0}, repetitions=12, axes=axes, common=0.0, own=0.0,
                            value=lambda _, f: f["mass"])  # fmt: skip
    assert shares(table)["mass"][1:] == pytest.approx((1.0, 1.0, 1.0))


def test_random_factor_without_effect_has_no_share():
    """Its few repetitions differ by chance; their runs are not independent."""
    found = []
    for seed in range(30):
        x = np.random.default_rng([seed, 1]).random(40).tolist()
        table = synthetic_table({"a": 0.0, "b": 0.0}, repetitions=40, axes={"m": [0.0, 1.0, 2.0]},
                                random={"x": x}, common=1.0, own=0.1, seed=seed)  # fmt: skip
        found.append(shares(table)["x"].share)
    assert np.mean(found) < 0.1


def test_random_factor_with_effect_has_its_share():
    x = np.random.default_rng(2).random(1000).tolist()
    table = synthetic_table({"a": 0.0}, repetitions=1000, random={"x": x}, common=0.0,
                            own=1.0 / 12.0**0.5, value=lambda _, f: f["x"])  # fmt: skip
    assert shares(table)["x"].share == pytest.approx(0.5, abs=0.06)


def test_no_variance_and_few_repetitions():
    constant = synthetic_table({"a": 1.0}, repetitions=5, axes={"m": [1.0, 2.0]}, common=0.0, own=0)
    assert shares(constant) == {}
    few = shares(synthetic_table({"a": 1.0}, repetitions=5, axes={"m": [1.0, 2.0]}))
    assert isnan(few["m"].low)
