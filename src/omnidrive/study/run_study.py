"""Execution and report of a study: planning, simulation, evaluation."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from omnidrive import visualization  # imports only the modules in use
from omnidrive.compiled import announce_compiling
from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.errors import InvalidInput, OmnidriveError, short_repr
from omnidrive.evaluation.stop_rule import StopRule
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.parameter import Bounds, check_number
from omnidrive.scenario.planned_scenario import plan_and_check
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation.run_log import RUN_LOGGER
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.folder import RunFolder
from omnidrive.study.numbered_runs import is_sequential
from omnidrive.study.output_paths import check_study_folder
from omnidrive.study.progress import NullProgress, ProgressListener, Stopwatch
from omnidrive.study.results_data import save_results
from omnidrive.study.run_plan import RunPlan, check_size
from omnidrive.study.stored_study import report_study
from omnidrive.study.study import Study
from omnidrive.study.study_execution import MAX_SEQUENTIAL, StudyExecution


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
    max_repetitions: int = MAX_SEQUENTIAL,
    scheduler: str | None = None,
    confirmed: bool = False,
    numbered: bool = False,
    figures: Sequence[str] = ("svg",),
) -> Study:
    """Compute the runs of a study that its folder does not hold yet, and write the report.

    A run is stored as soon as it is finished. If the study is interrupted, or its process is
    killed, the same call continues it; the folder may hold fewer repetitions of the study. Other
    processes may compute the same study at the same time; they share the runs. Results depend
    neither on the processes nor on interruptions.

    Args:
        study: The study; a scenario: the comparison of its controllers, which keeps all logs.
        folder: New or empty folder for the results, or that of this study, also if it is finished.
            None: nothing is written.
        processes: Number of worker processes.
        progress: Receiver of progress notifications. None: no notifications.
        observers: Observers of every run; with observers, the runs are sequential.
        run_timeout: Largest wall time of a run in a worker process, s; a run that takes longer is
            ended, and the others go on. None: no limit.
        until: Repetitions are added until this rule is satisfied. None: those of the definition.
        max_repetitions: Largest number of repetitions with ``until``.
        scheduler: Address of a Dask scheduler, whose workers compute the runs. None: processes of
            this computer.
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
    definition = _definition(study)
    path, is_kept = to_path(folder or "."), folder is not None
    _check_run_timeout(definition.scenario, observers, run_timeout)
    check_size(RunPlan(definition), confirmed=confirmed)
    clock = Stopwatch(progress or NullProgress())
    with ExitStack() as stack:
        if not is_kept:
            path = Path(stack.enter_context(TemporaryDirectory(prefix="omnidrive-")))
        elif not numbered:
            check_study_folder(path)
        planned = None
        if definition.is_comparison:
            with clock.part("plan", 0):
                planned = plan_and_check(definition.scenario)
        execution = StudyExecution(
            definition,
            RunFolder(path, numbered=numbered),
            planned,
            observers=observers,
            until=until,
            max_repetitions=max_repetitions,
        )
        with (
            clock.part("simulate", len(RunPlan(definition))),
            _limits_in_the_verdict(definition),
            _kept_results(execution, is_kept=is_kept),
        ):
            execution.execute(
                processes, clock.progress, run_timeout=run_timeout, scheduler=scheduler
            )
        found = execution.study()
        found.timing = clock.seconds
        if not is_kept:
            return found.without_folder()
        with clock.part("report", 0):
            report_study(found, done=clock.progress.done, figures=figures)
        return found


def _definition(study: object) -> StudyDefinition:
    """Return the definition of a study, or that of the comparison of a scenario.

    Raises:
        InvalidInput: It is another object, such as the name of a file.
    """
    if isinstance(study, StudyDefinition):
        return study
    if isinstance(study, Scenario):
        return StudyDefinition.from_scenario(study, series="all")
    raise InvalidInput(
        f"the study is {short_repr(study)}, need a Scenario: paper_scenario(), or "
        "load_scenario(FILE); or a StudyDefinition: load_definition(FILE)"
    )


@contextmanager
def _kept_results(execution: StudyExecution, *, is_kept: bool) -> Iterator[None]:
    """Write results.json of a comparison, if a run is finished, if the block is interrupted."""
    try:
        yield
    except BaseException:
        with suppress(OmnidriveError):
            if is_kept and execution.is_begun and execution.definition.is_comparison:
                save_results(execution.study(), execution.folder)
        raise


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
