"""Table of the recoveries from faults."""

from dataclasses import replace
from math import nan

import pytest

from omnidrive.control.supervision import Event
from omnidrive.evaluation.study_logs import RecordedRun
from omnidrive.simulation import Outcome
from omnidrive.simulation.disturbances import parse_fault
from tests.evaluation.recorded import ended, record, reported
from tests.evaluation.truncation import truncated


@pytest.fixture
def faulted(part):
    """The study with one fault-free run and one run that the watchdog stops."""
    log = part.runs[0].log
    free = record("faults", "unicycle-nmpc", {"me": 0.01}, variant="00-none")
    fault = parse_fault("encoder-dead:wheel=1,at=4")
    events = (Event(4.0, "encoder-dead begins"), Event(4.5, "the watchdog stops the robot"))
    cut = truncated(log, 60, outcome=Outcome.STOPPED, events=events)
    values = {"me": 0.2, "recovered": 0.0, "worst_error": 0.3, "time_to_recover": nan}
    stopped = record("faults", "unicycle-nmpc", values, variant="01-encoder-dead")
    runs = (RecordedRun(free, log), ended(RecordedRun(stopped, log), cut))
    return replace(part, runs=runs, faults={"01-encoder-dead": fault})


def fault_table_of(logs):
    return next(t for t in reported(logs).tables if "faults" in t.title)


def test_first_detection_is_shown_as_wrapped_text(faulted):
    table = fault_table_of(faulted)
    cells = dict(zip(table.columns, table.rows[0], strict=True))
    assert cells["fault"] == "1 encoder-dead at 4 s, wheel 1"
    assert cells["recovered"] == "stopped at 5.9 s"
    assert cells["first detection"] == "4.50 s: the watchdog stops the robot"
    assert table.prose


def test_table_without_detections_has_no_text_column(faulted):
    undisturbed, stopped = faulted.runs
    quiet = stopped._replace(log=replace(stopped.log, events=()))
    table = fault_table_of(replace(faulted, runs=(undisturbed, quiet)))
    assert "first detection" not in table.columns
    assert not table.prose
