"""Closed loops of one plant and one controller, simulated run by run or many at once."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.compiled import announce_compiling, entry_point
from omnidrive.control import Controller
from omnidrive.control.compiled_law import CompilableController, CompiledLaw, size_in_floats, views
from omnidrive.control.controller import DetailedController
from omnidrive.errors import InvalidInput, kind_of
from omnidrive.geometry import Pose
from omnidrive.simulation.batch.loop import (
    CARRIED,
    FIGURES,
    FINISHED,
    LOG,
    LOG_COLUMNS,
    RunArrays,
    SampleArrays,
    closed_loop,
)
from omnidrive.simulation.batch.plants import MOTION, BatchPlant
from omnidrive.simulation.batch.results import run_of
from omnidrive.simulation.batch.run_samples import RunSamples
from omnidrive.simulation.plant import Plant
from omnidrive.simulation.run import Run


class BatchRun(NamedTuple):
    """One run of a batch."""

    samples: RunSamples
    """Times, setpoints and faults; consecutive runs can have the same object."""
    start: Pose
    """Pose of B in W at t = 0, at rest; m, m, rad."""
    noise: np.random.Generator | None
    """Generator of ``PaperNoise``; None: exact poses. All runs of a batch have one, or none
    has."""


class RunResults(NamedTuple):
    """Results of consecutive runs."""

    figures: Any
    """One record of :data:`~omnidrive.simulation.batch.loop.FIGURES` per run."""
    logs: list[Run]
    """One per run; empty if logs are not kept."""


class LoopLogs(NamedTuple):
    """Logs of runs with the same samples, as arrays."""

    samples: SampleArrays
    figures: Any
    """As :attr:`RunResults.figures`."""
    rows: Float[Array, "runs samples columns"]
    """Rows that the compiled loop filled in; those after the end of a run have no meaning."""
    wheels: int

    @property
    def finished(self) -> Bool[Array, " runs"]:
        """Whether each run reached the end of its reference."""
        done: Bool[Array, " runs"] = self.figures["end"] == FINISHED
        return done

    def of(self, chosen: Bool[Array, " runs"]) -> LoopLogs:
        """Return the logs of the chosen runs."""
        if chosen.all():
            return self
        return self._replace(figures=self.figures[chosen], rows=self.rows[chosen])

    def column(self, name: str) -> Float[Array, "runs samples *_"]:
        """Return a field of the logs, by its name in :data:`.loop.LOG`."""
        records = self.rows[:, :, :LOG_COLUMNS].view(LOG)[:, :, 0]
        return np.ascontiguousarray(records[name])

    def of_wheels(
        self, part: Literal["speed", "torque", "angle"]
    ) -> Float[Array, "runs samples _"]:
        """Return a quantity of the wheels; rad/s, N m, rad."""
        first = LOG_COLUMNS + ("speed", "torque", "angle").index(part) * self.wheels
        return np.ascontiguousarray(self.rows[:, :, first : first + self.wheels])


class ClosedLoops:
    """Closed loops of one plant and one controller; threads can share the object.

    Args:
        plant: A kinematic or planar plant; it is not changed.
        controller: A controller with a compiled law; it is not changed.
        keeps_logs: Whether the results contain the logs of the runs.

    Raises:
        InvalidInput: The plant or the controller is not supported.

    Attributes:
        law: The compiled law of the controller.
    """

    def __init__(self, plant: Plant, controller: Controller, *, keeps_logs: bool) -> None:
        self.law = compiled_law(controller)
        self._keeps_logs = keeps_logs
        self._original = BatchPlant(plant)
        self._wheels = self._original.wheels
        self._units = detail_units(controller)
        self._local = threading.local()
        loop = closed_loop(self._original.kernels, self.law.step)
        length = self.law.window.length
        one, none, poses = np.zeros(1), np.zeros(1, np.int64), np.zeros((1, 3))
        rows = np.zeros((length, 6))
        samples = SampleArrays(one, one, poses, rows, length, none, none, one, none)
        runs = self._arrays(1, 1, poses, np.zeros((1, 0, 3)))
        with announce_compiling():
            self._loop = entry_point(loop, *self._arguments(self._original, samples, runs), 0, 1)

    @property
    def log_columns(self) -> int:
        """Number of columns of a log; 0 if logs are not kept."""
        return LOG_COLUMNS + 3 * self._wheels + len(self._units) if self._keeps_logs else 0

    @property
    def forces(self) -> bool:
        """Whether the plant computes forces, so that logs contain torques and work."""
        return self._original.forces

    def simulate(self, runs: Sequence[BatchRun]) -> RunResults:
        """Simulate one or more runs; return their results in the same order.

        Consecutive runs with the same samples are simulated in one call of the kernel, unless the
        disturbances of the plant change.
        """
        done = [
            self._simulate(list(group)) for _, group in groupby(runs, lambda run: id(run.samples))
        ]
        figures = np.concatenate([each.figures for each in done])
        return RunResults(figures, [log for each in done for log in each.logs])

    def log(self, runs: Sequence[BatchRun]) -> LoopLogs:
        """Simulate runs with the same samples and without changing disturbances; keep their logs.

        Only for an object that keeps logs.
        """
        arrays = self._computed(runs)
        return LoopLogs(runs[0].samples.arrays, arrays.figures, arrays.logs, self._wheels)

    def _simulate(self, runs: list[BatchRun]) -> RunResults:
        samples = runs[0].samples
        if samples.changes and len(runs) > 1:
            done = [self._simulate([run]) for run in runs]
            figures = np.concatenate([each.figures for each in done])
            return RunResults(figures, [log for each in done for log in each.logs])
        arrays = self._computed(runs)
        return RunResults(arrays.figures, self._logs(samples, arrays))

    def _computed(self, runs: Sequence[BatchRun]) -> RunArrays:
        """Return the arrays of runs with the same samples; a single one if they have changes."""
        samples = runs[0].samples
        count = len(samples.arrays.times)
        draws = [run.noise.random((count, 3)) for run in runs if run.noise is not None]
        uniforms = np.array(draws) if draws else np.zeros((len(runs), 0, 3))
        starts = np.array([run.start for run in runs], dtype=float)
        arrays = self._arrays(len(runs), count, starts, uniforms)
        plant, begin = self._plant(), 0
        for k, disturbances in samples.changes:
            self._loop(*self._arguments(plant, samples.arrays, arrays), begin, k + 1)
            begin = k + 1
            if arrays.figures["end"][0] == 0:
                plant.apply(disturbances)
        self._loop(*self._arguments(plant, samples.arrays, arrays), begin, count)
        if samples.changes:
            plant.plant.reset(Pose(0.0, 0.0, 0.0))
        return arrays

    def _plant(self) -> BatchPlant:
        """Return the plant of this thread."""
        plant: BatchPlant | None = getattr(self._local, "plant", None)
        if plant is None:
            plant = self._local.plant = BatchPlant(self._original.plant)
        return plant

    def _arrays(self, runs: int, count: int, starts: Array, uniforms: Array) -> RunArrays:
        details, columns = len(self._units), self.log_columns
        floats = np.zeros(size_in_floats(self.law.memory))
        carried = np.zeros(runs, CARRIED)
        carried["estimate"] = starts
        return RunArrays(
            starts,
            uniforms,
            carried,
            np.zeros(1, MOTION),
            floats,
            views(self.law.memory, floats),
            np.full((runs, 2, details), np.nan),
            np.zeros(runs, FIGURES),
            np.empty((runs, count if columns else 0, columns)),
        )

    def _arguments(
        self, plant: BatchPlant, samples: SampleArrays, runs: RunArrays
    ) -> tuple[Any, ...]:
        return (
            plant.model, plant.initial, plant.state, self.law.data, samples, runs, self._wheels,
        )  # fmt: skip

    def _logs(self, samples: RunSamples, arrays: RunArrays) -> list[Run]:
        if not self._keeps_logs:
            return []
        return [
            run_of(
                log, figures, samples.arrays.times, self._wheels, self._units, samples.events,
                forces=self.forces,
            )
            for log, figures in zip(arrays.logs, arrays.figures, strict=True)
        ]  # fmt: skip


def compiled_law(controller: Controller) -> CompiledLaw:
    """Return the compiled law of a controller.

    Raises:
        InvalidInput: The controller has none, or a subclass overrides ``reset``, ``step`` or
            ``compute`` but not ``compiled_law``, so that the law differs from the controller.
    """
    kinds = type(controller).__mro__
    if isinstance(controller, CompilableController):
        owner = _first_with("compiled_law", kinds)
        changed = [
            name for name in ("reset", "step", "compute") if _first_with(name, kinds) < owner
        ]
        law = controller.compiled_law() if not changed else None
        if law is not None:
            return law
    raise InvalidInput(
        "a batch needs a controller with a compiled law (all of omnidrive but unicycle-nmpc have "
        f"one), got {kind_of(controller)}: use simulate for others, for PID with channels or "
        "tuners of your own, and for holonomic-nmpc with a deadline, another solver or moving "
        "keep-out zones"
    )


def detail_units(controller: Controller) -> dict[str, str]:
    """Return the unit of each detail of a controller's commands, by name; empty: no details."""
    if isinstance(controller, DetailedController):
        return dict(controller.detail_units)
    return {}


def _first_with(name: str, kinds: Iterable[type]) -> int:
    """Return the index of the first class that defines a name; the number of classes if none."""
    kinds = tuple(kinds)
    return next((i for i, kind in enumerate(kinds) if name in vars(kind)), len(kinds))
