"""A study from its scenario to its report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Protocol, runtime_checkable

from omnidrive.errors import RunFailed
from omnidrive.evaluation import (
    FaultResult,
    StepResult,
    StudyResults,
    Table,
    TrackResult,
    study_tables,
    write_figures,
    write_page,
)
from omnidrive.simulation import Outcome
from omnidrive.study.execute import Result, execute
from omnidrive.study.folder import RunFolder, writing
from omnidrive.study.jobs import Job, jobs_of
from omnidrive.study.output_folder import check_new_folder
from omnidrive.study.planned_scenario import PlannedScenario, plan_and_check
from omnidrive.study.scenario import Scenario, paper_scenario
from omnidrive.visualization import Observer


@runtime_checkable
class ProgressListener(Protocol):
    """Told what a study is doing."""

    def part(self, name: str, steps: int) -> None:
        """A part of the study begins; it has ``steps`` steps (0: not known)."""
        ...

    def done(self, what: str) -> None:
        """One step of the part is done."""
        ...


class NullProgress:
    """A :class:`ProgressListener` that says nothing."""

    def part(self, name: str, steps: int) -> None:
        """Say nothing."""

    def done(self, what: str) -> None:
        """Say nothing."""


@dataclass(frozen=True, eq=False, slots=True)
class Study:
    """A finished study.

    Attributes:
        results: All it found.
        tables: The same as tables.
        folder: Where it was written; None if nowhere.
        timing: Seconds of wall time per part.
    """

    results: StudyResults
    tables: list[Table]
    folder: Path | None
    timing: dict[str, float]

    @property
    def overlaps(self) -> list[str]:
        """Names of the runs whose robot would have touched an obstacle, had it stood there."""
        bumped = self.collisions
        return [
            r.name for r in self.results.tracks if r.min_clearance < 0.0 and r.name not in bumped
        ]

    @property
    def collisions(self) -> dict[str, int]:
        """How often the robot ran into something, by the names of the runs in which it did."""
        return {r.name: r.collisions for r in self.results.tracks if r.collisions}

    def raise_if_failed(self) -> Study:
        """Return self, or raise :class:`RunFailed` if a run stopped early, but for `faults`."""
        failed = [r for r in self.results.runs if r.run.outcome is not Outcome.FINISHED]
        if failed:
            facts = (f"{r.name} at {r.run.t[-1]:g} s ({r.run.ending})" for r in failed)
            raise RunFailed(f"stopped early: {'; '.join(facts)}")
        return self


def run_study(
    scenario: Scenario,
    folder: Path | None = None,
    *,
    processes: int = 1,
    progress: ProgressListener | None = None,
    observers: Sequence[Observer] = (),
) -> Study:
    """Plan, run, measure and report.

    Every run is written as soon as it is finished.

    Args:
        scenario: What to do.
        folder: A new or empty folder for the results; None writes nothing.
        processes: Runs done at the same time; the numbers do not depend on it.
        progress: Told how far the work is.
        observers: Observers of every run; the runs are then done one by one.

    Raises:
        InvalidInput: The scenario cannot be done as it stands.
        NoPathFound: There is no way from start to goal.
        CannotWrite: The folder cannot be written.
    """
    if folder:
        check_new_folder(folder)
    clock = _Clock(progress or NullProgress())
    with clock.part("plan", 0):
        planned = plan_and_check(scenario)
    store = RunFolder(folder) if folder else None
    if store:
        store.save_inputs(planned)
    jobs = jobs_of(scenario)
    finished: dict[Job, Result] = {}
    with (
        clock.part("simulate", len(jobs)),
        closing(execute(planned, jobs, processes, observers)) as done,  # an error ends the workers
    ):
        for job, result in done:
            finished[job] = result
            if store:
                store.save_series(result.name, result.run)
                store.save_results(planned, _collect(planned, jobs, finished), clock.seconds)
            clock.progress.done(result.name)
    results = _collect(planned, jobs, finished)
    tables = study_tables(
        results,
        published=_is_papers(scenario),
        published_rules=scenario.preset == "published-code",
    )
    if store:
        _report(store, results, tables, clock)
        store.save_results(planned, results, clock.seconds)
    return Study(results, tables, folder, clock.seconds)


@dataclass(slots=True)
class _Clock:
    """Wall time per part, while a watcher looks on."""

    progress: ProgressListener
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def part(self, name: str, steps: int) -> Iterator[None]:
        """Tell the watcher of a part of so many steps, and take its time."""
        self.progress.part(name, steps)
        began = perf_counter()
        yield
        self.seconds[name] = round(perf_counter() - began, 3)


def _report(
    store: RunFolder, results: StudyResults, tables: Sequence[Table], clock: _Clock
) -> None:
    with clock.part("figures", 0), writing(store.path):
        for path in write_figures(results, store.path / "figures"):
            clock.progress.done(path.name)
    with clock.part("report", 1), store.whole("report.html") as path:
        write_page(results, tables, path)
        clock.progress.done("report.html")


_DECISIVE = ("map", "start", "goal", "path", "timing", "sample_time", "nmpc")


def _is_papers(scenario: Scenario) -> bool:
    """Whether the paper's numbers belong beside those of this scenario."""
    paper = paper_scenario(scenario.preset)
    return (
        all(getattr(scenario, name) == getattr(paper, name) for name in _DECISIVE)
        and scenario.robot.name == paper.robot.name
        and scenario.tasks.step in {None, paper.tasks.step}
    )


def _collect(
    planned: PlannedScenario, jobs: Sequence[Job], finished: dict[Job, Result]
) -> StudyResults:
    """What is finished so far, in the order of ``jobs``."""
    done = [finished[job] for job in jobs if job in finished]
    scenario = planned.scenario
    return StudyResults(
        title=f"{scenario.name}: preset {scenario.preset}, plant {scenario.plant}",
        robot=planned.robot,
        plant=scenario.plant,
        dt=scenario.sample_time,
        obstacles=planned.obstacles,
        free_space=planned.plan.free_space,
        grid_path=planned.plan.grid_path,
        spline=planned.path,
        tracks=tuple(r for r in done if isinstance(r, TrackResult)),
        steps=tuple(r for r in done if isinstance(r, StepResult)),
        faults=tuple(r for r in done if isinstance(r, FaultResult)),
    )
