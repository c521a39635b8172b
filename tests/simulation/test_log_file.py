"""Logs of runs as files."""

import json
from dataclasses import fields, replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import omnidrive as od
from omnidrive.control.supervision import Event
from omnidrive.errors import InvalidLog
from omnidrive.scenario import SensorsSection, plan_and_check, settings_of_runs, simulate_run
from omnidrive.scenario.tasks import FaultsTask, Tasks
from omnidrive.simulation import Outcome, load_run
from omnidrive.simulation.log_file import ENDING
from tests.simulation.recorded_run import recorded_run
from tests.study.small import small_scenario


def assert_equal(before, after):
    """Check that two runs are equal, bit for bit."""
    for field in fields(before):
        one, two = getattr(before, field.name), getattr(after, field.name)
        if isinstance(one, np.ndarray):
            assert (one.dtype, one.shape) == (two.dtype, two.shape), field.name
            assert one.tobytes() == two.tobytes(), field.name
        elif field.name == "details":
            assert {k: v.tobytes() for k, v in one.items()} == {
                k: v.tobytes() for k, v in two.items()
            }
        else:
            assert one == two, field.name


@pytest.mark.parametrize(
    "run",
    [recorded_run(), recorded_run(sigma=False), recorded_run(wheels=0, details=0),
     recorded_run(wheels=12, details=0),
     replace(recorded_run(Outcome.PLANT_LOST), traceback="Traceback\n  x", events=())],
)  # fmt: skip
def test_run_is_the_one_that_was_saved(tmp_path, run):
    run.save(tmp_path / "a.parquet")
    assert_equal(run, od.load_run(tmp_path / "a.parquet"))


def test_simulated_run_with_an_estimator_and_a_fault_is_the_one_that_was_saved(tmp_path):
    scenario = small_scenario(
        controllers=("feedforward",), plant="planar", tasks=Tasks(faults=FaultsTask(duration=20.0)),
        sensors=SensorsSection(estimator="kalman"),
    )  # fmt: skip
    (run,) = settings_of_runs(scenario)[-1:]
    log = simulate_run(plan_and_check(scenario), run)
    assert log.events
    assert np.isfinite(log.yaw_sigma).any()
    log.save(tmp_path / "a.parquet")
    assert_equal(log, load_run(tmp_path / "a.parquet"))


def test_standard_deviations_are_columns_only_where_they_are_known(tmp_path):
    names = [each.name for each in recorded_run().columns]
    assert {"position_sigma", "yaw_sigma"} <= set(names)
    assert "yaw_sigma" not in [each.name for each in recorded_run(sigma=False).columns]


def saved(path):
    recorded_run().save(path)
    return pq.read_table(path)


def changed_ending(table, **changes):
    ending = json.loads(table.schema.metadata[ENDING]) | changes
    return table.replace_schema_metadata({ENDING: json.dumps(ending)})


BAD = {
    "has other columns": (lambda table: table.drop_columns(["status"]), "there is no 'status'"),
    "no ending": (lambda table: table.replace_schema_metadata({}), "its outcome and its events"),
    "bad JSON": (lambda table: table.replace_schema_metadata({ENDING: "{"}), "Expecting"),
    "outcome": (lambda table: changed_ending(table, outcome="WON"), "there is no 'WON'"),
    "events": (lambda table: changed_ending(table, events=[[1.0]]), "not enough values"),
    "time of an event": (lambda table: changed_ending(table, events=[["nan", "a"]]), "not finite"),
    "reason": (lambda table: changed_ending(table, reason=3), "is none"),
    "ending of another type": (
        lambda table: table.replace_schema_metadata({ENDING: "[1]"}), "list indices",
    ),
    "texts": (lambda table: with_column(table, "x", ["a"] * len(table)), "parse"),
    "no whole numbers": (lambda table: with_column(table, "status", [None] * len(table)), "lacks"),
    "times": (lambda table: table.take([2, 1, 0]), "not finite and increasing"),
    "no samples": (lambda table: table.slice(0, 0), "not finite and increasing"),
}  # fmt: skip


def with_column(table, name, values):
    return table.set_column(table.column_names.index(name), name, pa.array(values))


@pytest.mark.parametrize("kind", BAD)
def test_other_tables_are_refused_in_one_line(tmp_path, kind):
    path = tmp_path / "a.parquet"
    change, message = BAD[kind]
    pq.write_table(change(saved(path)), path)
    with pytest.raises(InvalidLog, match=message) as caught:
        load_run(path)
    assert "\n" not in str(caught.value)
    assert "is not the log of a run" in str(caught.value)


def test_damaged_page_is_found(tmp_path):
    path = tmp_path / "a.parquet"
    saved(path)
    content = bytearray(path.read_bytes())
    content[60] ^= 1
    path.write_bytes(content)
    with pytest.raises(InvalidLog, match="is not the log of a run"):
        load_run(path)


def test_missing_file_and_folder(tmp_path):
    for path in (tmp_path / "no.parquet", tmp_path):
        with pytest.raises(InvalidLog, match="cannot read the log"):
            load_run(path)


def test_events_of_mcap_end_with_the_outcome(tmp_path):
    mcap = pytest.importorskip("mcap.reader")
    run = recorded_run(Outcome.STOPPED)
    run.save(tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as file:
        messages = [m.data for _, channel, m in mcap.make_reader(file).iter_messages()
                    if "log" in channel.topic or "event" in channel.topic]  # fmt: skip
    assert any(Event(0.0, run.ending).what.encode() in data for data in messages)
