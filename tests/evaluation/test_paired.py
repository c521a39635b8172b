"""Paired comparison of controllers, with given error values."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from omnidrive.evaluation import paired_differences, repeated_runs, study_tables
from omnidrive.evaluation.mean_test import difference_tests
from omnidrive.simulation import Outcome

SEEDS = 12
COMMON = np.random.default_rng(3).normal(size=SEEDS)  # common effect of each seed
OWN = np.random.default_rng(4).normal(size=(3, SEEDS))
ME = {
    "fuzzy_t1": 0.05 + 0.01 * COMMON,
    "fuzzy_t2": 0.05 + 0.01 * COMMON + 1e-4 * OWN[1] + 1e-3,
    "holonomic-nmpc": 0.05 + 0.01 * COMMON + 1e-3 * OWN[2] - 1e-5,
}


@pytest.fixture(scope="module")
def repeated(study):
    """A study whose errors with noise are the values of ``ME``."""
    some = study.select("noise")[0]
    return replace(
        study,
        tracks=tuple(
            replace(some, controller=name, repeat=k, metrics=some.metrics._replace(me=values[k]))
            for k in range(SEEDS)
            for name, values in ME.items()
        ),
    )


def found(results, first, second, measure="me"):
    (one,) = (
        d
        for d in paired_differences(results)
        if (d.first, d.second, d.measure) == (first, second, measure)
    )
    return one


def pair_of(first, second):
    return difference_tests((ME[first] - ME[second])[:, None])[0]


def test_differences_are_tested_as_those_of_studies(repeated):
    d = found(repeated, "fuzzy_t2", "fuzzy_t1")
    assert d.difference == pytest.approx(pair_of("fuzzy_t2", "fuzzy_t1").estimate, rel=1e-9)
    assert d.difference.sample_size == SEEDS
    assert d.verdict == "worse"
    assert stats.ttest_ind(ME["fuzzy_t2"], ME["fuzzy_t1"]).pvalue > 0.5


def test_verdicts(repeated):
    assert found(repeated, "holonomic-nmpc", "fuzzy_t1").verdict == "no difference shown"
    assert found(repeated, "holonomic-nmpc", "fuzzy_t2").verdict == "better"
    assert found(repeated, "fuzzy_t2", "fuzzy_t1", "mae").verdict == "no difference shown"
    assert found(repeated, "fuzzy_t2", "fuzzy_t1", "mae").difference.mean == 0.0


def test_p_value_is_corrected_for_number_of_pairs(repeated):
    alone = replace(
        repeated, tracks=tuple(r for r in repeated.tracks if r.controller != "fuzzy_t1")
    )
    single = found(alone, "holonomic-nmpc", "fuzzy_t2").p
    assert single == pytest.approx(pair_of("holonomic-nmpc", "fuzzy_t2").p, rel=1e-6)
    assert found(repeated, "holonomic-nmpc", "fuzzy_t2").p == pytest.approx(2.0 * single)


def test_seed_with_stopped_run_is_excluded_from_pair(repeated):
    def stopped(result):
        run = replace(result.run, outcome=Outcome.CONTROLLER_FAILED)
        return replace(result, run=run, metrics=result.metrics._replace(me=99.0))

    broken = replace(
        repeated,
        tracks=tuple(
            stopped(r) if (r.controller, r.repeat) == ("fuzzy_t1", 5) else r
            for r in repeated.tracks
        ),
    )
    keep = np.arange(SEEDS) != 5
    d = found(broken, "fuzzy_t2", "fuzzy_t1")
    assert d.difference.sample_size == SEEDS - 1
    assert d.difference.mean == pytest.approx((ME["fuzzy_t2"] - ME["fuzzy_t1"])[keep].mean())
    assert found(broken, "holonomic-nmpc", "fuzzy_t2").difference.sample_size == SEEDS
    noise = table(broken, "Tracking error with the paper's noise")
    assert noise.rows[0][1] == "fuzzy_t1 (1 of 12 stopped)"


def table(results, title):
    return next(t for t in study_tables(results, published=False) if t.title == title)


def test_tables_have_means_and_differences_with_intervals(repeated):
    noise = table(repeated, "Tracking error with the paper's noise")
    cells = dict(zip(noise.columns, noise.rows[0], strict=True))
    low, high = stats.t.interval(
        0.95, SEEDS - 1, np.mean(ME["fuzzy_t1"]), stats.sem(ME["fuzzy_t1"])
    )
    mean, half = 1e3 * np.mean(ME["fuzzy_t1"]), 0.5e3 * (high - low)
    assert cells["ME true, mm"] == f"{mean:.1f} ± {half:.1f}"
    assert half > 10.0  # two digits of the half width, at least one decimal
    assert "Over 12 seeds" in noise.note
    paired = table(repeated, "Paired differences with noise")
    assert len(paired.rows) == 3 * 4
    assert {row[0] for row in paired.rows} == {
        "fuzzy_t2 \N{MINUS SIGN} fuzzy_t1",
        "holonomic-nmpc \N{MINUS SIGN} fuzzy_t1",
        "holonomic-nmpc \N{MINUS SIGN} fuzzy_t2",
    }
    assert "Holm" in paired.note
    row = dict(zip(paired.columns, paired.rows[2], strict=True))
    assert row["error"] == "ME true, mm"
    assert row["mean difference"].startswith("+0.98")
    assert (row["p"], row["seeds"], row["first is"]) == ("0.001", "12", "worse")


def test_single_seed_has_no_differences(study):
    assert repeated_runs(study) == paired_differences(study) == []
    assert all("Paired" not in t.title for t in study_tables(study, published=True))
