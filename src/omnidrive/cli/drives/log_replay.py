"""Verbs `omnidrive log replay` and `omnidrive log compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omnidrive import scenario as scenarios
from omnidrive import study
from omnidrive.cli.completion import component
from omnidrive.cli.components import with_controllers
from omnidrive.cli.options import JsonOption, flag, option
from omnidrive.cli.terminal import conclude, print_json, warn
from omnidrive.errors import one_line

if TYPE_CHECKING:
    from omnidrive.deploy.log import LoggedDrive
    from omnidrive.deploy.log_replay import LogReplay

_LogArgument = Annotated[
    Path, typer.Argument(metavar="FILE", help="Log of a drive (.mcap), or its run folder.")
]
_OtherArgument = Annotated[
    Path, typer.Argument(metavar="OTHER", help="Another log (.mcap), or its run folder.")
]


def replay(
    file: _LogArgument,
    controller: Annotated[
        str | None,
        option(
            "[LABEL=]NAME[,KEY=VALUE...]",
            "Another controller, as of `omnidrive run` [default: that of the log].",
            None,
            complete=component("controllers"),
        ),
    ] = None,
    png: Annotated[
        Path | None, option("FILE.png", "Draw the commands; .svg is supported too.")
    ] = None,
    allow_code: Annotated[
        bool,
        flag(
            "Import code that the log names, such as mine.py:MyController; only for logs that you "
            "trust.",
            None,
            "--allow-code",
        ),
    ] = False,
    json: JsonOption = False,
) -> None:
    """Compute what a controller would have commanded, from the readings of a log.

    Estimator and supervisor are those of the log. With the same controller and the same version of
    omnidrive, the commands are those of the log bit for bit; for logs of `omnidrive ros2 drive`,
    which hold the reference as a table, up to its interpolation.

    For example:

    * `omnidrive log replay runs/monday`
    * `omnidrive log replay drive.mcap --controller pid --png commands.png`
    """
    from omnidrive.compiled import announce_compiling
    from omnidrive.deploy.log import read_log
    from omnidrive.deploy.log_comparison import replay_table
    from omnidrive.evaluation.figures import save as save_figure
    from omnidrive.evaluation.figures.command_difference import command_difference

    if png is not None:
        study.check_figure(png)
    logged = read_log(file)
    with announce_compiling():
        found = _replay(logged, controller, allow_code=allow_code)
    if logged.dropped:
        warn(f"{logged.dropped} samples are not in the log, so the commands may differ")
    if json:
        print_json(_record(found))
    else:
        from omnidrive.cli.tables import print_tables

        print_tables([replay_table(found, one_line(file.name))])
    if png is not None:
        save_figure(command_difference(found.t, found.axes, found.logged, found.replayed), png)
        conclude(f"figure written to {png}", beside_json=json)


def _replay(logged: LoggedDrive, controller: str | None, *, allow_code: bool) -> LogReplay:
    """Return the replay of a log with the scenario, or the parameters, that it holds."""
    from omnidrive.deploy.log_replay import replay_log
    from omnidrive.deploy.ros2.drive_files import drive_of_log
    from omnidrive.deploy.scenario_files import scenario_of_log
    from omnidrive.deploy.scenario_robot import scenario_pipeline

    found = drive_of_log(logged.files, logged.robot, controller=controller, allow_code=allow_code)
    if found is not None:
        return replay_log(logged, *found)
    with scenario_of_log(logged.files, allow_code=allow_code) as scenario:
        chosen = scenario
        if controller:
            chosen = with_controllers(scenario, [controller], allow_code=allow_code)
        planned = scenarios.plan_and_check(chosen)
        label, *_ = planned.scenario.controllers
        reference = planned.reference(study.planned_duration(planned))
        return replay_log(logged, scenario_pipeline(planned, label), reference)


def _record(found: LogReplay) -> dict[str, Any]:
    """Return a replay as JSON data."""
    return {
        "samples": len(found.equal),
        "equal": int(found.equal.sum()),
        "ending": found.ending,
        "t": found.t.tolist(),
        "axes": [{"name": name, "unit": unit} for name, unit in found.axes],
        "logged": found.logged.tolist(),
        "replayed": found.replayed.tolist(),
    }


def compare(file: _LogArgument, other: _OtherArgument, json: JsonOption = False) -> None:
    """Compare two logs: errors, effort, punctuality, states and commands.

    Errors are relative to the estimated pose. Commands are compared at equal times since the
    controllers began to drive.

    For example:

    * `omnidrive log compare runs/monday runs/tuesday`
    """
    from omnidrive.cli.tables import print_tables
    from omnidrive.deploy.log import read_log
    from omnidrive.deploy.log_comparison import comparison_tables

    names = [one_line(each.name) for each in (file, other)]
    if names[0] == names[1]:
        names = [one_line(str(each)) for each in (file, other)]
    tables = comparison_tables([read_log(file), read_log(other)], names)
    if json:
        print_json(
            {
                table.stem: [dict(zip(table.columns, r, strict=True)) for r in table.rows]
                for table in tables
            }
        )
    else:
        print_tables([table for table in tables if table.rows])
