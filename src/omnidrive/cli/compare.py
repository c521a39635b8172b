"""`omnidrive compare`: the whole study."""

from __future__ import annotations

import sys
from typing import Annotated, Any, get_args

import typer

from omnidrive.cli.options import (
    Demand,
    DurationOption,
    EstimatorOption,
    GoalOption,
    JobsOption,
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
    choose_many,
    cores,
    new_folder,
)
from omnidrive.cli.progress import LiveProgress, print_tables, warn_of_touching
from omnidrive.errors import InvalidInput
from omnidrive.study import PREDICTIVE, ControllerName, Scenario, TaskName, run_study
from omnidrive.study.scenario_file import parse_scenario, scenario_data


def _only(what: str, names: object) -> Any:
    """An option that keeps some of the names of a literal type, separated by commas."""
    return typer.Option(
        metavar="A,B,...",
        help=f"Only these {what}: {', '.join(get_args(names))}.",
        rich_help_panel="How to drive",
    )


ControllersOption = Annotated[str | None, _only("controllers", ControllerName)]
TasksOption = Annotated[str | None, _only("tasks", TaskName)]
NoiseSeedsOption = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Repeat the task noise with N seeds: means with intervals, paired differences.",
        rich_help_panel="How to drive",
    ),
]


def compare(
    scenario: ScenarioArgument = "paper",
    map_: MapOption = None,
    start: StartOption = None,
    goal: GoalOption = None,
    duration: DurationOption = None,
    speed: SpeedOption = None,
    robot: RobotOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    controllers: ControllersOption = None,
    tasks: TasksOption = None,
    seed: SeedOption = None,
    noise_seeds: NoiseSeedsOption = None,
    jobs: JobsOption = None,
    estimator: EstimatorOption = None,
    out: OutOption = None,
    json: JsonOption = False,
) -> None:
    """Run the whole study: plan, drive with every controller, measure, report.

    Tracking in two durations, tracking with noise, a step response, and the NMPC's horizon. Prints
    the paper's tables, with the paper's numbers beside ours, and leaves a run folder with the
    scenario, results.json, time series, figures and report.html.

    For example:

    * `omnidrive compare`
    * `omnidrive compare --map depot.yaml --start 2,2 --goal 27,13 --robot small --speed 0.6`
    * `omnidrive compare --tasks track --controllers nmpc,recommended --plant ball`
    * `omnidrive compare --tasks noise --noise-seeds 50`
    """
    demand = Demand(
        scenario, map_, start, goal, duration, speed, robot, plant, preset, seed,
        estimator=estimator,
    )  # fmt: skip
    resolved = _restrict(demand.resolve(), controllers, tasks, noise_seeds)
    folder = out or new_folder(resolved.name)
    with LiveProgress() as progress:
        study = run_study(resolved, folder, processes=jobs or cores(), watcher=progress)
    if json:
        sys.stdout.write((folder / "results.json").read_text(encoding="utf-8"))
    else:
        print_tables(study.tables)
        parts = " + ".join(f"{name} {seconds:.1f} s" for name, seconds in study.timing.items())
        typer.echo(f"{parts} = {sum(study.timing.values()):.1f} s")
        typer.echo(f"results: {folder} (open {folder / 'report.html'})")
    warn_of_touching(study)
    study.raise_if_failed()


def _restrict(
    scenario: Scenario, controllers: str | None, tasks: str | None, noise_seeds: int | None
) -> Scenario:
    """Keep only some controllers and tasks, and choose the number of seeds."""
    changes: dict[str, object] = {}
    if controllers is not None:
        chosen = choose_many("controller", controllers, get_args(ControllerName))
        changes["controllers"] = chosen
    if tasks is not None:
        names = get_args(TaskName)
        wanted = choose_many("task", tasks, names)
        kept = {name: getattr(scenario.tasks, name) if name in wanted else None for name in names}
        if not any(kept.values()):
            raise InvalidInput(f"the scenario has none of these tasks: {', '.join(wanted)}")
        changes["tasks"] = scenario.tasks.model_copy(update=kept)
    scenario = scenario.model_copy(update=changes)
    horizon_only = [n for n in get_args(TaskName) if getattr(scenario.tasks, n)] == ["horizon"]
    if horizon_only and not set(PREDICTIVE) & set(scenario.controllers):
        raise InvalidInput(
            f"the task horizon is for {' and '.join(PREDICTIVE)}, which were left out"
        )
    return scenario if noise_seeds is None else _repeated(scenario, noise_seeds)


def _repeated(scenario: Scenario, seeds: int) -> Scenario:
    """The task noise with so many seeds."""
    data = scenario_data(scenario)
    if data["tasks"]["noise"] is None:
        raise InvalidInput("--noise-seeds is for the task noise, which was left out")
    data["tasks"]["noise"]["repeats"] = seeds
    return parse_scenario(data, "with these options")
