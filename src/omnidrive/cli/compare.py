"""`omnidrive compare`: the whole study."""

from __future__ import annotations

import sys
from typing import Annotated, Any, get_args

import typer

from omnidrive.cli.demand import Demand, with_demand
from omnidrive.cli.faults import FaultOption, with_faults
from omnidrive.cli.options import (
    RUN_PANEL,
    FolderOption,
    JsonOption,
    available_cores,
    choose_many,
    default_folder,
    option,
)
from omnidrive.cli.progress import LiveProgress, print_events, print_tables, warn_of_collisions
from omnidrive.errors import InvalidInput
from omnidrive.study import (
    PREDICTIVE,
    ControllerName,
    Scenario,
    TaskName,
    check_new_folder,
    run_study,
    with_task,
)
from omnidrive.study.scenario_file import parse_scenario, scenario_data


def _only(what: str, names: object) -> Any:
    """An option that keeps some of the names of a literal type, separated by commas."""
    return option("A,B,...", f"Only these {what}: {', '.join(get_args(names))}.", RUN_PANEL)


@with_demand()
def compare(
    demand: Demand,
    controllers: Annotated[str | None, _only("controllers", ControllerName)] = None,
    tasks: Annotated[str | None, _only("tasks", TaskName)] = None,
    noise_seeds: Annotated[
        int | None,
        option(
            "N",
            "Repeat the task noise with N seeds: means with intervals, paired differences.",
            RUN_PANEL,
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        option(
            "N",
            "Runs at the same time; changes no number [default: every core].",
            RUN_PANEL,
            least=1,
        ),
    ] = None,
    fault: FaultOption = None,
    out: FolderOption = None,
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
    * `omnidrive compare --tasks faults --plant ball`
    """
    if out is not None:
        check_new_folder(out)
    resolved = _restrict(demand.resolve(), controllers, tasks, noise_seeds)
    resolved = with_faults(resolved, fault)
    folder = out or default_folder(resolved.name)
    with LiveProgress() as progress:
        study = run_study(resolved, folder, processes=jobs or available_cores(), watcher=progress)
    if json:
        sys.stdout.write((folder / "results.json").read_text(encoding="utf-8"))
    else:
        print_tables(study.tables)
        print_events(study)
        parts = " + ".join(f"{name} {seconds:.1f} s" for name, seconds in study.timing.items())
        typer.echo(f"{parts} = {sum(study.timing.values()):.1f} s")
        typer.echo(f"results: {folder} (open {folder / 'report.html'})")
    warn_of_collisions(study)
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
        scenario = with_task(scenario, wanted)
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
