"""Simulation of the runs of a study by their numbers, with the time series that it keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omnidrive import visualization  # imports only the modules in use
from omnidrive.components.code import allow, allowed_code
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.execution.engine import must_be_in_process
from omnidrive.files.output_file import create_folder
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation import Run
from omnidrive.study.computation.block_runner import keep_plan, run_block
from omnidrive.study.design.definition import SeriesKept, StudyDefinition
from omnidrive.study.design.planned_run import PlannedRun
from omnidrive.study.design.run_plan import RunPlan


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
        return f"{run.name}.parquet"
    return f"{run.number:06d}.parquet"
