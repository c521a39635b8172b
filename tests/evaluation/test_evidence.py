"""Evidence: summaries, paired differences, sentences and families."""

from math import isnan

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from omnidrive.evaluation.statistics.evidence import axis_evidence, task_evidence
from omnidrive.evaluation.statistics.mean_test import difference_tests
from omnidrive.evaluation.statistics.run_table import RunTable
from tests.evaluation.synthetic_runs import TASK, synthetic_table

THREE = {"fuzzy_t1": 0.05015, "fuzzy_t2": 0.05, "pid": 0.0501}
MINUS = "\N{MINUS SIGN}"


def evidence(table, metric="me", **options):
    return task_evidence(RunTable(table), metric, **options)[0]


def with_values(rows, *, metric="me", failed=()):
    """Return a table of the given values: one list per controller, one value per repetition."""
    table = synthetic_table(
        dict.fromkeys(rows, 0.0), repetitions=len(next(iter(rows.values()))), metric=metric,
        failures=set(failed),
    )  # fmt: skip
    values = [rows[n][r] for n, r in zip(table["controller"].to_pylist(),
                                         table["repetition"].to_pylist(), strict=True)]  # fmt: skip
    return table.set_column(table.column_names.index(metric), metric, pa.array(values))


def test_summary_of_a_hand_computed_case():
    table = with_values({"pid": [1.0, 2.0, 3.0, 4.0, 10.0]}, failed=[("pid", 4)])
    (summary,) = evidence(table).summaries
    assert (summary.runs, summary.finished, summary.success_rate) == (5, 4, 0.8)
    assert summary.mean.mean == 2.5
    assert (summary.median, summary.worst) == (2.5, 4.0)
    assert summary.p95 == pytest.approx(3.85)
    low, high = stats.t.interval(0.95, 3, 2.5, stats.sem([1.0, 2.0, 3.0, 4.0]))
    assert summary.mean[1:3] == pytest.approx((low, high))


def test_p95_and_worst_of_a_quantity_to_maximise_are_low():
    table = with_values({"pid": [0.0, 1.0, 2.0, 3.0, 4.0]}, metric="min_clearance")
    (summary,) = evidence(table, "min_clearance").summaries
    assert summary.worst == 0.0
    assert summary.p95 == pytest.approx(0.2)


def test_difference_is_that_of_the_pairs():
    table = synthetic_table(THREE, repetitions=40, common=1e-2)
    pair = evidence(table).pair("fuzzy_t2", "fuzzy_t1")
    values = {n: RunTable(table.filter(pa.compute.equal(table["controller"], n))).values("me")
              for n in THREE}  # fmt: skip
    differences = values["fuzzy_t2"] - values["fuzzy_t1"]
    assert pair.difference == pytest.approx(difference_tests(differences[:, None])[0].estimate)
    assert pair.effect == pytest.approx(differences.mean() / differences.std(ddof=1))
    assert pair.share_better == np.mean(differences < 0.0)
    assert pair.relative == pytest.approx(differences.mean() / values["fuzzy_t1"].mean())
    assert pair.verdict == "better"
    assert stats.ttest_ind(values["fuzzy_t2"], values["fuzzy_t1"]).pvalue > 0.5


def test_sentence_names_the_better_one_and_its_advantage():
    rng = np.random.default_rng(7)
    base = rng.normal(0.05, 1e-2, size=40)
    table = with_values({
        "fuzzy_t1": list(base + 0.15e-3 + 0.1e-3 * rng.normal(size=40)), "fuzzy_t2": list(base),
    })  # fmt: skip
    found = evidence(table)
    pair = found.pair("fuzzy_t2", "fuzzy_t1")
    _, _, low, high = pair.reversed.difference.text(1e3)
    text = f"fuzzy_t2 is better than fuzzy_t1 by {pair.reversed.difference.text(1e3)[0][1:]} mm"
    assert pair.sentence == f"{text} [{low[1:]}, {high[1:]}]"
    assert pair.reversed.sentence == pair.sentence
    assert (pair.verdict, pair.reversed.verdict) == ("better", "worse")
    assert low.startswith("+0.1")
    assert found.best == ("fuzzy_t2",)
    assert [s.controller for s in found.ranking] == ["fuzzy_t2", "fuzzy_t1"]
    assert pair.detail.startswith("p < 0.001")


def test_higher_clearance_is_better():
    rng = np.random.default_rng(7)
    table = with_values(
        {"pid": list(rng.normal(0.3, 1e-3, 30)), "fuzzy_t1": list(rng.normal(0.4, 1e-3, 30))},
        metric="min_clearance",
    )
    pair = evidence(table, "min_clearance").pairs[0]
    assert (pair.first, pair.verdict) == ("fuzzy_t1", "better")
    assert pair.sentence.startswith("fuzzy_t1 is better than pid by 100")
    assert pair.share_better == 1.0


def test_equal_controllers_show_no_difference():
    found = evidence(synthetic_table({"a": 0.05, "b": 0.05}, repetitions=30, seed=4))
    (pair,) = found.pairs
    assert pair.verdict == "no difference shown"
    assert pair.sentence.startswith("no difference shown between b and a: ")
    assert found.best == tuple(s.controller for s in found.ranking)
    same = evidence(synthetic_table({"a": 0.05, "b": 0.05}, repetitions=30, own=0.0))
    assert same.pairs[0].sentence == "b and a have equal results"
    assert same.pairs[0].p == 1.0


