"""Table of the drive that controllers identified during their runs."""

from __future__ import annotations

from omnidrive.estimation.drive_estimate import DriveEstimate, logged_drive
from omnidrive.evaluation.study_logs import StudyLogs
from omnidrive.evaluation.tables.table import NO_VALUE, Table, number_text

_NORMAL_95 = 1.96
"""Half of the 95 % interval of a normal distribution, in standard deviations."""


_DASH = " A dash: the motion did not suffice to estimate it."
_GAIN = "Gain: executed over commanded twist."
_LAG = "Lag: time constant of the motors in addition to that of the model."
_DEFINITIONS = (
    ("gain x", _GAIN),
    ("gain y", _GAIN),
    ("gain yaw", _GAIN),
    ("lag, ms", _LAG),
    ("lag yaw, ms", _LAG),
    ("delay, ms", "Delay: of the commands."),
)


def drive_table(logs: StudyLogs) -> Table:
    """Return a table of gains, lags and delay at the end of every run that logs them."""
    rows = []
    for result in logs.runs:
        found = logged_drive(result.log.details)
        if found is not None:
            rows.append((result.name, *_cells(found)))
    return Table(
        "Identified drive",
        ("run", "gain x", "gain y", "gain yaw", "lag, ms", "lag yaw, ms", "delay, ms"),
        tuple(rows),
        "Estimates at the end of a run, ± half of their 95 % intervals."
        + (_DASH if any(NO_VALUE in row for row in rows) else ""),
        definitions=_DEFINITIONS,
        is_detail=True,
    ).without_empty_columns()


def _cells(found: DriveEstimate) -> tuple[str, ...]:
    """Return the cells of gains, lags and delay."""
    *moving, answering = found.excited
    gains = zip(found.gains, found.gain_errors, moving, strict=True)
    times = (
        (found.lag, found.lag_error),
        (found.yaw_lag, found.yaw_lag_error),
        (found.delay, found.delay_error),
    )
    return (
        *(_text(value, error) if excited else NO_VALUE for value, error, excited in gains),
        *(_text(1e3 * value, 1e3 * error) if answering else NO_VALUE for value, error in times),
    )


def _text(value: float, error: float) -> str:
    """Return a value and half of its 95 % interval, the latter with two digits."""
    return f"{number_text(value, 4)} ± {number_text(_NORMAL_95 * error, 2)}"
