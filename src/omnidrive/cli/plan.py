"""`omnidrive plan`: from a map to a timed reference, without driving."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnidrive.cli.options import (
    Demand,
    DurationOption,
    GoalOption,
    MapOption,
    RobotOption,
    ScenarioArgument,
    SpeedOption,
    StartOption,
)
from omnidrive.study import plan_facts, save_plan


def plan(
    scenario: ScenarioArgument = "paper",
    map_: MapOption = None,
    start: StartOption = None,
    goal: GoalOption = None,
    duration: DurationOption = None,
    speed: SpeedOption = None,
    robot: RobotOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="New folder for scenario.yaml, reference.csv and path.png.",
            rich_help_panel="Results",
        ),
    ] = None,
) -> None:
    """Search a path, smooth it, time it; say what it asks of the robot.

    For example:

    * `omnidrive plan`
    * `omnidrive plan --map depot.yaml --start 2,2 --goal 27,13 --robot small --out plan`
    """
    resolved = Demand(scenario, map_, start, goal, duration, speed, robot).resolve()
    for name, value in plan_facts(resolved).items():
        typer.echo(f"{name:<20}{value}")
    if out:
        save_plan(resolved, out)
        typer.echo(f"written to {out}")