def test_constant_difference_needs_no_interval():
    found = evidence(synthetic_table({"a": 0.05, "b": 0.04}, repetitions=5, common=0.0, own=0.0))
    assert found.pairs[0].sentence == "b is better than a by 10.0000 mm in every repetition"


def test_rounding_errors_are_no_difference():
    table = synthetic_table({"a": 0.0, "b": 1e-11}, repetitions=30, common=0.0, own=1e-13)
    assert evidence(table).pairs[0].verdict == "no difference shown"


def test_one_repetition_shows_nothing():
    pair = evidence(synthetic_table({"a": 0.05, "b": 0.04}, repetitions=1)).pairs[0]
    assert isnan(pair.p)
    assert pair.verdict == "no difference shown"
    assert pair.sentence.startswith("b has ")
    assert pair.sentence.endswith("mm less than a in one repetition, too few for an interval")


def test_p_values_are_holm_corrected_within_a_task():
    table = synthetic_table(THREE, repetitions=30, own=2e-4, seed=3)
    both = table.filter(pa.compute.is_in(table["controller"], pa.array(["fuzzy_t1", "pid"])))
    (raw,) = evidence(both).pairs
    every = evidence(table).pairs
    p = next(e.p for e in every if {e.first, e.second} == {"pid", "fuzzy_t1"})
    assert p == pytest.approx(min(1.0, raw.p * (3 - sorted(e.p for e in every).index(p))), rel=0.5)
    assert p > raw.p


def test_axis_values_of_one_repetition_are_not_independent():
    """The interval over 5 equal axis values is that over one, not narrower by a factor of 2."""
    table = synthetic_table({"a": 0.0, "b": 0.0}, repetitions=20, common=0.0, own=1e-3)
    copies = [
        table.append_column("factor:mass", pa.array([float(k)] * len(table))).set_column(
            2, "pairing", pa.array([20 * k + p for p in table["pairing"].to_pylist()])
        )
        for k in range(5)
    ]
    one, five = (evidence(t).pairs[0].difference for t in (table, pa.concat_tables(copies)))
    assert five.sample_size == one.sample_size == 20
    assert five.margin == pytest.approx(one.margin)


def test_pairs_with_a_failed_run_are_left_out():
    table = synthetic_table(THREE, repetitions=30, failures={("pid", 3), ("pid", 4)})
    found = evidence(table)
    assert found.pair("pid", "fuzzy_t1").left_out == 2
    assert found.pair("pid", "fuzzy_t1").difference.sample_size == 28
    assert found.pair("fuzzy_t2", "fuzzy_t1").left_out == 0
    success = evidence(table, "finished")
    assert success.pair("pid", "fuzzy_t1").difference.mean == pytest.approx(-2 / 30)
    often = synthetic_table(THREE, repetitions=40, failures={("pid", r) for r in range(15)})
    assert evidence(often, "finished").pair("pid", "fuzzy_t1").verdict == "worse"


def test_controller_that_fails_in_difficult_cases_is_not_the_best():
    """Its mean is the lowest only because it has no errors in the difficult half."""
    difficult = [0.01 * (r % 2) for r in range(30)]
    rows = {"a": [0.051 + d + 1e-5 * r for r, d in enumerate(difficult)],
            "b": [0.050 + d for d in difficult]}  # fmt: skip
    found = evidence(with_values(rows, failed=[("a", r) for r in range(1, 30, 2)]))
    assert [s.controller for s in found.ranking] == ["a", "b"]
    assert found.pair("b", "a").verdict == "better"
    assert found.leader.controller == "b"
    assert found.best == ("b",)


def test_always_valid_intervals_are_wider():
    table = synthetic_table(THREE, repetitions=60)
    fixed, always = evidence(table), evidence(table, always_valid=True)
    for a, b in zip(fixed.pairs, always.pairs, strict=True):
        assert b.difference.margin > 1.4 * a.difference.margin
        assert b.difference.mean == pytest.approx(a.difference.mean)


def test_always_valid_intervals_need_some_repetitions():
    found = evidence(synthetic_table(THREE, repetitions=12), always_valid=True)
    assert all(pair.verdict == "no difference shown" for pair in found.pairs)
    assert found.pairs[0].sentence.endswith("in 12 repetitions, too few for an interval")


def test_axis_evidence_is_adjusted_over_all_values():
    axes = {"mass": [50.0, 75.0, 100.0]}
    table = synthetic_table(THREE, repetitions=20, axes=axes, own=2e-4,
                            value=lambda n, f: 1e-3 * f["mass"] if n == "pid" else 0.0)  # fmt: skip
    runs = RunTable(table)
    (levels,) = axis_evidence(runs, "me", "mass").values()
    assert [each.level for each in levels] == axes["mass"]
    means = [each.evidence.summaries[2].mean.mean for each in levels]
    assert np.diff(means) == pytest.approx(25e-3, rel=0.1)
    alone = task_evidence(runs, "me", rows=runs.values("me") > -1.0)[0]
    assert len(alone.pairs) == 3
    single = task_evidence(runs, "me", rows=runs.levels("mass")[1] == 0)[0]
    for own, family in zip(single.pairs, levels[0].evidence.pairs, strict=True):
        assert family.p >= own.p


def test_tasks_without_the_metric_are_omitted():
    table = synthetic_table(THREE, repetitions=3, tasks=(TASK, ("step", 10.0, "")))
    step = pa.compute.equal(table["task"], "step")
    table = table.set_column(
        table.column_names.index("me"), "me", pa.compute.if_else(step, None, table["me"])
    )
    found = task_evidence(RunTable(table), "me")
    assert [each.task.label for each in found] == ["noise 30 s"]
