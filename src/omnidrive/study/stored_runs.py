"""Finished runs in the folder of a study that keeps all logs, so that it can be resumed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import version
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.components.fields import plain
from omnidrive.control.supervision import Event
from omnidrive.errors import CannotWrite, one_line
from omnidrive.execution.versions import VERSIONS
from omnidrive.scenario.run_settings import RunSettings, run_name
from omnidrive.scenario.run_simulation import Result, evaluate
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.simulation import Outcome, Run
from omnidrive.simulation.log_columns import POSE, TWIST
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.folder import RunFolder, portable
from omnidrive.study.leases import Leases
from omnidrive.study.results_data import component_origins
from omnidrive.study.run_plan import RunPlan
from omnidrive.study.run_recording import record_of
from omnidrive.study.store import Store
from omnidrive.study.study_folder import SCENARIO_FILE, note_file

_SCALARS = ("t", "work", "status", "collisions", "step_time", "saturated")
_WHEELS = ("wheel_speed", "wheel_torque", "command_wheel_speed", "command_wheel_torque")
_MAX_WHEELS = 1000
_UNREADABLE = (OSError, pa.ArrowException, KeyError, ValueError, TypeError)


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
        texts = self._store.logs()
        found = {}
        for job, number in self._numbers.items():
            with suppress(*_UNREADABLE):  # such a run is executed again
                name = run_name(self._planned.scenario, job)
                path = self._folder.path / "series" / f"{name}.parquet"
                run = _restored(pq.read_table(path), json.loads(texts[number]))
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
        self._store.add([record], [json.dumps(_rest(result.run))])


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


def _rest(run: Run) -> dict[str, Any]:
    """Return what the columns of a log do not contain, for :func:`restored_run`."""
    return {
        "outcome": run.outcome.name,
        "reason": run.reason,
        "traceback": run.traceback,
        "events": run.events,
        "position_sigma": _numbers(run.position_sigma),
        "yaw_sigma": _numbers(run.yaw_sigma),
    }


def _numbers(values: Float[Array, " rows"]) -> list[float] | None:
    """Return values as a list; None: all are NaN."""
    return None if np.isnan(values).all() else values.tolist()


def _restored(table: pa.Table, rest: dict[str, Any]) -> Run:
    """Return the run whose log was written as a table.

    Args:
        table: The table of :func:`~omnidrive.simulation.log_file.log_table`.
        rest: What :func:`_rest` returned.
    """
    columns = {name: table[name].to_numpy() for name in table.column_names}
    units = {each.name: each.metadata[b"unit"].decode() for each in table.schema}

    def vector(names: Sequence[str]) -> Float[Array, "rows _"]:
        """Take columns out of the table, side by side."""
        taken = [columns.pop(name) for name in names]
        return np.column_stack(taken) if taken else np.empty((table.num_rows, 0))

    def wheels(name: str) -> Float[Array, "rows _"]:
        """Take the columns of a quantity of each wheel."""
        return vector([f"{name}_{i}" for i in range(_MAX_WHEELS) if f"{name}_{i}" in columns])

    def sigma(name: str) -> Float[Array, " rows"]:
        """Return a standard deviation; NaN where it is not stored."""
        values = rest[name]
        return np.full(table.num_rows, np.nan) if values is None else np.array(values)

    poses = {
        name: vector([prefix + field for field, _ in POSE])
        for name, prefix in (("pose", ""), ("measured", "measured_"), ("target", "target_"))
    }
    twists = {
        name: vector([prefix + field for field, _ in TWIST])
        for name, prefix in (("command", "command_"), ("twist", "actual_"))
    }
    speed, torque, speed_command, torque_command = map(wheels, _WHEELS)
    scalars = {name: columns.pop(name) for name in _SCALARS}
    return Run(
        **poses,
        **twists,
        **scalars,
        wheel_speed=speed,
        wheel_torque=torque,
        wheel_speed_command=speed_command,
        wheel_torque_command=torque_command,
        position_sigma=sigma("position_sigma"),
        yaw_sigma=sigma("yaw_sigma"),
        outcome=Outcome[rest["outcome"]],
        details=columns,
        detail_units={name: units[name] for name in columns},
        events=tuple(Event(*each) for each in rest["events"]),
        reason=rest["reason"],
        traceback=rest["traceback"],
    )
