"""Table of the identified drive."""

from dataclasses import replace

import numpy as np

from omnidrive.estimation.drive_estimate import DRIVE_UNITS, logged_drive
from tests.evaluation.recorded import reported

FOUND = (0.95, 1.0, 0.9, 0.08, 0.05, 0.07, 0.01, 0.07, 0.02, 0.002, 0.014, 0.004, 0.005)
"""Estimates and standard errors; the motion did not suffice for the gain in y."""


def with_drive(result):
    """The result of a controller that identified the drive; its last row has no details."""
    rows = np.ones((len(result.log.t), len(FOUND)))
    rows[-2], rows[-1] = FOUND, np.nan
    columns = dict(zip(DRIVE_UNITS, rows.T, strict=True))
    return result._replace(log=replace(result.log, details=columns, detail_units=dict(DRIVE_UNITS)))


def test_the_last_estimates_of_a_run_are_shown_with_their_intervals(part):
    result = with_drive(part.runs[0])
    tables = reported(replace(part, runs=(result, part.runs[1]))).tables
    (table,) = [each for each in tables if each.title == "Identified drive"]
    assert [row[0] for row in table.rows] == [result.name]
    cells = dict(zip(table.columns, table.rows[0], strict=True))
    assert cells["gain x"] == "0.9500 ± 0.020"
    assert "gain y" not in cells
    assert cells["lag, ms"] == "80.00 ± 3.9"
    assert cells["lag yaw, ms"] == "70.00 ± 7.8"
    assert cells["delay, ms"] == "50.00 ± 27"


def test_runs_without_identification_have_no_table(part):
    titles = [table.title for table in reported(part).tables]
    assert "Identified drive" not in titles


def test_estimates_are_read_from_the_log(part):
    run = with_drive(part.runs[0]).log
    found = logged_drive(run.details)
    assert found.gains == FOUND[:3]
    assert (found.lag, found.delay, found.yaw_lag, found.sum_error) == (0.08, 0.05, 0.07, 0.005)
    assert logged_drive({}) is None
    nothing = {name: np.full(3, np.nan) for name in DRIVE_UNITS}
    assert logged_drive(nothing) is None
