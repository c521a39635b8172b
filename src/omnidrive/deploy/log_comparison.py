"""Two logs of drives side by side, as tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Status
from omnidrive.deploy.log.logged_drive import LoggedDrive
from omnidrive.deploy.log_replay import LogReplay, command_rows
from omnidrive.errors import InvalidLog
from omnidrive.evaluation import Table
from omnidrive.evaluation.measures.metrics import measure
from omnidrive.evaluation.tables.table import NO_VALUE, number_text


def comparison_tables(logs: Sequence[LoggedDrive], names: Sequence[str]) -> list[Table]:
    """Return tables of the errors, the punctuality, the states and the commands of two drives.

    Errors are relative to the estimated pose, which is the only one in a log.

    Args:
        logs: The logs.
        names: Name of each log.

    Raises:
        InvalidLog: The controller did not drive the robot, or a file is damaged.
        InvalidInput: The commands cannot be compared.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # commands that are not finite are logged
        return [
            _tracking(logs, names),
            _punctuality(logs, names),
            _states(logs, names),
            _commands(logs, names),
        ]


def replay_table(replay: LogReplay, name: str) -> Table:
    """Return the difference of the commands of a replay from those of its log, per axis."""
    number, equal = len(replay.equal), int(replay.equal.sum())
    both = (replay.logged_status, replay.replayed_status)
    fallbacks = [int((status != Status.OK).sum()) for status in both]
    lead = (
        f"All {number} commands are equal, bit for bit."
        if equal == number
        else f"{number - equal} of {number} commands differ; the first at "
        f"{replay.t[int(np.argmin(replay.equal))]:.3f} s."
    )
    return _difference_table(
        f"Replay of {name}",
        replay,
        "The robot followed the logged commands: after the first difference, the replay shows what "
        "the controller would have commanded in the states that the logged commands led to. Steps "
        f"without a converged solution: log {fallbacks[0]}, replay {fallbacks[1]}."
        + (f" The replay ends early: {replay.ending}." if replay.ending else ""),
        lead,
        "the log",
    )


def _difference_table(title: str, replay: LogReplay, note: str, lead: str, first: str) -> Table:
    """Return a table with one row per axis; ``first`` names what the replay is compared with."""
    difference = replay.replayed - replay.logged
    rows = []
    for i, (name, unit) in enumerate(replay.axes):
        k = int(np.argmax(np.abs(difference[:, i])))
        rows.append(
            (
                f"{name}, {unit}",
                number_text(abs(difference[k, i])),
                f"{replay.t[k]:.3f}" if difference[k, i] else NO_VALUE,
                number_text(_rms(difference[:, i])),
                number_text(_rms(replay.logged[:, i])),
            )
        )
    columns = ("axis", "largest difference", "at, s", "RMS difference", f"RMS of {first}")
    return Table(title, columns, tuple(rows), note, lead=lead)


def _rms(values: Float[Array, " rows"]) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _tracking(logs: Sequence[LoggedDrive], names: Sequence[str]) -> Table:
    rows = []
    for log, name in zip(logs, names, strict=True):
        run = log.run()
        m = measure(run, log.robot.chassis)
        rows.append(
            (
                name, log.metadata.get("controller", ""), f"{run.t[-1]:g}",
                number_text(1e3 * m.me), number_text(1e3 * m.mae), number_text(1e3 * m.max_error),
                number_text(m.wheel_acceleration), number_text(m.step_time_median),
                str(m.fallbacks),
            )
        )  # fmt: skip
    return Table(
        "Tracking error",
        ("log", "controller", "driven, s", "ME, mm", "MAE, mrad", "max. error, mm",
         "effort, rad/s²", "step time, µs", "without solution"),
        tuple(rows),
        "ME: mean distance of the estimated pose to the reference. MAE: mean absolute heading "
        "error, wrapped. Effort: mean rate of change of the commanded wheel speeds.",
    ).mark_best(("ME, mm", "MAE, mrad", "max. error, mm", "effort, rad/s²"))  # fmt: skip


def _punctuality(logs: Sequence[LoggedDrive], names: Sequence[str]) -> Table:
    rows = []
    for log, name in zip(logs, names, strict=True):
        timing = log.timing().summary()
        rows.append(
            (
                name, f"{1.0 / log.dt:g}", str(timing.samples), str(timing.misses),
                number_text(1e6 * timing.jitter_median), number_text(1e6 * timing.jitter_p99),
                number_text(1e3 * timing.busy_median), number_text(1e3 * timing.busy_p99),
                str(log.dropped), "yes" if log.complete else "no",
            )
        )  # fmt: skip
    return Table(
        "Punctuality",
        ("log", "rate, Hz", "samples", "missed", "jitter, µs", "jitter p99, µs", "busy, ms",
         "busy p99, ms", "not logged", "complete"),
        tuple(rows),
        "Jitter: from the deadline of a sample to its begin. Busy: from there until the command is "
        "sent. Medians, unless p99 is named.",
    )  # fmt: skip


def _states(logs: Sequence[LoggedDrive], names: Sequence[str]) -> Table:
    rows = [
        (name, f"{change.t:.3f}", change.state.value, change.reason)
        for log, name in zip(logs, names, strict=True)
        for change in log.changes
    ]
    return Table("States", ("log", "at, s", "state", "reason"), tuple(rows), keys=2, prose=True)


def _commands(logs: Sequence[LoggedDrive], names: Sequence[str]) -> Table:
    """Return the difference of the commands at equal times since the controllers began."""
    first, second = logs
    if abs(first.dt - second.dt) > 1e-9:
        return Table("Commands", ("axis",), (), "")
    commands = [[s.step.command for s in log.samples() if s.step is not None] for log in logs]
    rows = min(map(len, commands))
    if rows == 0:
        raise InvalidLog("the controller did not drive the robot: there is no command")
    values = [command.value for each in commands for command in each[:rows]]
    axes, numbers = command_rows(values, first.robot)
    status = [np.array([int(command.status) for command in each[:rows]]) for each in commands]
    difference = LogReplay(
        first.dt * np.arange(rows), axes, numbers[:rows], numbers[rows:],
        (numbers[:rows] == numbers[rows:]).all(axis=1), status[0], status[1],
    )  # fmt: skip
    return _difference_table(
        "Commands",
        difference,
        f"{names[1]} against {names[0]}, sample by sample of the time in which the controllers "
        f"drove, {(rows - 1) * first.dt:g} s of both.",
        "",
        names[0],
    )
