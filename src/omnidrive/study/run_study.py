"""Planning, execution and report of the study of one scenario."""

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
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.parameter import Bounds, check_number
from omnidrive.scenario.planned_scenario import PlannedScenario, plan_and_check
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation.run_log import RUN_LOGGER
from omnidrive.study.folder import RunFolder
from omnidrive.study.output_paths import check_study_folder
from omnidrive.study.progress import NullProgress, ProgressListener, Stopwatch
from omnidrive.study.results_data import save_results
from omnidrive.study.run_experiment import is_sequential
from omnidrive.study.scenario_execution import ScenarioExecution
from omnidrive.study.stored_study import stored_study
from omnidrive.study.study import Study


@announce_compiling()
def run_study(
    scenario: Scenario,
    folder: StrPath | None = None,
    *,
    processes: int = 1,
    progress: ProgressListener | None = None,
    observers: Sequence[visualization.Observer] = (),
    run_timeout: float | None = None,
    numbered: bool = False,
    figures: Sequence[str] = ("svg", "pdf"),
) -> Study:
    """Plan a scenario, simulate and evaluate all its runs, and write the report.

    The files of a run are written as soon as it is finished. If the study is interrupted, or its
    process is killed, the same call continues it: finished runs are restored from the folder. Other
    processes may compute the same study at the same time; they share the runs.

    Args:
        scenario: The scenario.
        folder: New or empty folder for the results, or that of this study, also if it is finished.
            None: nothing is written.
        processes: Number of worker processes; the results do not depend on it.
        progress: Receiver of progress notifications. None: no notifications.
        observers: Observers of every run; with observers, the runs are sequential.
        run_timeout: Largest wall time of a run in a worker process, s; a run that takes longer is
            ended, and the others go on. None: no limit.
        numbered: Whether to append -2, -3, ... to the name of a folder that exists.
        figures: Formats of the figures: some of svg, pdf and png, or none.

    Raises:
        InvalidInput: The scenario is not feasible, or the runs cannot have a time limit.
        NoPathFound: There is no path from start to goal.
        CannotWrite: The folder holds another study, or cannot be written.
        WorkerLost: Worker processes end while they start; results written before are kept.
    """
    path, is_kept = to_path(folder or "."), folder is not None
    _check_scenario(scenario)
    _check_run_timeout(scenario, observers, run_timeout)
    clock = Stopwatch(progress or NullProgress())
    with ExitStack() as stack:
        if not is_kept:
            path = Path(stack.enter_context(TemporaryDirectory(prefix="omnidrive-")))
        elif not numbered:
            check_study_folder(path)
        with clock.part("plan", 0):
            planned = plan_and_check(scenario)
        store = RunFolder(path, numbered=numbered)
        execution = ScenarioExecution(planned, store, clock, observers)
        with (
            clock.part("simulate", len(execution.plan)),
            _limits_in_the_verdict(scenario),
            _kept_results(execution, planned, is_kept=is_kept),
        ):
            execution.execute(processes, run_timeout)
        study = stored_study(store.path, execution.definition, read_only=False)
        study.planned, study.timing = planned, clock.seconds
        if not is_kept:
            return study.without_folder()
        _report(study, store.path, clock, figures)
        return study


@contextmanager
def _kept_results(
    execution: ScenarioExecution, planned: PlannedScenario, *, is_kept: bool
) -> Iterator[None]:
    """Write results.json of the finished runs, if there are any, if the block is interrupted."""
    try:
        yield
    except BaseException:
        with suppress(OmnidriveError):
            if is_kept and execution.is_begun:
                study = stored_study(execution.folder, execution.definition, read_only=False)
                study.planned = planned
                save_results(study, execution.folder)
        raise


@contextmanager
def _limits_in_the_verdict(scenario: Scenario) -> Iterator[None]:
    """Log no warnings that references exceed limits of controllers if the verdict states it."""

    def is_other(record: logging.LogRecord) -> bool:
        """Return whether a warning is about something else."""
        return not record.getMessage().endswith(FALLS_BEHIND)

    logger = logging.getLogger(RUN_LOGGER)
    if len(scenario.controllers) > 1:
        logger.addFilter(is_other)
    try:
        yield
    finally:
        logger.removeFilter(is_other)


def _check_scenario(scenario: object) -> None:
    """Raise InvalidInput if a scenario is another object, such as the name of a file."""
    if not isinstance(scenario, Scenario):
        raise InvalidInput(
            f"the scenario is {short_repr(scenario)}, need a Scenario: paper_scenario(), or "
            "load_scenario(FILE)"
        )


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


def _report(study: Study, folder: Path, clock: Stopwatch, figures: Sequence[str]) -> None:
    """Write figures, tables, the page and results.json."""
    with clock.part("report", 0):
        for path in study.report.write(folder, formats=figures):
            clock.progress.done(path.name)
    save_results(study, folder)
