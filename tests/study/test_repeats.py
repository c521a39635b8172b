"""Repeated noise runs: seeds, equal noise for all controllers, and statistics."""

import json
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest

from omnidrive.evaluation import measure
from omnidrive.scenario import (
    RunSettings,
    one_task,
    plan_and_check,
    retime,
    settings_of_runs,
    simulate_run,
)
from omnidrive.scenario.run_settings import run_name
from omnidrive.study import read_study, run_study
from tests.study.small import noise_scenario, small_scenario
from tests.study.test_study import numbers

SEEDS = 3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("repeats") / "run"
    run_study(noise_scenario(SEEDS), path)
    return path


def noise(folder, run):
    table = pq.read_table(folder / run["series"])
    return np.array([table[f"measured_{c}"].to_numpy() - table[c].to_numpy() for c in ("x", "yaw")])


def test_first_repeat_equals_a_study_without_repeats(folder):
    once = [job for job in settings_of_runs(small_scenario()) if job.task == "noise"]
    assert [job.repeat for job in once] == [0] * 4
    first = next(r for r in numbers(folder)["runs"] if r["controller"] == "holonomic-nmpc")
    planned, single = plan_and_check(small_scenario()), RunSettings("noise", "holonomic-nmpc", 20.0)
    assert run_name(planned.scenario, single) == first["name"] == "noise-holonomic-nmpc-20s"
    assert measure(simulate_run(planned, single), planned.robot.drive).me == first["me"]


@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**53])
@pytest.mark.parametrize("duration", [0.1, 30.0, 3600.0])
def test_trailing_zero_of_a_seed_has_no_effect(seed, duration):
    """Repeat 0 therefore has the random numbers of a study without repeats."""
    words = [seed, round(duration * 1e6)]
    before, now = (np.random.default_rng(w).random(5) for w in (words, [*words, 0]))
    assert before.tobytes() == now.tobytes()


def test_noise_depends_on_the_repeat_and_not_on_the_controller(folder):
    runs = json.loads((folder / "results.json").read_text())["runs"]
    assert len({r["name"] for r in runs}) == len(runs) == 3 * SEEDS
    by_seed = {}
    for run in runs:
        by_seed.setdefault(run["repeat"], []).append(noise(folder, run))
    assert sorted(by_seed) == list(range(SEEDS))
    for first, *others in by_seed.values():
        for other in others:
            np.testing.assert_allclose(other, first, atol=1e-12)
    rows = [same[0] for same in by_seed.values()]
    assert all(np.abs(a - b).max() > 0.05 for a, b in pairwise(rows))


@pytest.mark.long
def test_results_are_equal_with_two_processes(folder, tmp_path):
    run_study(noise_scenario(SEEDS), tmp_path / "again", processes=2)
    assert numbers(tmp_path / "again") == numbers(folder)


def test_results_contain_means_and_paired_differences(folder):
    data = json.loads((folder / "results.json").read_text())
    errors = {
        name: np.array([r["me"] for r in data["runs"] if r["controller"] == name])
        for name in ("fuzzy_t1", "fuzzy_t2", "holonomic-nmpc")
    }
    mean = next(m for m in data["repeated"] if m["controller"] == "holonomic-nmpc")
    assert (mean["runs"], mean["finished"], mean["duration"]) == (SEEDS, SEEDS, 20.0)
    assert mean["me"]["mean"] == pytest.approx(errors["holonomic-nmpc"].mean())
    assert mean["me"]["low"] < mean["me"]["mean"] < mean["me"]["high"]
    assert len(data["paired"]) == 3 * 4
    pair = next(
        p for p in data["paired"]
        if (p["first"], p["second"], p["measure"]) == ("holonomic-nmpc", "fuzzy_t1", "me")
    )  # fmt: skip
    assert pair["mean"] == pytest.approx((errors["holonomic-nmpc"] - errors["fuzzy_t1"]).mean())
    assert (pair["low"], pair["high"]) == (None, None)  # three differences have no interval
    assert (pair["seeds"], pair["unit"]) == (SEEDS, "m")
    assert pair["verdict"] in {"better", "worse", "no difference shown"}
    assert 0.0 <= pair["p"] <= 1.0


def test_evidence_of_the_stored_runs_is_that_of_the_comparison(folder):
    """Every repeat is an observation: as if the study had so many repetitions."""
    study = read_study(folder)
    assert (study.evidence.runs.repetitions, study.evidence.runs.repeats) == (1, SEEDS)
    compared = {
        (each["measure"], each["first"], each["second"]): each
        for each in json.loads((folder / "results.json").read_text())["paired"]
    }
    found = 0
    for name in ("me", "mae"):
        (noise,) = study.evidence.of(name)
        assert {each.mean.sample_size for each in noise.summaries} == {SEEDS}
        for pair in noise.pairs:
            other = compared[name, pair.first, pair.second]
            assert pair.difference.sample_size == other["seeds"]
            assert pair.difference.mean == pytest.approx(other["mean"], rel=1e-9)
            assert pair.p == pytest.approx(other["p"], rel=1e-9)
            found += 1
    assert found == 2 * 3


def test_study_without_repeats_has_no_paired_differences():
    study = run_study(small_scenario(controllers=("holonomic-nmpc",)))
    assert study.logs.repeats == study.evidence.runs.repeats == 1
    assert not [t for t in study.tables if "Paired" in t.title]


def test_retime_keeps_the_repeats_and_one_task_has_one():
    scenario = noise_scenario(7)
    assert retime(scenario, duration=25.0).tasks.noise.repeats == 7
    assert one_task(scenario.tasks, "noise").noise.repeats == 1
