"""Finished runs in the folder of a study that keeps all logs, so that it can be resumed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import version

import numpy as np

from omnidrive.components.fields import plain
from omnidrive.errors import CannotWrite, InvalidLog, one_line
from omnidrive.execution.versions import VERSIONS
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.run_settings import RunSettings, run_name
from omnidrive.scenario.run_simulation import Result, evaluate
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.simulation.log_file import load_run
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.folder import RunFolder, portable
from omnidrive.study.leases import Leases
from omnidrive.study.results_data import component_origins
from omnidrive.study.run_plan import RunPlan
from omnidrive.study.run_recording import record_of
from omnidrive.study.store import Store
from omnidrive.study.study_folder import SCENARIO_FILE, note_file


class StoredRuns:
    """Records of finished runs beside their logs, in a ``with`` statement."""

    def __init__(
        self, folder: RunFolder, planned: PlannedScenario, jobs: Sequence[RunSettings]
    ) -> None:
        """Open the store of a folder, or create it.

        Raises:
            CannotWrite: The folder holds the runs of another study, another process is computing
                this one, or the folder cannot be written.
            InvalidStore: The store is damaged, or of a newer version.
        """
        self._folder, self._planned = folder, planned
        self._numbers = {job: number for number, job in enumerate(jobs)}
        self._plan = RunPlan(StudyDefinition.from_scenario(planned.scenario, series="all"))
        self._store = Store(folder.path)
        try:
            self._begin(_digest(planned))
            self._leases = Leases(self._store, self._plan, shared=False)
            self._leases.__enter__()
        except BaseException:
            self._store.close()
            raise

    def __enter__(self) -> StoredRuns:
        return self

    def __exit__(self, *reason: object) -> None:
        self._leases.__exit__(*reason)
        self._store.close()

    def _begin(self, digest: str) -> None:
        """Check that the store is new, or holds runs of the same planned scenario."""
        if self._store.fact("definition") not in {None, digest}:
            raise CannotWrite(
                f"{one_line(str(self._folder.path))} holds the runs of another study, of other "
                "versions or of other code; choose a new folder with --out"
            )
        self._store.begin(digest)

    def finished(self) -> dict[RunSettings, Result]:
        """Return the results of the runs that are stored with their logs."""
        stored = self._store.numbers(0, len(self._plan))
        found = {}
        for job, number in self._numbers.items():
            if number in stored:
                name = run_name(self._planned.scenario, job)
                with suppress(InvalidLog):  # such a run is executed again
                    run = load_run(self._folder.path / "series" / f"{name}.parquet")
                    found[job] = evaluate(self._planned, job, run)
        return found

    def note_inputs(self) -> None:
        """Store the hash of the scenario file, after it has been written.

        Raises:
            CannotWrite: It cannot be stored.
        """
        note_file(self._store, self._folder.path / SCENARIO_FILE, self._plan)

    def add(self, job: RunSettings, result: Result) -> None:
        """Store a finished run: first its log, then its record.

        Raises:
            CannotWrite: It cannot be stored.
        """
        self._folder.save_series(result.name, result.run)
        record = record_of(self._plan[self._numbers[job]], result)
        self._store.add([record])


def _digest(planned: PlannedScenario) -> str:
    """Return the hash of a planned scenario and its code; files count by their content."""
    scenario = planned.scenario
    durations = scenario.tasks.path_durations
    motion = planned.reference(durations[0]).window(0.0, 50, durations[0] / 49) if durations else 0
    origins, grids = component_origins(scenario), (planned.obstacles, planned.free_space)
    content = [
        scenario_data(portable(scenario)),
        {name: origins[name] for name in ("reference", "controllers", "plant", "estimator")},
        {name: version(name) for name in VERSIONS},
        [plain(planned.robot), plain(planned.plant_robot)],
        [sha256(each.occupied.tobytes()).hexdigest() for each in grids],
        np.asarray(motion).tobytes().hex(),
    ]
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
