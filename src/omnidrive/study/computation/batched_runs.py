"""Simulation of planned runs in compiled loops, many at once, with the records of single runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.control import Controller, RetimingController, Status
from omnidrive.errors import InvalidInput, OmnidriveError
from omnidrive.estimation import EncoderSettings
from omnidrive.estimation.state import check_start
from omnidrive.evaluation import StepResponse, step_response
from omnidrive.evaluation.measures.metrics import LoggedRuns, measure_many
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.geometry import Pose, check_heading
from omnidrive.reference import Hold, Reference
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.plants import plant_of
from omnidrive.scenario.run_parts import make_controller, make_supervisor
from omnidrive.scenario.run_settings import run_seed
from omnidrive.scenario.run_simulation import reference_of, start_of
from omnidrive.simulation import KinematicPlant, PlanarPlant
from omnidrive.simulation.batch.closed_loops import BatchRun, ClosedLoops, LoopLogs
from omnidrive.simulation.batch.run_samples import RunSamples, Sampler
from omnidrive.simulation.sensors.sensors import quantized_array
from omnidrive.study.computation.run_recording import finished_record, step_values, tracking_values
from omnidrive.study.design.planned_run import PlannedRun

_PLANTS = ("kinematic", "planar")
_MAX_FLOATS = 1_000_000  # of the logs that are in memory at once
_GROUPED_BY = (
    "plant",
    "plant_robot",
    "robot",
    "sample_time",
    "preset",
    "watchdog",
    "wheel_monitor",
)
"""Sections of a scenario on which the closed loop depends, besides controller and motion."""

Planner = Callable[[PlannedRun], PlannedScenario]


def batched_records(
    runs: Sequence[PlannedRun], planner: Planner
) -> Iterator[tuple[int, RunRecord]]:
    """Yield index and record of the runs that compiled loops simulate; the others are left out.

    A run is one of them if its plant and its controller have compiled code, the poses are exact or
    have the paper's noise, no fault occurs, it reaches the end of its reference, and the supervisor
    does not act. Its record is that of :func:`~omnidrive.scenario.simulate_run`, but without
    computing times.

    Args:
        runs: The runs.
        planner: Returns the planned scenario of a run.
    """
    groups: dict[tuple[object, ...], tuple[PlannedScenario, list[int]]] = {}
    for index, run in enumerate(runs):
        if _is_simple(run):
            with suppress(OmnidriveError):  # the run by itself reports it
                planned = planner(run)
                groups.setdefault(_group_of(run, planned), (planned, []))[1].append(index)
    for planned, indices in groups.values():
        with suppress(OmnidriveError):
            yield from _group_records(runs, indices, planned)


def _is_simple(run: PlannedRun) -> bool:
    """Return whether a run has neither faults nor sensors, and one of the compiled plants."""
    scenario = run.scenario
    is_plain = scenario.sensors is None and not scenario.faults and run.settings.fault == 0
    return is_plain and not run.refused and scenario.plant.type in _PLANTS


def _group_of(run: PlannedRun, planned: PlannedScenario) -> tuple[object, ...]:
    """Return what runs with the same closed loop have in common."""
    scenario, settings = run.scenario, run.settings
    sections = (getattr(scenario, name) for name in _GROUPED_BY)
    phases = (scenario.seed, settings.repeat) if scenario.true_robot.roller_phase else ()
    return (
        id(planned.path), id(scenario.controllers[settings.controller]), *map(_identity, sections),
        settings.controller, settings.horizon, phases,
    )  # fmt: skip


def _identity(section: object) -> object:
    return section if isinstance(section, float | str | bool) else id(section)


def _group_records(
    runs: Sequence[PlannedRun], indices: Sequence[int], planned: PlannedScenario
) -> Iterator[tuple[int, RunRecord]]:
    """Yield the records of runs with the same closed loop."""
    loop = _Loop.of(runs[indices[0]], planned)
    if loop is None:
        return
    by_motion: dict[tuple[str, float], list[int]] = {}
    for index in indices:
        settings = runs[index].settings
        by_motion.setdefault((settings.task, settings.duration), []).append(index)
    for each in by_motion.values():
        with suppress(OmnidriveError):  # a motion that is too fast, which concerns no other one
            yield from loop.records(runs, each)


class _Loop:
    """The closed loop of a group of runs."""

    def __init__(
        self, planned: PlannedScenario, controller: Controller, loops: ClosedLoops
    ) -> None:
        self._planned, self._controller, self._loops = planned, controller, loops
        self._sampler = Sampler(planned.scenario.sample_time, loops.law.window, controller)

    @classmethod
    def of(cls, run: PlannedRun, planned: PlannedScenario) -> _Loop | None:
        """Return the closed loop of a run; None if one of its parts has no compiled code.

        Raises:
            OmnidriveError: A part cannot be made.
        """
        scenario, settings = run.scenario, run.settings
        rng = np.random.default_rng([*run_seed(scenario, settings), 2])
        before = str(rng.bit_generator.state)
        controller = make_controller(
            scenario, planned.robot, settings.controller, settings.horizon, rng
        )
        spawned = getattr(rng.bit_generator.seed_seq, "n_children_spawned", 0)
        if str(rng.bit_generator.state) != before or spawned:
            return None  # each run has a controller of its own
        rest = Hold(planned.start, settings.duration)  # only observers of the plant need the motion
        with plant_of(planned, rest, settings.repeat, on_map=False) as plant:
            if type(plant) not in {KinematicPlant, PlanarPlant}:
                return None
            try:
                return cls(planned, controller, ClosedLoops(plant, controller, keeps_logs=True))
            except InvalidInput:
                return None

    def records(
        self, runs: Sequence[PlannedRun], indices: Sequence[int]
    ) -> Iterator[tuple[int, RunRecord]]:
        """Yield the records of runs on one motion."""
        settings = runs[indices[0]].settings
        reference = reference_of(self._planned, settings)
        start = start_of(self._planned, settings, reference)
        samples = self._sampler.samples(reference, None, lambda: np.random.default_rng(0))
        _check(start, samples)
        due = self._due(reference, samples)
        size = len(samples.arrays.times) * self._loops.log_columns
        count = max(1, _MAX_FLOATS // size)
        for first in range(0, len(indices), count):
            part = indices[first : first + count]
            logs = self._loops.log([_batch_run(runs[i], samples, start) for i in part])
            quiet = logs.finished
            quiet[quiet] = ~self._may_be_stopped(logs.of(quiet), due)
            kept = [i for i, is_quiet in zip(part, quiet, strict=True) if is_quiet]
            if kept:
                found = self._evaluated([runs[i] for i in kept], logs.of(quiet), start)
                yield from zip(kept, found, strict=True)

    def _due(self, reference: Reference, samples: RunSamples) -> Float[Array, "samples 3"]:
        """Return the poses with which the supervisor compares, of the motion that is tracked."""
        tracked = reference
        if isinstance(self._controller, RetimingController):
            tracked, _ = self._controller.retime(reference)
        if tracked is reference:
            return samples.arrays.targets
        return np.array([tracked.at(t).pose for t in samples.arrays.times.tolist()])

    def _may_be_stopped(
        self, logs: LoopLogs, due: Float[Array, "samples 3"]
    ) -> Bool[Array, " runs"]:
        """Return whether the supervisor may act in each run."""
        supervisor = make_supervisor(self._planned.scenario, self._planned.robot)
        acts = np.zeros(len(logs.rows), dtype=bool)
        if supervisor.watchdog is not None:
            acts |= supervisor.watchdog.may_stop(logs.column("estimate")[:, :, :2], due[:, :2])
        if supervisor.monitor is not None and self._loops.forces:
            angles = logs.of_wheels("angle")
            counted = quantized_array(angles - angles[:, :1], EncoderSettings().step)
            acts |= supervisor.monitor.may_report(
                logs.column("command"),
                self._planned.scenario.sample_time,
                counted,
                logs.of_wheels("torque"),
            )
        return acts

    def _evaluated(
        self, runs: Sequence[PlannedRun], logs: LoopLogs, start: Pose
    ) -> list[RunRecord]:
        """Return the records of finished runs on one motion."""
        pose, samples = logs.column("pose"), logs.samples
        if runs[0].settings.task == "step":
            goal = Pose(*samples.targets[0].tolist())
            responses = [_responses(samples.times, each, start, goal) for each in pose]
            work = logs.column("work")[:, -1].tolist()
            return [
                finished_record(run, step_values(*each), {})
                for run, *each in zip(runs, responses, work, strict=True)
            ]
        command = logs.column("command")
        logged = LoggedRuns(
            samples.times,
            samples.targets,
            pose,
            logs.column("estimate"),
            command @ self._planned.robot.drive.jacobian.T,
            logs.column("work")[:, -1],
            (logs.column("status") == Status.FALLBACK).sum(axis=1),
        )
        clearances: list[float | None] = [None] * len(runs)
        if runs[0].settings.task != "faults":
            clearances = self._planned.clearances(pose).tolist()
        found = zip(runs, measure_many(logged), clearances, strict=True)
        return [finished_record(run, *tracking_values(m, 0, c)) for run, m, c in found]


def _check(start: Pose, samples: RunSamples) -> None:
    """Raise InvalidInput for a start that ``simulate`` refuses."""
    check_start(start)
    check_heading("the start's heading", start.yaw)
    check_heading("the reference's heading at its start", float(samples.arrays.targets[0, 2]))


def _batch_run(run: PlannedRun, samples: RunSamples, start: Pose) -> BatchRun:
    is_noisy = run.settings.task == "noise"
    noise = np.random.default_rng(run_seed(run.scenario, run.settings)) if is_noisy else None
    return BatchRun(samples, start, noise)


def _responses(
    times: Float[Array, " rows"], pose: Float[Array, "rows 3"], start: Pose, goal: Pose
) -> list[StepResponse]:
    """Return the step response of each coordinate."""
    return [step_response(times, pose[:, i], start[i], goal[i]) for i in range(len(goal))]
