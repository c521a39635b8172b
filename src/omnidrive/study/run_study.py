"""Execution and report of a study: planning, simulation, evaluation."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from omnidrive import visualization  # imports only the modules in use
from omnidrive.compiled import announce_compiling
from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.errors import InvalidInput, OmnidriveError, short_repr
from omnidrive.evaluation.statistics.stop_rule import StopRule
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.parameter import Bounds, check_number
from omnidrive.scenario.planned_scenario import PlannedScenario, plan_and_check
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation.run_log import RUN_LOGGER
from omnidrive.study.computation.numbered_runs import is_sequential
from omnidrive.study.computation.study_execution import StudyExecution
from omnidrive.study.design.definition import StudyDefinition
from omnidrive.study.design.run_plan import RunPlan, check_size
from omnidrive.study.folder import RunFolder
from omnidrive.study.output_paths import check_study_folder
from omnidrive.study.progress import NullProgress, ProgressListener, Stopwatch
from omnidrive.study.results_data import save_results
from omnidrive.study.study import Study


@announce_compiling()
def run_study(
    study: Scenario | StudyDefinition,
    folder: StrPath | None = None,
    *,
    processes: int = 1,
    progress: ProgressListener | None = None,
    observers: Sequence[visualization.Observer] = (),
    run_timeout: float | None = None,
    until: StopRule | None = None,
    scheduler: str | None = None,
    confirmed: bool = False,
    numbered: bool = False,
    figures: Sequence[str] = ("svg",),
) -> Study:
    """Compute the runs of a study that its folder does not hold yet, and write the report.

    A run is stored as soon as it is finished: an interrupted study is continued by the same call,
    and processes may share it. Neither affects the results.

    Args:
        study: The study; a scenario: the comparison of its controllers, which keeps all logs.
        folder: New folder, or that of this study, also with fewer repetitions. None: no files.
        processes: Number of worker processes.
        progress: Receiver of progress notifications. None: no notifications.
        observers: Observers of every run; with observers, the runs are sequential.
        run_timeout: Wall time after which a run is ended, s. None: no limit.
        until: Rule until which repetitions are added. None: those of the definition.
        scheduler: Address of a Dask scheduler, whose workers compute. None: this computer does.
        confirmed: Whether the study may have more than ten million runs.
        numbered: Whether to append -2, -3, ... to the name of a folder that exists.
        figures: Formats of the figures: some of svg, pdf and png, or none.

    Raises:
        InvalidInput: The scenario is not feasible, or the runs cannot have a time limit.
        InvalidStudy: The study has too many runs, or its random factors cannot be extended.
        InvalidStore: The store is damaged, or of another version.
        NoPathFound: There is no path from start to goal.
        CannotWrite: The folder holds another study, or cannot be written.
        WorkerLost: Worker processes end while they start; results written before are kept.
        MissingExtra: The scheduler needs an extra that is not installed.
    """
    definition = _definition(study, confirmed=confirmed)
    _check_run_timeout(definition.scenario, observers, run_timeout)
    clock = Stopwatch(progress or NullProgress())
    with _folder_for_results(folder, numbered=numbered) as path:
        planned = _planned(definition, clock)
        to = RunFolder(path, numbered=numbered)
        execution = StudyExecution(definition, to, planned, observers=observers, until=until)
        with _simulating(execution, clock, is_kept=folder is not None):
            execution.execute(
                processes, clock.progress, run_timeout=run_timeout, scheduler=scheduler
            )
        found = execution.study()
        found.timing = clock.seconds
        return found.without_folder() if folder is None else _reported(found, clock, figures)


@contextmanager
def _folder_for_results(folder: StrPath | None, *, numbered: bool) -> Iterator[Path]:
    """Yield the path of the folder, which is checked; None: a temporary one."""
    if folder is None:
        with TemporaryDirectory(prefix="omnidrive-") as path:
            yield Path(path)
        return
    if not numbered:
        check_study_folder(folder)
    yield to_path(folder)


def _planned(definition: StudyDefinition, clock: Stopwatch) -> PlannedScenario | None:
    """Return the planned scenario of a comparison, whose duration is feasible; None: another."""
    if not definition.is_comparison:
        return None
    with clock.part("plan", 0):
        return plan_and_check(definition.scenario)


@contextmanager
def _simulating(execution: StudyExecution, clock: Stopwatch, *, is_kept: bool) -> Iterator[None]:
    """Measure the time of the block; write results.json of a comparison if it is interrupted."""
    definition = execution.definition
    with clock.part("simulate", len(RunPlan(definition))), _limits_in_the_verdict(definition):
        try:
            yield
        except BaseException:
            with suppress(OmnidriveError):  # no run is finished
                if is_kept and execution.is_begun and definition.is_comparison:
                    save_results(execution.study(), execution.folder)
            raise


def _reported(study: Study, clock: Stopwatch, figures: Sequence[str]) -> Study:
    """Write the report, and results.json of a comparison; return the study."""
    assert study.folder is not None
    with clock.part("report", 0):
        for path in study.report.write(study.folder, formats=figures):
            clock.progress.done(path.name)
    if study.definition.is_comparison:
        save_results(study, study.folder)
    return study


def _definition(study: object, *, confirmed: bool) -> StudyDefinition:
    """Return the definition of a study, or that of the comparison of a scenario.

    Raises:
        InvalidInput: It is another object, such as the name of a file.
        InvalidStudy: It has too many runs that are not confirmed.
    """
    if isinstance(study, Scenario):
        return StudyDefinition.from_scenario(study, series="all")
    if isinstance(study, StudyDefinition):
        check_size(RunPlan(study), confirmed=confirmed)
        return study
    raise InvalidInput(
        f"the study is {short_repr(study)}, need a Scenario: paper_scenario(), or "
        "load_scenario(FILE); or a StudyDefinition: load_definition(FILE)"
    )


@contextmanager
def _limits_in_the_verdict(definition: StudyDefinition) -> Iterator[None]:
    """Log no warnings that references exceed limits of controllers if the verdict states it."""

    def is_other(record: logging.LogRecord) -> bool:
        """Return whether a warning is about something else."""
        return not record.getMessage().endswith(FALLS_BEHIND)

    logger = logging.getLogger(RUN_LOGGER)
    if definition.is_comparison and len(definition.scenario.controllers) > 1:
        logger.addFilter(is_other)
    try:
        yield
    finally:
        logger.removeFilter(is_other)


def _check_run_timeout(
    scenario: Scenario, observers: Sequence[visualization.Observer], run_timeout: float | None
) -> None:
    """Raise InvalidInput unless the runs can have the time limit, if there is one."""
    if run_timeout is None:
        return
    check_number("run_timeout", run_timeout, Bounds(0.1, 1e6, "s"))
    if is_sequential(scenario, observers):
        raise InvalidInput(
            "a time limit of runs needs worker processes, which are not possible with this plant, "
            "a view or video, code from a Python session, or in a daemon process; omit "
            "--run-timeout"
        )
