"""Columns of a table of runs."""

import numpy as np
import pyarrow as pa
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.evaluation.measures.quantities import parse_value, quantity
from omnidrive.evaluation.statistics.evidence import axis_evidence, task_evidence
from omnidrive.evaluation.statistics.run_table import RunTable, Task
from tests.evaluation.synthetic_runs import synthetic_table, with_repeats

AXES = {"plant_robot.mass": [50.0, 75.0], "plant": ["planar", "kinematic"]}


def test_axes_and_random_factors_are_told_apart():
    table = synthetic_table(
        {"pid": 1.0, "fuzzy_t1": 2.0}, repetitions=4, axes=AXES,
        random={"sample_time": [0.1, 0.05, 0.1, 0.02]},
    )  # fmt: skip
    runs = RunTable(table)
    assert runs.controllers == ("pid", "fuzzy_t1")
    assert runs.axes == ("plant_robot.mass", "plant")
    assert runs.random_factors == ("sample_time",)
    assert runs.levels("plant_robot.mass")[0] == [50.0, 75.0]
    assert runs.levels("plant")[0] == ["planar", "kinematic"]
    assert runs.tasks == (Task("noise", 30.0),)
    assert runs.metrics == ("me",)
    one = RunTable(table.filter(pa.array(runs.repetition == 0)))
    assert one.random_factors == ()


def test_value_of_unfinished_run_is_not_valid():
    runs = RunTable(synthetic_table({"pid": 1.0}, repetitions=3, failures={("pid", 1)}))
    assert np.isfinite(runs.values("me")).tolist() == [True, False, True]


def test_computing_times_are_joined_by_number():
    table = synthetic_table({"pid": 1.0}, repetitions=4)
    timing = pa.table({"number": [2, 0, 9], "step_time_median": [20.0, 5.0, 90.0]})
    runs = RunTable(table, timing)
    assert runs.values("step_time_median") == pytest.approx(
        [5.0, np.nan, 20.0, np.nan], nan_ok=True
    )
    assert runs.metrics == ("me", "step_time_median")


def test_unknown_names_have_the_nearest_one():
    runs = RunTable(synthetic_table({"pid": 1.0}, axes=AXES))
    with pytest.raises(InvalidInput, match="no metric 'mee'; did you mean 'me'"):
        runs.values("mee")
    with pytest.raises(InvalidInput, match=r"did you mean 'plant_robot\.mass'"):
        runs.levels("plant_robot.mas")
    with pytest.raises(InvalidInput, match="no column key"):
        RunTable(runs.table.drop_columns(["key"]))


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [("0.1mm", "me", 1e-4), ("0.1", "me", 0.1), ("2 mrad", "mae", 2e-3), ("1e-3m", "me", 1e-3),
     ("5ms", "settling_time_x", 5e-3), ("3us", "step_time_median", 3.0), ("1", "collisions", 1.0)],
)  # fmt: skip
def test_values_with_units(text, name, value):
    assert parse_value(text, quantity(name)) == pytest.approx(value)


@pytest.mark.parametrize("text", ["mm", "", "0.1 kg", "nan", "1_0mm", "0.1 mrad"])
def test_values_of_the_wrong_unit_are_refused(text):
    with pytest.raises(InvalidInput, match=r"not a value of me|not a unit of me"):
        parse_value(text, quantity("me"))


def test_faults_and_horizons_are_axes():
    tasks = [("track", 20.0, ""), ("faults", 20.0, "00-none"), ("faults", 20.0, "01-push"),
             ("horizon", 20.0, "N = 5"), ("horizon", 20.0, "N = 10")]  # fmt: skip
    runs = RunTable(synthetic_table({"pid": 1.0, "b": 2.0}, repetitions=2, tasks=tasks))
    assert [task.label for task in runs.tasks] == ["track 20 s", "faults 20 s", "horizon 20 s"]
    assert runs.axes == ("fault", "horizon")
    assert runs.levels("horizon")[0] == ["", "N = 5", "N = 10"]
    (levels,) = axis_evidence(runs, "me", "fault").values()
    assert [each.level for each in levels] == ["00-none", "01-push"]


def test_settling_time_is_that_of_the_slowest_axis_with_a_step():
    table = synthetic_table({"pid": 1.0}, repetitions=3, tasks=(("step", 10.0, ""),))
    rows = {"x": [1.0, 1.0, 2.0], "y": [3.0, None, 1.0], "heading": [2.0, 2.0, None]}
    for axis, times in rows.items():
        table = table.append_column(f"settling_time_{axis}", pa.array(times))
        steps = [5.0, 5.0, None if axis == "heading" else 5.0]
        table = table.append_column(f"overshoot_{axis}", pa.array(steps))
    found = RunTable(table)
    assert found.values("settling_time") == pytest.approx([3.0, np.nan, 2.0], nan_ok=True)
    assert found.metrics[-1] == "settling_time"


def test_axes_with_many_values_are_not_shown_value_by_value():
    axes = {"few": [1.0, 2.0], "many": [float(k) for k in range(51)]}
    runs = RunTable(synthetic_table({"pid": 1.0}, repetitions=1, axes=axes))
    assert runs.axes == ("few", "many")
    assert runs.shown_axes == ("few",)


def test_repeats_are_observations_without_random_factors():
    table = synthetic_table({"a": 1e-3, "b": 2e-3}, repetitions=12)
    runs = RunTable(with_repeats(table, 4))
    assert (runs.repetitions, runs.repeats) == (3, 4)
    np.testing.assert_array_equal(runs.unit, np.asarray(table["repetition"]))
    assert repr(task_evidence(runs, "me")) == repr(task_evidence(RunTable(table), "me"))


def test_repeats_share_the_sample_of_random_factors():
    friction = [float(r // 4) for r in range(12)]
    table = synthetic_table({"a": 1e-3}, repetitions=12, random={"plant_robot.friction": friction})
    runs = RunTable(with_repeats(table, 4))
    assert runs.random_factors == ("plant_robot.friction",)
    np.testing.assert_array_equal(runs.unit, runs.repetition * runs.repeats)
