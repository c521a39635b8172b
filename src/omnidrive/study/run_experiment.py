"""Execution of a study into a folder, which holds its definition and its store."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from math import ceil, isfinite
from pathlib import Path
from typing import Any

from omnidrive import visualization  # imports only the modules in use
from omnidrive.components.code import CodePermission, allow, allowed_code
from omnidrive.errors import CannotWrite, one_line
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.evaluation.stop_rule import StopRule
from omnidrive.execution.engine import must_be_in_process
from omnidrive.files.output_file import create_folder, remove_abandoned
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.run_settings import run_name
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation import Run
from omnidrive.study.block_runner import keep_plan, run_block
from omnidrive.study.definition import SeriesKept, StudyDefinition
from omnidrive.study.definition_file import definition_data, load_definition, save_definition
from omnidrive.study.experiment import Experiment, Progress
from omnidrive.study.planned_run import PlannedRun
from omnidrive.study.run_plan import RunPlan, check_size
from omnidrive.study.store import Store
from omnidrive.study.study_folder import (
    DEFINITION_FILE,
    DESCRIPTIONS,
    check_unchanged,
    note_file,
)

MAX_SEQUENTIAL = 10_000
"""Largest number of repetitions that a stop rule may ask for, by default."""

_KEYS_IN_HASH = 256


def run_experiment(
    definition: StudyDefinition,
    folder: StrPath,
    *,
    processes: int = 1,
    report: Callable[[Progress], None] = lambda _: None,
    note: Callable[[str], None] = lambda _: None,
    run_timeout: float | None = None,
    until: StopRule | None = None,
    max_repetitions: int = MAX_SEQUENTIAL,
    scheduler: str | None = None,
    confirmed: bool = False,
) -> Path:
    """Compute the runs of a study that its folder does not hold yet, and return the folder.

    The folder is created. It may hold this study already, also with fewer repetitions: its runs are
    not computed again, however the process that computed them ended. Other processes may compute
    the same study at the same time. Results depend neither on the processes nor on interruptions.

    Args:
        definition: The study.
        folder: New folder, or that of the same study.
        processes: Number of worker processes.
        report: Called with the progress after each block of runs.
        note: Called with one line when a stop rule has been checked.
        run_timeout: Largest wall time of a run in a worker process, s. None: no limit.
        until: Repetitions are added until this rule is satisfied. None: those of the definition.
        max_repetitions: Largest number of repetitions with ``until``.
        scheduler: Address of a Dask scheduler, whose workers compute the runs. None: processes of
            this computer.
        confirmed: Whether the study may have more than ten million runs.

    Raises:
        InvalidStudy: The study has too many runs, or its random factors cannot be extended.
        InvalidStore: The store is damaged, or of a newer version.
        CannotWrite: The folder holds another study, or cannot be written.
        WorkerLost: Worker processes end while they start; stored runs are kept.
        MissingExtra: The scheduler needs an extra that is not installed.
    """
    path = to_path(folder)
    check_size(RunPlan(definition), confirmed=confirmed)
    planned = definition
    if until is not None:
        planned = definition.with_repetitions(max(max_repetitions, definition.repetitions))
    plan = RunPlan(planned)
    file, is_extended = path / DEFINITION_FILE, _prepare_folder(definition, path)
    prepare = partial(_prepare_store, file, RunPlan(definition), is_extended, until)
    runs, digest = NumberedRuns(planned, path / "series"), definition_hash(planned, plan)
    first = plan.per_repetition * definition.repetitions
    Experiment(plan, runs, path, digest, first, prepare).execute(
        processes,
        report=report,
        time_limit=run_timeout,
        in_process=is_sequential(definition.scenario) or None,
        extend=(lambda _: None) if until is None else _Extension(until, plan, note),
        scheduler=scheduler,
    )
    return path


def definition_hash(definition: StudyDefinition, plan: RunPlan) -> str:
    """Return the SHA-256 of what determines the runs of a study and their numbers.

    Versions and components count by the keys of the first runs; the number of repetitions does not
    count.
    """
    keys = plan.keys(0, min(plan.per_repetition, _KEYS_IN_HASH))
    text = json.dumps([_content(definition), keys], sort_keys=True)
    return sha256(text.encode()).hexdigest()


def is_sequential(scenario: Scenario, observers: Sequence[visualization.Observer] = ()) -> bool:
    """Return whether the runs must be computed in this process.

    That is so if there are observers, if the plant is exclusive, if a component was typed into a
    Python session, which a worker process cannot import, or if this process is a daemon, such as
    one of a pool, which may not start processes.
    """
    return (
        scenario.plant_capabilities.exclusive
        or bool(observers)
        or must_be_in_process()
        or not scenario.is_importable
    )


@dataclass(slots=True)
class NumberedRuns:
    """Function that simulates the runs of a study by their numbers.

    Attributes:
        definition: The study.
        folder: Folder for the time series that the study keeps.
        planned: The base scenario, planned. None: it is planned in each process.
        observers: Observers of every run, in this process.
    """

    definition: StudyDefinition
    folder: Path
    planned: PlannedScenario | None = None
    observers: Sequence[visualization.Observer] = ()
    _plan: RunPlan | None = field(default=None, init=False)

    def __getstate__(self) -> tuple[Any, ...]:
        return allowed_code(), self.definition, self.folder, self.planned

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        allowed, self.definition, self.folder, self.planned = state
        allow(allowed)
        self._plan, self.observers = None, ()

    def __call__(self, numbers: Sequence[int]) -> list[RunRecord]:
        """Return the records of runs."""
        if self._plan is None:
            self._plan = RunPlan(self.definition)
            if self.planned is not None:
                keep_plan(self._plan[0], self.planned)
        runs = [self._plan[number] for number in numbers]
        series: SeriesKept = self.definition.series
        if series == "none":
            return run_block(runs)
        return run_block(runs, self._save, series=series, observers=self.observers)

    def _save(self, run: PlannedRun, log: Run) -> None:
        """Write the time series of a run."""
        create_folder(self.folder)
        log.save(self.folder / series_file(self.definition, run))


def series_file(definition: StudyDefinition, run: PlannedRun) -> str:
    """Return the file name of the time series of a run: its number, or name in one scenario."""
    if definition.is_one_scenario:
        return f"{run_name(run.scenario, run.settings)}.parquet"
    return f"{run.number:06d}.parquet"


@dataclass(frozen=True, slots=True)
class _Extension:
    """Number of runs that a stop rule asks for."""

    rule: StopRule
    plan: RunPlan
    note: Callable[[str], None]

    def __call__(self, store: Store) -> int | None:
        """Return how many runs are to be computed in all; None: no more."""
        state = self.rule.check(store.records())
        self.note(state.text)
        maximum = self.plan.definition.repetitions
        if state.reached or state.repetitions >= maximum:
            return None
        done = state.repetitions
        more = 0.5 * (state.needed - done) if isfinite(state.needed) else 0.0
        wanted = done + min(max(ceil(more), done // 4, 2), max(done, 2))
        return min(wanted, maximum) * self.plan.per_repetition


def _prepare_folder(definition: StudyDefinition, path: Path) -> bool:
    """Create the folder with the definition, or check that it holds the same study.

    Returns:
        Whether it holds the study with fewer repetitions.
    """
    create_folder(path)
    remove_abandoned(path)
    file = path / DEFINITION_FILE
    if file.is_file():
        present = load_definition(file, allow_code=CodePermission.UNREAD)
        if _content(present) != _content(definition):
            raise CannotWrite(
                f"{one_line(str(path))} holds another study, '{present.name}'; choose another "
                "folder with --out"
            )
        return present.repetitions < definition.repetitions
    if any(path.iterdir()):
        raise CannotWrite(f"{one_line(str(path))} is not empty; choose a new folder with --out")
    save_definition(definition, file)
    return False


def _prepare_store(
    file: Path, plan: RunPlan, is_extended: bool, until: StopRule | None, store: Store
) -> None:
    """Check that the study file is that of the stored runs; store the facts about it.

    Args:
        file: The study file.
        plan: Runs of the study.
        is_extended: Whether their definition replaces that of the file.
        until: Stop rule of the study.
        store: The store.
    """
    check_unchanged(store, file)
    if is_extended:
        save_definition(plan.definition, file)
    note_file(store, file, plan)
    if until is not None:
        store.note("until", _rule_text(until))


def _content(definition: StudyDefinition) -> dict[str, Any]:
    """Return what determines the runs of a study and their numbers."""
    data = definition_data(definition, "/study.yaml")
    return {key: value for key, value in data.items() if key not in DESCRIPTIONS}


def _rule_text(rule: StopRule) -> str:
    """Return a stop rule as text that :meth:`StopRule.parse` reads."""
    return f"{rule.measure.name}:{rule.half_width!r}"
