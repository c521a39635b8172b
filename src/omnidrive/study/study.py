"""Studies: planning, simulation, evaluation and report of a scenario."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from omnidrive import visualization  # imports only the modules in use
from omnidrive.compiled import announce_compiling
from omnidrive.components import configure
from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.errors import InvalidInput, RunFailed, short_repr
from omnidrive.evaluation import (
    StudyResults,
    Table,
    study_tables,
    write_figures,
    write_page,
    write_tables,
)
from omnidrive.evaluation.published import PUBLISHED_ERRORS
from omnidrive.files.str_path import StrPath
from omnidrive.notebook import facts_html, table_html
from omnidrive.parameter import Bounds, check_number
from omnidrive.scenario.planned_scenario import plan_and_check
from omnidrive.scenario.scenario import Scenario, paper_scenario
from omnidrive.simulation import Outcome
from omnidrive.simulation.run_log import RUN_LOGGER
from omnidrive.study.folder import RunFolder
from omnidrive.study.output_paths import REPORT_FILE, check_study_folder
from omnidrive.study.progress import NullProgress, ProgressListener, Stopwatch
from omnidrive.study.run_experiment import is_sequential
from omnidrive.study.scenario_execution import ScenarioExecution

_MAX_TABLES = 2  # in notebooks


@dataclass(frozen=True, eq=False, repr=False, slots=True)
class Study:
    """A finished study.

    Attributes:
        results: Results of all runs.
        tables: Tables of the results.
        folder: Output folder; None: nothing was written.
        timing: Wall time of each part of the study, s.
    """

    results: StudyResults
    tables: list[Table]
    folder: Path | None
    timing: dict[str, float]

    @property
    def overlaps(self) -> list[str]:
        """Names of runs in which the body overlaps an obstacle without a simulated collision."""
        collisions, tracks = self.collisions, self.results.tracks
        return [r.name for r in tracks if r.min_clearance < 0.0 and r.name not in collisions]

    @property
    def collisions(self) -> dict[str, int]:
        """Number of simulated collisions, by the name of the run; only runs with collisions."""
        return {r.name: r.collisions for r in self.results.tracks if r.collisions}

    def raise_if_failed(self) -> Study:
        """Return self; raise :class:`RunFailed` if a run, except those of `faults`, ended early."""
        failed = [r for r in self.results.runs if r.run.outcome is not Outcome.FINISHED]
        if failed:
            facts = (f"{r.name} at {r.run.t[-1]:g} s ({r.run.ending})" for r in failed)
            raise RunFailed(f"stopped early: {'; '.join(facts)}")
        return self

    def __repr__(self) -> str:
        count = len(self.results.runs) + len(self.results.faults)
        return f"<Study {self.results.title!r}: {count} runs, folder {str(self.folder)!r}>"

    def _repr_html_(self) -> str:
        """Return verdict, failed runs and main tables for notebooks."""
        results, runs = self.results, self.results.runs
        ended = [r.name for r in runs if r.run.outcome is not Outcome.FINISHED]
        tables = [table.brief() for table in self.tables if not table.is_detail]
        leads = " ".join(table.lead for table in tables if table.lead)
        facts = {
            **({"verdict": leads} if leads else {}),
            "runs": f"{len(runs) + len(results.faults)}",
            "ended early": ", ".join(ended) or "none",
            "results": str(self.folder) if self.folder else "not written",
        }
        shown = (table_html(t.title, t.columns, t.rows) for t in tables[:_MAX_TABLES])
        return facts_html(results.title, facts) + "".join(shown)


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
        folder: New or empty folder for the results, or that of this study if it was interrupted.
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
    _check_scenario(scenario)
    _check_run_timeout(scenario, observers, run_timeout)
    clock, is_kept = Stopwatch(progress or NullProgress()), folder is not None
    with ExitStack() as stack:
        if folder is None:
            folder = stack.enter_context(TemporaryDirectory(prefix="omnidrive-"))
        elif not numbered:
            check_study_folder(folder)
        with clock.part("plan", 0):
            planned = plan_and_check(scenario)
        store = RunFolder(folder, numbered=numbered)
        execution = ScenarioExecution(planned, store, clock, observers, is_kept=is_kept)
        with clock.part("simulate", len(execution.plan)), _limits_in_the_verdict(scenario):
            results = execution.execute(processes, run_timeout)
        tables = study_tables(results, published=_is_published_study(scenario))
        if is_kept:
            _report(store, results, tables, clock, figures)
            store.save_results(planned, results, clock.seconds)
    return Study(results, tables, store.path if is_kept else None, clock.seconds)


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


def _report(
    store: RunFolder,
    results: StudyResults,
    tables: Sequence[Table],
    clock: Stopwatch,
    figures: Sequence[str],
) -> None:
    """Write figures, tables and the page, each as a part of the study."""
    if figures:
        with clock.part("figures", 0):
            for path in write_figures(results, store.path / "figures", figures):
                clock.progress.done(path.name)
    with clock.part("tables", 0):
        for path in write_tables(tables, store.path / "tables"):
            clock.progress.done(path.name)
    with clock.part("report", 1):
        write_page(results, tables, store.path / REPORT_FILE)
        clock.progress.done(REPORT_FILE)


_PUBLISHED_SETTINGS = ("reference", "map", "start", "goal", "path", "timing", "sample_time")
"""Sections that must equal those of the paper for a comparison with its numbers."""

_PUBLISHED_CONTROLLERS = {controller for _, _, controller in PUBLISHED_ERRORS}


def _is_published_study(scenario: Scenario) -> bool:
    """Return whether the results are comparable with the numbers in the paper."""
    paper = paper_scenario(scenario.preset)
    return (
        all(getattr(scenario, name) == getattr(paper, name) for name in _PUBLISHED_SETTINGS)
        and all(
            scenario.controllers[label] == configure("controllers", label)
            for label in _PUBLISHED_CONTROLLERS & scenario.controllers.keys()
        )
        and scenario.robot.name == paper.robot.name
        and scenario.tasks.step in {None, paper.tasks.step}
    )
