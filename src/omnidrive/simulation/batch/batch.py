"""Batches of closed loops, the results of which are streamed."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import repeat
from numbers import Integral

import numpy as np

from omnidrive.control import Controller, Pipeline
from omnidrive.control.controller import check_controller
from omnidrive.errors import InvalidInput, kind_of, short_repr
from omnidrive.estimation.state import check_start
from omnidrive.geometry import Pose, check_heading
from omnidrive.parameter import check_sample_time
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.simulation.batch.closed_loops import BatchRun, ClosedLoops, RunResults
from omnidrive.simulation.batch.results import BatchResults
from omnidrive.simulation.batch.run_samples import RunSamples, Sampler
from omnidrive.simulation.disturbances import Schedule
from omnidrive.simulation.plant import Plant
from omnidrive.simulation.sensors import PaperNoise, PerfectSensors

_PART_RUNS, _PART_SAMPLES = 16, 100_000  # most runs and samples that a thread takes at once
_BLOCK_FLOATS = 8_000_000  # of setpoints and logs, with which a block ends early


def run_generators(seed: int, run: int) -> tuple[np.random.Generator, np.random.Generator]:
    """Return the generators of the sensor noise and of the jitter of one run of a batch.

    They are counter-based (Philox: Salmon et al., "Parallel random numbers: as easy as 1, 2, 3",
    2011) with seed and run as their key, so that no run depends on another. With these generators,
    ``simulate`` computes the same run.

    Args:
        seed: Seed of the batch, 0 to 2^64 - 1.
        run: Number of the run in the batch.
    """
    return _generator(seed, run, 0), _generator(seed, run, 1)


def _generator(seed: int, run: int, stream: int) -> np.random.Generator:
    key = np.array([seed, run], np.uint64)
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, 0, stream]))


def simulate_batch(
    plant: Plant,
    controller: Controller,
    references: Iterable[Reference],
    *,
    dt: float,
    starts: Iterable[Pose] | None = None,
    sensors: type[PerfectSensors] | None = None,
    schedule: Schedule | Iterable[Schedule | None] | None = None,
    seed: int = 0,
    first: int = 0,
    threads: int = 1,
    block: int = 256,
    logs: bool = False,
) -> Iterator[BatchResults]:
    """Simulate closed loops in compiled code; yield their results, block by block.

    Run i is the run that ``simulate`` computes for reference i with the latest pose fix as the
    state estimate. It depends neither on other runs nor on threads and blocks, so that a batch can
    be split anywhere. The memory does not grow with the number of runs: references and starts are
    consumed as they are needed. ``itertools.repeat(reference, 1000)`` is a thousand runs on one
    reference.

    Supported are the plants ``kinematic`` and ``planar``; the controllers with a
    :class:`~omnidrive.control.compiled_law.CompiledLaw`, which are those of this package but
    ``unicycle-nmpc``; exact poses and :class:`PaperNoise`; all faults that the plant accepts. The
    first use of a plant with a controller compiles their loop.

    Args:
        plant: The simulated robot; it is not changed.
        controller: The controller; it is not changed.
        references: The motion to track, of each run.
        dt: Sample time, s.
        starts: Pose at t = 0, at rest, of each run; by default the first pose of its reference.
        sensors: ``PaperNoise``, the class, or None for exact poses.
        schedule: Faults and their times, of all runs or of each run.
        seed: Seed of noise and jitter, see :func:`run_generators`.
        first: Number of the first run, of a batch that is split.
        threads: Number of threads.
        block: Number of runs whose results are yielded together; fewer if they are very long.
        logs: Whether the logs of the runs are kept.

    Raises:
        InvalidInput: A part is not supported, a number is out of range or, when its run is reached,
            a reference, a start or a fault is one that ``simulate`` refuses.
    """
    check_sample_time(dt)
    _check_counts(threads=(threads, 1), block=(block, 1), first=(first, 0), seed=(seed, 0))
    _check_parts(plant, controller, dt)
    is_noisy = _is_noisy(sensors)
    inputs = _inputs(references, starts, schedule)
    loops = ClosedLoops(plant, controller, keeps_logs=logs)
    maker = _RunMaker(Sampler(dt, loops.law.window, controller), is_noisy, loops.forces, seed)
    runs = (maker.run(number, *each) for number, each in enumerate(inputs, first))
    return _stream(loops, runs, first, threads, block)


def _check_counts(**counts: tuple[int, int]) -> None:
    """Raise InvalidInput unless each value is a whole number from its least on."""
    for name, (value, minimum) in counts.items():
        if not (isinstance(value, Integral) and minimum <= value < 2**64):
            raise InvalidInput(
                f"{name} must be a whole number from {minimum}, got {short_repr(value)}"
            )


def _check_parts(plant: object, controller: object, dt: float) -> None:
    """Raise InvalidInput for other objects than a plant and a controller for ``dt`` (s)."""
    if isinstance(plant, Robot):
        raise InvalidInput(
            "a batch of closed loops starts with a plant; a batch of given commands, without "
            "controller, is simulate_commands(robot, starts, commands, dt)"
        )
    if isinstance(controller, Pipeline):
        raise InvalidInput(
            "a batch takes a controller, not a pipeline: its state estimate is the latest pose fix "
            "(LatestFix), and it has no supervisor; use simulate for others"
        )
    check_controller(controller, dt)


def _is_noisy(sensors: object) -> bool:
    """Return whether the poses have noise."""
    if sensors is PaperNoise:
        return True
    if sensors is None or sensors is PerfectSensors:
        return False
    raise InvalidInput(
        "a batch simulates exact poses (sensors=None) and the paper's noise (sensors=PaperNoise, "
        f"the class), got {short_repr(sensors, 60)}: use simulate for other sensors"
    )


def _inputs(
    references: Iterable[Reference],
    starts: Iterable[Pose] | None,
    schedule: Schedule | Iterable[Schedule | None] | None,
) -> Iterator[tuple[Reference, Pose | None, Schedule | None]]:
    """Return reference, start and faults of each run."""
    for name, given in (("references", references), ("starts", starts)):
        if given is not None and (not isinstance(given, Iterable) or isinstance(given, Pose)):
            raise InvalidInput(
                f"{name} must be a sequence, one for each run, got {kind_of(given)}: for the same "
                "in every run pass itertools.repeat(it, number of runs)"
            )
    if schedule is None or isinstance(schedule, Schedule):
        schedules: Iterable[Schedule | None] = repeat(schedule)
    else:
        schedules = schedule
    poses: Iterable[Pose | None] = repeat(None) if starts is None else starts
    return _zip(references, iter(poses), iter(schedules))


def _zip(
    references: Iterable[Reference],
    starts: Iterator[Pose | None],
    schedules: Iterator[Schedule | None],
) -> Iterator[tuple[Reference, Pose | None, Schedule | None]]:
    for number, reference in enumerate(references):
        try:
            yield reference, next(starts), next(schedules)
        except StopIteration:
            raise InvalidInput(
                f"there are more references than starts or schedules, which end after {number}"
            ) from None


class _RunMaker:
    """Maker of the runs of a batch, with the checks of ``simulate``."""

    def __init__(self, sampler: Sampler, is_noisy: bool, has_forces: bool, seed: int) -> None:
        self._sampler, self._is_noisy, self._has_forces = sampler, is_noisy, has_forces
        self._seed = seed

    def run(
        self, number: int, reference: Reference, start: Pose | None, schedule: Schedule | None
    ) -> BatchRun:
        """Return the run with a number."""
        try:
            return self._run(number, reference, start, schedule)
        except InvalidInput as error:
            raise InvalidInput(f"run {number}: {error}") from None

    def _run(
        self, number: int, reference: Reference, start: Pose | None, schedule: Schedule | None
    ) -> BatchRun:
        if schedule is not None and not self._has_forces:
            refused = set(schedule.plant_faults) - {"pose-jump"}
            if refused:
                raise InvalidInput(
                    f"the plant kinematic has no forces, so no {', '.join(sorted(refused))}: it "
                    "accepts pose-jump and the faults of sensors and timing; use the plant planar"
                )
        samples = self._sampler.samples(
            reference, schedule, lambda: _generator(self._seed, number, 1)
        )
        pose = self._checked_start(samples, start)
        noise = _generator(self._seed, number, 0) if self._is_noisy else None
        return BatchRun(samples, pose, noise)

    @staticmethod
    def _checked_start(samples: RunSamples, start: Pose | None) -> Pose:
        target = Pose(*samples.arrays.targets[0].tolist())
        if start is not None and not isinstance(start, Pose):
            raise InvalidInput(f"the start is {kind_of(start)}: pass Pose(x, y, yaw), in m, m, rad")
        pose = target if start is None else start
        check_start(pose)
        check_heading("the start's heading", pose.yaw)
        if np.isfinite(target.yaw):
            check_heading("the reference's heading at its start", target.yaw)
        return pose


def _stream(
    loops: ClosedLoops, runs: Iterator[BatchRun], first: int, threads: int, block: int
) -> Iterator[BatchResults]:
    """Yield the results, block by block; with threads, some blocks are computed ahead."""
    blocks = _blocks(runs, block, loops.log_columns)
    if threads == 1:
        for each in blocks:
            yield _joined(first, [loops.simulate(part) for part in _parts(each)])
            first += len(each)
        return
    ahead = 1 + 2 * threads * _PART_RUNS // block
    pool = ThreadPoolExecutor(threads)
    waiting: deque[list[Future[RunResults]]] = deque()
    try:
        for each in blocks:
            waiting.append([pool.submit(loops.simulate, part) for part in _parts(each)])
            if len(waiting) > ahead:
                results = _joined(first, [future.result() for future in waiting.popleft()])
                yield results
                first += len(results.me)
        while waiting:
            results = _joined(first, [future.result() for future in waiting.popleft()])
            yield results
            first += len(results.me)
    finally:
        pool.shutdown(cancel_futures=True)


def _blocks(runs: Iterable[BatchRun], maximum: int, columns: int) -> Iterator[list[BatchRun]]:
    """Yield consecutive runs whose results are yielded together.

    Args:
        runs: The runs.
        maximum: Most runs of a block.
        columns: Columns of a log.
    """
    block: list[BatchRun] = []
    known: set[int] = set()
    floats = 0
    for run in runs:
        block.append(run)
        arrays = run.samples.arrays
        floats += columns * len(arrays.times)
        if id(run.samples) not in known:
            known.add(id(run.samples))
            floats += arrays.setpoints.size
        if len(block) == maximum or floats >= _BLOCK_FLOATS:
            yield block
            block, known, floats = [], set(), 0
    if block:
        yield block


def _parts(runs: Sequence[BatchRun]) -> Iterator[list[BatchRun]]:
    """Yield consecutive runs that a thread simulates in one task."""
    part: list[BatchRun] = []
    samples = 0
    for run in runs:
        part.append(run)
        samples += len(run.samples.arrays.times)
        if len(part) == _PART_RUNS or samples >= _PART_SAMPLES:
            yield part
            part, samples = [], 0
    if part:
        yield part


def _joined(first: int, parts: Sequence[RunResults]) -> BatchResults:
    figures = np.concatenate([part.figures for part in parts])
    return BatchResults.of(first, figures, [log for part in parts for log in part.logs])
