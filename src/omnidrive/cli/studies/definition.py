"""Verbs `omnidrive study run` and `list`: studies and their plans."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omnidrive.cli.options import (
    FiguresOption,
    FullOption,
    available_cores,
    default_folder,
    figure_formats,
    flag,
    option,
)
from omnidrive.cli.studies.store import (
    CodeOption,
    JobsOption,
    SchedulerOption,
    TimeoutOption,
    YesOption,
)
from omnidrive.cli.terminal import show
from omnidrive.errors import InvalidInput, one_line

if TYPE_CHECKING:
    from omnidrive.study.design.axes import Label
    from omnidrive.study.design.definition import StudyDefinition

_MAX_VALUE = 2000  # characters of a value of --set
_SHOWN_VALUES = 6


StudyArgument = Annotated[
    str,
    typer.Argument(
        metavar="STUDY",
        help="Study file (.yaml), or a study of this package: see omnidrive study list.",
    ),
]
OutOption = Annotated[
    Path | None,
    option(
        "FOLDER",
        "New folder for the results, or that of the same study, which then continues [default: "
        "runs/NAME-TIME].",
    ),
]
SetOption = Annotated[
    list[str] | None,
    option(
        "PATH=VALUE",
        "Value of a setting of the base scenario, such as plant=planar or "
        "controllers.pid.kp=2; an axis of this name becomes fixed. May be repeated.",
        None,
        "--set",
    ),
]
RepetitionsOption = Annotated[
    int | None, option("N", "Number of repetitions, each with its own seed.", minimum=1)
]
UntilOption = Annotated[
    str | None,
    option(
        "QUANTITY:WIDTH",
        "Add repetitions until the intervals of all differences have at most this half width, "
        "such as me:0.1mm; the intervals are valid whenever the study ends.",
    ),
]
EqualBudgetOption = Annotated[
    int | None,
    option(
        "N",
        "Tune every controller with N trials first, on other seeds and robots, into FOLDER-tuning; "
        "needs the extra `tuning`.",
        minimum=2,
    ),
]
DryRunOption = Annotated[
    bool, flag("Print the plan of the study; compute nothing.", None, "--dry-run")
]


def run(
    source: StudyArgument,
    out: OutOption = None,
    jobs: JobsOption = None,
    set_: SetOption = None,
    repetitions: RepetitionsOption = None,
    until: UntilOption = None,
    equal_budget: EqualBudgetOption = None,
    scheduler: SchedulerOption = None,
    run_timeout: TimeoutOption = None,
    dry_run: DryRunOption = False,
    allow_code: CodeOption = False,
    yes: YesOption = False,
    figures: FiguresOption = None,
    full: FullOption = False,
) -> None:
    """Compute the runs of a study, report them, and print the verdict with its uncertainty.

    A study can be interrupted at any time, and resumed. The folder holds report.html, tables and
    figures as those of `omnidrive study report`.

    For example:

    * `omnidrive study friction.yaml`
    * `omnidrive study paper --dry-run`
    * `omnidrive study friction.yaml --set plant=planar --repetitions 50 --out runs/friction`
    * `omnidrive study friction.yaml --until me:0.1mm`
    * `omnidrive study friction.yaml --equal-budget 100`
    """
    from omnidrive.study.design.definition_file import load_definition

    formats = figure_formats(figures)
    changes = dict(map(_parsed, set_ or ()))
    definition = load_definition(source, changes=changes, allow_code=allow_code)
    if repetitions is not None:
        definition = definition.with_repetitions(repetitions)
    if dry_run:
        _show_plan(definition)
        return
    from omnidrive.cli.studies.execution import compute_and_print

    folder = out or default_folder(definition.name)
    if equal_budget is not None:
        definition = _tuned(definition, equal_budget, folder, jobs)
    compute_and_print(
        definition,
        folder,
        jobs=jobs,
        run_timeout=run_timeout,
        until=until,
        scheduler=scheduler,
        yes=yes,
        numbered=out is None,
        full=full,
        figures=formats,
    )


def _tuned(
    definition: StudyDefinition, trials: int, folder: Path, jobs: int | None
) -> StudyDefinition:
    """Return the study with controllers that are tuned with equal numbers of trials."""
    from omnidrive import tuning
    from omnidrive.cli.studies.tune import TuningProgress

    with TuningProgress() as progress:
        return tuning.equal_budget(
            definition,
            trials,
            folder.with_name(f"{folder.name}-tuning"),
            processes=jobs or available_cores(),
            report=progress.report,
        )


def list_studies() -> None:
    """Print the studies of this package, with their questions and numbers of runs.

    For example:

    * `omnidrive study list`
    """
    from omnidrive.study.design.definition_file import load_definition, study_names
    from omnidrive.study.design.run_plan import RunPlan

    for name in study_names():
        definition = load_definition(name)
        show(f"{name}: {len(RunPlan(definition)):,} runs. {definition.question}")


def _parsed(text: str) -> tuple[str, Any]:
    """Return path and value of ``--set``."""
    from omnidrive.files.yaml_file import parse_yaml

    path, equals, value = text.partition("=")
    if not (equals and path.strip()) or len(value) > _MAX_VALUE:
        raise InvalidInput(
            f"--set {one_line(text, 60)}: write PATH=VALUE, such as plant=planar, with a value of "
            f"at most {_MAX_VALUE} characters"
        )
    return path.strip(), parse_yaml(value, f"the value of --set {path}", "value", InvalidInput)


def _show_plan(definition: StudyDefinition) -> None:
    """Print what a study varies and how many runs that makes."""
    from omnidrive.study.design.run_plan import RunPlan

    plan = RunPlan(definition)
    show(f"study {definition.name}: {len(plan):,} runs")
    if definition.question:
        show(f"question: {definition.question}")
    show(f"controllers: {', '.join(definition.scenario.controllers)}")
    for axis in definition.axes:
        shown = ", ".join(map(_shown, axis.labels[:_SHOWN_VALUES]))
        more = ", ..." if len(axis.labels) > _SHOWN_VALUES else ""
        show(f"axis {axis.name}: {len(axis.labels)} values: {shown}{more}")
    for factor in definition.random.factors:
        show(f"random ({definition.random.method}): {factor.name}: {factor.distribution}")
    show(f"repetitions: {definition.repetitions:,}, each with {plan.per_repetition:,} runs")
    first = plan[0]
    facts = "".join(f", {name} {_shown(value)}" for name, value in first.factors.items())
    task, controller, duration = first.settings[:3]
    show(f"first run: {task}, {controller}, {duration:g} s{facts}")


def _shown(value: Label) -> str:
    """Return the value of a factor with few digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
