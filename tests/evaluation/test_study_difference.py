"""Two studies, compared run by run."""

import json

import pyarrow as pa
import pytest

from omnidrive.evaluation.statistics.study_difference import (
    difference_record,
    difference_table,
    study_difference,
)
from tests.evaluation.synthetic_runs import synthetic_table

TWO = {"a": 0.05, "b": 0.06}
AXES = {"mass": [1.0, 2.0]}


def table(effects=None, **options):
    return synthetic_table(effects or TWO, axes=AXES, repetitions=15, **options)


def with_keys(runs, prefix):
    keys = [f"{prefix}{key[1:]}" for key in runs["key"].to_pylist()]
    return runs.set_column(1, "key", pa.array(keys))


def test_equal_studies():
    found = study_difference(table(), table())
    assert (found.matched, found.same_key, found.only_first, found.only_second) == (60, 60, 0, 0)
    assert found.not_reproduced == ()
    assert found.summary == "60 runs in common, 60 with the same key. All values are equal."
    assert difference_table(found).rows == ()


def test_order_and_pairing_of_the_rows_do_not_matter():
    shuffled = table().take(pa.array(list(reversed(range(60)))))
    assert study_difference(table(), shuffled).changes == study_difference(table(), table()).changes


def test_changed_controller():
    found = study_difference(table(), with_keys(table({"a": 0.05, "b": 0.055}), "f"))
    assert found.same_key == 0
    by_name = {each.controller: each for each in found.changes}
    assert by_name["a"].verdict == "equal"
    assert by_name["b"].verdict == "better"
    assert by_name["b"].change.mean == pytest.approx(-0.005)
    rows = difference_table(found).rows
    assert [row[-1] for row in rows] == ["equal", "better"]
    assert json.loads(json.dumps(difference_record(found)))["changes"][1]["verdict"] == "better"


def test_note_names_the_repetitions_that_a_change_needs():
    few, enough = (
        difference_table(study_difference(
            synthetic_table(TWO, repetitions=count), synthetic_table(TWO, repetitions=count, seed=2)
        )).note
        for count in (3, 15)
    )  # fmt: skip
    assert "With 3 repetitions no change of runs that vary can be shown at 5 %" in few
    assert "need at least" not in enough


def test_runs_with_one_key_and_different_results_are_named():
    other = table()
    values = other["me"].to_pylist()
    values[7] += 1e-12
    other = other.set_column(other.column_names.index("me"), "me", pa.array(values))
    found = study_difference(table(), other)
    assert found.not_reproduced == (7,)
    assert "1 runs with the same key have different results (numbers 7)" in found.summary
    changed = next(each for each in found.changes if each.equal < each.runs)
    assert (changed.largest, changed.verdict) == (7, "no difference shown")


def test_runs_of_one_study_only():
    found = study_difference(table(), table().slice(0, 40))
    assert (found.matched, found.only_first, found.only_second) == (40, 20, 0)
    other = synthetic_table(TWO, axes={"lag": [1.0]}, repetitions=2)
    assert study_difference(table(), other).summary == "The studies have no run in common."


def test_runs_that_end_early_in_one_study():
    found = study_difference(table(), table(failures={("a", 3)}))
    assert found.outcomes == 2
    assert len(found.not_reproduced) == 2
    assert found.summary.endswith("2 runs are finished in one study only.")
