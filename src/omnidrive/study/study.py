"""Studies: planning, simulation, evaluation and report of a scenario."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive import visualization  # imports only the modules in use
from omnidrive.compiled import announce_compiling
from omnidrive.components import configure
from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.errors import InvalidInput, RunFailed
from omnidrive.evaluation import (
    FaultResult,
    StepResult,
    StudyResults,
    Table,
    TrackResult,
    study_tables,
    write_figures,
    write_page,
    write_tables,
)
from omnidrive.evaluation.published import PUBLISHED_ERRORS
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.notebook import facts_html, table_html
from omnidrive.parameter import Bounds, check_number
from omnidrive.scenario.planned_scenario import PlannedScenario, plan_and_check
from omnidrive.scenario.run_settings import RunSettings, settings_of_runs
from omnidrive.scenario.run_simulation import Result
from omnidrive.scenario.scenario import Scenario, paper_scenario
from omnidrive.simulation import Outcome
from omnidrive.simulation.run_log import RUN_LOGGER
from omnidrive.study.folder import RunFolder
from omnidrive.study.job_execution import execute_jobs, is_sequential
from omnidrive.study.output_paths import REPORT_FILE, check_new_folder, check_study_folder
from omnidrive.study.setup_facts import controller_types
from omnidrive.study.stored_runs import StoredRuns

_MAX_TABLES = 2  # in notebooks


@runtime_checkable
class ProgressListener(Protocol):
    """Receiver of progress notifications."""

    def part(self, name: str, steps: int) -> None:
        """Handle the start of a part with ``steps`` steps (0: unknown number)."""
        ...

    def done(self, what: str) -> None:
        """Handle the end of one step of the part; ``what`` names it."""
        ...


class NullProgress:
    """A :class:`ProgressListener` that does nothing."""

    def part(self, name: str, steps: int) -> None:
        """Do nothing."""

    def done(self, what: str) -> None:
        """Do nothing."""


@dataclass(frozen=True, eq=False, slots=True)
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
    process is killed, the same call continues it: finished runs are restored from the folder.

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
        CannotWrite: The folder cannot be written, or another process is computing this study.
        WorkerLost: Worker processes end while they start; results written before are kept.
    """
    path = to_path(folder) if folder is not None else None
    resumable = len(settings_of_runs(scenario)) > 1 and scenario.is_importable and not observers
    if path and not numbered:
        (check_study_folder if resumable else check_new_folder)(path)
    _check_run_timeout(scenario, observers, run_timeout)
    clock = _Clock(progress or NullProgress())
    with clock.part("plan", 0):
        planned = plan_and_check(scenario)
    store = RunFolder(path, numbered=numbered) if path else None
    jobs = settings_of_runs(scenario)
    with StoredRuns(store, planned, jobs) if store and resumable else nullcontext() as stored:
        with clock.part("simulate", len(jobs)), _limits_in_the_verdict(scenario):
            if store:
                store.save_inputs(planned)
            if stored:
                stored.note_inputs()
            finished = stored.finished() if stored else {}
            left = [job for job in jobs if job not in finished]
            runs = execute_jobs(planned, left, processes, observers, run_timeout=run_timeout)
            with closing(runs):  # which ends the workers
                _collect_and_save(planned, finished, runs, _Outputs(store, stored, clock))
        tables = _tables(scenario, results := collect_results(planned, jobs, finished))
        if store:
            _report(store, results, tables, clock, figures)
            store.save_results(planned, results, clock.seconds)
    return Study(results, tables, store.path if store else None, clock.seconds)


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


def _tables(scenario: Scenario, results: StudyResults) -> list[Table]:
    """Return the tables of the results."""
    return study_tables(results, published=_is_published_study(scenario))


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


@dataclass(slots=True)
class _Clock:
    """Stopwatch of the parts of a study, which also notifies a listener."""

    progress: ProgressListener
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def part(self, name: str, steps: int) -> Iterator[None]:
        """Notify the listener of a part and measure the wall time of the block."""
        self.progress.part(name, steps)
        began = perf_counter()
        yield
        self.seconds[name] = round(perf_counter() - began, 3)


class _Outputs(NamedTuple):
    """Where results are written and progress is shown."""

    folder: RunFolder | None
    stored: StoredRuns | None
    """Store of finished runs; None: they are not restored."""
    clock: _Clock


def _collect_and_save(
    planned: PlannedScenario,
    finished: dict[RunSettings, Result],
    executed: Iterable[tuple[RunSettings, Result]],
    outputs: _Outputs,
) -> None:
    """Add the results of runs to ``finished``; write those of each run when it is finished."""
    folder, stored, clock = outputs
    jobs = settings_of_runs(planned.scenario)
    for result in finished.values():
        clock.progress.done(result.name)
    for job, result in executed:
        finished[job] = result
        if stored:
            stored.add(job, result)
        elif folder:
            folder.save_series(result.name, result.run)
        if folder:
            folder.save_results(planned, collect_results(planned, jobs, finished), clock.seconds)
        clock.progress.done(result.name)


def _report(
    store: RunFolder,
    results: StudyResults,
    tables: Sequence[Table],
    clock: _Clock,
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


def collect_results(
    planned: PlannedScenario, jobs: Sequence[RunSettings], finished: dict[RunSettings, Result]
) -> StudyResults:
    """Return the results of the finished runs of a scenario, in the order of ``jobs``."""
    done = [finished[job] for job in jobs if job in finished]
    scenario = planned.scenario
    return StudyResults(
        title=_title(scenario),
        robot=planned.robot,
        plant=scenario.plant.type,
        dt=scenario.sample_time,
        obstacles=planned.obstacles,
        free_space=planned.free_space,
        grid_path=planned.plan.grid_path if planned.plan else None,
        spline=planned.path,
        tracks=tuple(r for r in done if isinstance(r, TrackResult)),
        steps=tuple(r for r in done if isinstance(r, StepResult)),
        faults=tuple(r for r in done if isinstance(r, FaultResult)),
        types=controller_types(scenario),
    )


def _title(scenario: Scenario) -> str:
    """Return the title of a study: its preset, or the controller if there is only one."""
    facts = [f"preset {scenario.preset}", f"plant {scenario.plant.type}"]
    if len(scenario.controllers) == 1:
        facts[:1] = [*scenario.controllers, *(facts[:1] if scenario.preset != "paper" else ())]
    return f"{scenario.name}: {', '.join(facts)}"
