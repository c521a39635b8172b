"""Command `omnidrive robot`: show, import and identify robots."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from omnidrive import study
from omnidrive.choices import RobotFormat
from omnidrive.cli.completion import component
from omnidrive.cli.options import ForceOption, JsonOption, choice, option, verb_group
from omnidrive.cli.terminal import conclude, print_json, warn
from omnidrive.cli.terminal import show as print_line
from omnidrive.errors import InvalidInput, one_line

if TYPE_CHECKING:
    from omnidrive.robot.imports import ImportedRobot
    from omnidrive.simulation.identification import Estimate, RobotLog

robot = verb_group("Show, import and identify robots.")

FormatOption = Annotated[
    str | None, choice(get_args(RobotFormat), "Format of FILE [default: by suffix and content].")
]
WheelOption = Annotated[
    list[str] | None,
    option(
        "JOINT",
        "Joint of a wheel in URDF and MJCF, once per wheel [default: found by axis and name].",
    ),
]
OutOption = Annotated[Path | None, option("FILE.yaml", "Robot file to write.")]


@robot.command()
def show(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FILE",
            help="Robot, or a robot file (.yaml).",
            autocompletion=component("robots"),
        ),
    ],
    png: Annotated[
        Path | None,
        option("FILE.png", "Draw the robot; .svg is supported too."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Print a robot's wheels, largest speeds and accelerations, and warnings; optionally draw it.

    For example:

    * `omnidrive robot show mecanum`
    * `omnidrive robot show my_base.yaml --png my_base.png`
    """
    from omnidrive.cli.robots.robot_text import robot_record, robot_tables
    from omnidrive.cli.tables import print_tables
    from omnidrive.evaluation.figures import save as save_figure
    from omnidrive.evaluation.figures.robot_card import robot_card
    from omnidrive.evaluation.tables.robot_summary import RobotSummary
    from omnidrive.robot import named_robot

    if png is not None:
        study.check_figure(png)
    summary = RobotSummary.of(named_robot(name))
    if json:
        print_json(robot_record(summary))
    else:
        print_tables(robot_tables(summary))
    for warning in summary.warnings:
        warn(warning)
    if png is not None:
        save_figure(robot_card(summary), png)
        conclude(f"figure written to {png}", beside_json=json)


@robot.command(name="import")
def import_(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="URDF, MJCF, or the parameters of a mecanum_drive_controller or an "
            "omni_wheel_drive_controller of ros2_control (.yaml).",
        ),
    ],
    out: OutOption = None,
    format: FormatOption = None,
    wheel: WheelOption = None,
    wheel_radius: Annotated[
        float | None,
        option("M", "Radius of the wheels, m [default: that in FILE]."),
    ] = None,
    mecanum: Annotated[
        bool,
        typer.Option(
            "--mecanum",
            help="The wheels in URDF and MJCF are mecanum wheels with rollers at 45 degrees "
            "[default: by rollers, axles and names].",
        ),
    ] = False,
    force: ForceOption = False,
    json: JsonOption = False,
) -> None:
    """Make a robot file from a description in another format.

    It prints what the description states, what is guessed, and what is missing: there, typical
    values are used, which you should check. Meshes and macros are not read.

    For example:

    * `omnidrive robot import base.urdf --out my_base.yaml`
    * `omnidrive robot import controllers.yaml --out my_base.yaml`
    * `omnidrive robot import base.urdf --wheel fl --wheel fr --wheel rl --wheel rr
      --wheel-radius 0.08`
    """
    from omnidrive.evaluation.tables.robot_summary import RobotSummary
    from omnidrive.robot import save_robot
    from omnidrive.robot.imports import import_robot

    if out is not None:
        check_robot_file(out, force=force)
    found = import_robot(
        file, format=format, wheels=wheel or (), wheel_radius=wheel_radius, mecanum=mecanum
    )
    _print_facts(found, json=json)
    for warning in (*found.warnings, *RobotSummary.of(found.robot).warnings):
        warn(warning)
    if out is not None:
        save_robot(found.robot, out, notes=[f"Imported from {file.name}.", *found.notes])
        text = f"written to {out}; check it by: omnidrive robot show {quote(str(out))}"
        conclude(text, beside_json=json)
    else:
        conclude("not written; use --out FILE.yaml", beside_json=json)


def _print_facts(found: ImportedRobot, *, json: bool) -> None:
    """Print what is read, guessed and missing."""
    parts = {"read": found.read, "guessed": found.guessed, "missing": found.missing}
    if json:
        print_json(parts | {"warnings": found.warnings})
        return
    for name, facts in parts.items():
        for fact in facts:
            print_line(f"{name:<9}{fact}")


@robot.command()
def identify(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG",
            help="Run folder or log (.mcap) of a drive, or CSV or Parquet with the columns t, "
            "command_vx, command_vy, command_yaw_rate, wheel_speed_0, ..., x, y, yaw.",
        ),
    ],
    name: Annotated[
        str,
        option(
            "NAME|FILE",
            "Robot with its nominal parameters: mounts, masses and motors are taken from it.",
            None,
            "--robot",
            complete=component("robots"),
        ),
    ],
    out: OutOption = None,
    force: ForceOption = False,
    json: JsonOption = False,
) -> None:
    """Identify wheel radius, effective radius, lags, delay and friction from a log.

    It prints each with its standard error, or why the log does not determine it. The log begins at
    rest and holds curves in all directions, small fast steps, and hard starts in which the wheels
    slip, at 50 Hz or more.

    For example:

    * `omnidrive robot identify runs/monday --robot my_base.yaml`
    * `omnidrive robot identify drive.csv --robot my_base.yaml --out identified.yaml`
    """
    from omnidrive.compiled import announce_compiling
    from omnidrive.robot import named_robot, save_robot
    from omnidrive.simulation.identification import identify_robot

    if out is not None:
        check_robot_file(out, force=force)
    nominal = named_robot(name)
    with announce_compiling():
        found = identify_robot(_samples(log), nominal)
    if json:
        print_json({name: _record(each) for name, each in found.estimates.items()})
    else:
        for each in found.estimates.values():
            print_line(f"{each.name:<21}{each}")
    if out is not None:
        notes = [f"Identified from {log.name} with the nominal robot {nominal.name}."]
        notes += [f"{each.name}: {each}" for each in found.estimates.values()]
        save_robot(found.robot, out, notes=notes)
        conclude(f"written to {out}", beside_json=json)


def _samples(log: Path) -> RobotLog:
    """Return the samples of a log of a drive, or of a table."""
    if log.suffix.lower() == ".mcap" or log.is_dir():
        from omnidrive.deploy.identification_log import identification_log
        from omnidrive.deploy.log import read_log as read_drive

        return identification_log(read_drive(log))
    from omnidrive.simulation.identification import read_log

    return read_log(log)


def _record(estimate: Estimate) -> dict[str, object]:
    """Return an estimate as JSON data; a value that is not identifiable is null."""
    known = not estimate.reason
    return {
        "unit": estimate.unit,
        "value": estimate.value if known else None,
        "standard_error": estimate.sigma if known else None,
        "reason": estimate.reason,
    }


def check_robot_file(out: Path, *, force: bool) -> None:
    """Check name and place of a robot file that will be written."""
    from omnidrive.robot import is_robot_file

    if not is_robot_file(out.name):
        raise InvalidInput(f"{one_line(str(out))}: the suffix of a robot file is .yaml")
    study.check_new_file(out, force=force)
