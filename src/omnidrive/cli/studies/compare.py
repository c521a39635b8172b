"""``omnidrive compare``: run a whole study."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, get_args

from omnidrive import scenario as scenarios
from omnidrive import study
from omnidrive.choices import TaskName
from omnidrive.cli.completion import several_components, some_of
from omnidrive.cli.components import ControllersOption, with_controllers
from omnidrive.cli.faults import FaultOption, with_faults
from omnidrive.cli.options import (
    RUN_PANEL,
    FiguresOption,
    FolderOption,
    FullOption,
    ResultsJsonOption,
    choose_many,
    default_folder,
    figure_formats,
    option,
)
from omnidrive.cli.scenario_options import ScenarioOptions, with_options
from omnidrive.errors import InvalidInput

_NamesOption = Annotated[
    str | None,
    option(
        "A,B,...",
        "Only these controllers, by label or name; with parameters: --controller.",
        RUN_PANEL,
        complete=several_components("controllers"),
    ),
]
_TasksOption = Annotated[
    str | None,
    option(
        "A,B,...",
        f"Only these tasks: {', '.join(get_args(TaskName))}.",
        RUN_PANEL,
        complete=some_of(get_args(TaskName)),
    ),
]
_SeedsOption = Annotated[
    int | None,
    option(
        "N",
        "Repeat the task `noise` with N seeds (1 to 200); report means with confidence intervals "
        "and paired differences.",
        RUN_PANEL,
    ),
]
_TimeoutOption = Annotated[
    float | None,
    option(
        "S",
        "End a run that takes longer than this wall time, s; the others go on. The time includes "
        "compiling kernels at their first use [default: no limit].",
        RUN_PANEL,
    ),
]
_JobsOption = Annotated[
    int | None,
    option(
        "N",
        "Number of parallel runs; affects no results but computing times [default: all cores].",
        RUN_PANEL,
        minimum=1,
    ),
]


@with_options()
def compare(
    shared: ScenarioOptions,
    controllers: _NamesOption = None,
    controller: ControllersOption = None,
    tasks: _TasksOption = None,
    noise_seeds: _SeedsOption = None,
    jobs: _JobsOption = None,
    run_timeout: _TimeoutOption = None,
    fault: FaultOption = None,
    out: FolderOption = None,
    figures: FiguresOption = None,
    json: ResultsJsonOption = False,
    full: FullOption = False,
) -> None:
    """Run a whole study: plan, simulate every controller, evaluate, report.

    The tasks are those of the scenario: by default tracking with two durations, tracking with
    noise, step response and, for the NMPC, several prediction horizons; `--tasks faults` injects
    faults. The command prints the best controller of each task and the main tables, and writes a
    run folder with scenario, results.json, time series, figures, tables and report.html. A study
    that was interrupted continues with the same options and the same `--out`, or with
    `omnidrive study resume FOLDER`.

    Results with path, timing and robot of the paper (L. Panta, "Comparative Analysis of NMPC and
    Fuzzy PID Controllers for Trajectory Tracking in Omni-Drive Robots: Design, Simulation, and
    Performance Evaluation"), as of the default scenario, are shown beside those published there.

    For example:

    * `omnidrive compare`
    * `omnidrive compare --map depot.yaml --start 2,2 --goal 27,13 --robot small --speed 0.6`
    * `omnidrive compare --tasks track --controllers pid,holonomic-nmpc --plant mujoco-balls`
    * `omnidrive compare --controller mine.py:MyController --controller holonomic-nmpc`
    * `omnidrive compare --controller feedforward --controller stiff=feedforward,position=9`
    * `omnidrive compare --tasks noise --noise-seeds 50`
    * `omnidrive compare --tasks faults --plant mujoco-balls`
    """
    from omnidrive.cli.studies.execution import compute_and_print

    if out is not None:
        study.check_study_folder(out)
    formats = figure_formats(figures)
    if controllers and "=" in controllers:
        raise InvalidInput(
            "--controllers takes names only; give parameters with --controller NAME,KEY=VALUE"
        )
    chosen = [*(controllers.split(",") if controllers else ()), *(controller or ())]
    resolved = _restrict(shared.resolve(), chosen, tasks, noise_seeds, allow_code=shared.allow_code)
    resolved = with_faults(resolved, fault)
    compute_and_print(
        study.StudyDefinition.from_scenario(resolved, series="all"),
        out or default_folder(resolved.name),
        jobs=jobs,
        run_timeout=run_timeout,
        numbered=out is None,
        json=json,
        full=full,
        figures=formats,
    )


def _restrict(
    scenario: scenarios.Scenario,
    controllers: Sequence[str],
    tasks: str | None,
    noise_seeds: int | None,
    *,
    allow_code: bool,
) -> scenarios.Scenario:
    """Return the scenario with the selected controllers and tasks and the number of seeds."""
    changes: dict[str, object] = {}
    if controllers:
        scenario = with_controllers(scenario, controllers, allow_code=allow_code)
    if tasks is not None:
        names = get_args(TaskName)
        selected = choose_many("task", tasks, names)
        scenario = scenarios.with_task(scenario, selected)
        kept = {name: getattr(scenario.tasks, name) if name in selected else None for name in names}
        if not any(kept.values()):
            raise InvalidInput(f"the scenario does not contain these tasks: {', '.join(selected)}")
        changes["tasks"] = scenario.tasks.model_copy(update=kept)
    scenario = scenario.model_copy(update=changes)
    horizon_only = [n for n in get_args(TaskName) if getattr(scenario.tasks, n)] == ["horizon"]
    if horizon_only and not scenario.predictive:
        raise InvalidInput(
            "the task `horizon` needs a controller with the parameter horizon; add unicycle-nmpc "
            "or holonomic-nmpc to --controllers"
        )
    return scenario if noise_seeds is None else _with_repeats(scenario, noise_seeds)


def _with_repeats(scenario: scenarios.Scenario, seeds: int) -> scenarios.Scenario:
    """Return the scenario with the task `noise` repeated for ``seeds`` seeds."""
    from omnidrive.scenario.scenario_file import parse_scenario, scenario_data

    data = scenario_data(scenario)
    if data["tasks"]["noise"] is None:
        raise InvalidInput(
            "--noise-seeds needs the task `noise`; add noise to --tasks, or omit --noise-seeds"
        )
    data["tasks"]["noise"]["repeats"] = seeds
    return parse_scenario(data, "with these options")
