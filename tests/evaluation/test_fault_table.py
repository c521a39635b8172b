"""Table of the recoveries from faults."""

from dataclasses import replace

import pytest

from omnidrive.control.supervision import Event
from omnidrive.evaluation import FaultResult, study_tables
from omnidrive.simulation import Outcome
from omnidrive.simulation.disturbances import parse_fault
from tests.evaluation.truncation import truncated


@pytest.fixture
def faulted(part):
    """The study with one fault-free run and one run that the watchdog stops."""
    result = part.tracks[0]
    undisturbed = FaultResult("unicycle-nmpc", 0, None, 20.0, result.run, result.metrics)
    fault = parse_fault("encoder-dead:wheel=1,at=4")
    events = (Event(4.0, "encoder-dead begins"), Event(4.5, "the watchdog stops the robot"))
    run = truncated(result.run, 60, outcome=Outcome.STOPPED, events=events)
    stopped = FaultResult("unicycle-nmpc", 1, fault, 20.0, run, result.metrics)
    return replace(part, tracks=(), faults=(undisturbed, stopped))


def fault_table_of(results):
    return next(t for t in study_tables(results, published=False) if "faults" in t.title)


def test_first_detection_is_shown_as_wrapped_text(faulted):
    table = fault_table_of(faulted)
    cells = dict(zip(table.columns, table.rows[0], strict=True))
    assert cells["fault"] == "1 encoder-dead at 4 s, wheel 1"
    assert cells["recovered"] == "stopped at 5.9 s"
    assert cells["first detection"] == "4.50 s: the watchdog stops the robot"
    assert table.prose


def test_table_without_detections_has_no_text_column(faulted):
    undisturbed, stopped = faulted.faults
    quiet = replace(stopped, run=replace(stopped.run, events=()))
    table = fault_table_of(replace(faulted, faults=(undisturbed, quiet)))
    assert "first detection" not in table.columns
    assert not table.prose
