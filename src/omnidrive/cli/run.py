"""`omnidrive run`: one controller, one task."""

from __future__ import annotations

import sys
from typing import Annotated, get_args

import typer

from omnidrive.cli.options import (
    Demand,
    DurationOption,
    EstimatorOption,
    GoalOption,
    JsonOption,
    MapOption,
    OutOption,
    PlantOption,
    PresetOption,
    RobotOption,
    ScenarioArgument,
    SeedOption,
    SpeedOption,
    StartOption,
    choose_one,
    new_folder,
)
from omnidrive.cli.progress import LiveProgress, print_tables, warn_of_touching
from omnidrive.errors import InvalidInput
from omnidrive.study import PREDICTIVE, ControllerName, Scenario, TaskName, one_task, run_study


def run(
    scenario: ScenarioArgument = "paper",
    controller: Annotated[
        str,
        typer.Option(
            metavar="|".join(get_args(ControllerName)),
            help="Which controller.",
            rich_help_panel="How to drive",
        ),
    ] = "recommended",
    task: Annotated[
        str,
        typer.Option(
            metavar="track|noise|step", help="What it has to do.", rich_help_panel="How to drive"
        ),
    ] = "track",
    horizon: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Prediction horizon of the NMPC, in steps.",
            rich_help_panel="How to drive",
        ),
    ] = None,
    map_: MapOption = None,
    start: StartOption = None,
    goal: GoalOption = None,
    duration: DurationOption = None,
    speed: SpeedOption = None,
    robot: RobotOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    seed: SeedOption = None,
    estimator: EstimatorOption = None,
    out: OutOption = None,
    json: JsonOption = False,
) -> None:
    """Drive once: one controller, one task, its numbers, time series, figures and report.

    Exit status 1 if the run does not reach its end.

    For example:

    * `omnidrive run --controller nmpc --horizon 25`
    * `omnidrive run --task noise --controller fuzzy_t2 --seed 7`
    * `omnidrive run --task noise --estimator`
    """
    demand = Demand(
        scenario, map_, start, goal, duration, speed, robot, plant, preset, seed,
        estimator=estimator,
    )  # fmt: skip
    resolved = _narrow(demand.resolve(), controller, task, horizon)
    folder = out or new_folder(f"{resolved.name}-{controller}-{task}")
    with LiveProgress() as progress:
        study = run_study(resolved, folder, watcher=progress)
    if json:
        sys.stdout.write((folder / "results.json").read_text(encoding="utf-8"))
    else:
        print_tables(study.tables)
        typer.echo(f"results: {folder} (open {folder / 'report.html'})")
    warn_of_touching(study)
    study.raise_if_failed()


def _narrow(scenario: Scenario, controller: str, task: str, horizon: int | None) -> Scenario:
    """Keep one controller and the first duration of one task."""
    name = choose_one("controller", controller, get_args(ControllerName))
    chosen = choose_one("task", task, [t for t in get_args(TaskName) if t != "horizon"])
    changes: dict[str, object] = {
        "controllers": (name,),
        "tasks": one_task(scenario.tasks, chosen),
    }
    if horizon is not None:
        if name not in PREDICTIVE:
            raise InvalidInput(
                f"--horizon is for the controllers {' and '.join(PREDICTIVE)}, not {name}"
            )
        if not 1 <= horizon <= 200:
            raise InvalidInput(f"the horizon is {horizon} steps, need 1 to 200 steps")
        changes["nmpc"] = scenario.nmpc.model_copy(update={"horizon": horizon})
    return scenario.model_copy(update=changes)
