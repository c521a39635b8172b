"""Cost of engine and store of studies, speed-up on two cores, rate of closed loops."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

from figures import at_least, at_most, publish, row
from known_work import unit_time

from omnidrive.evaluation.run_record import RunRecord
from omnidrive.scenario import paper_scenario
from omnidrive.scenario.run_settings import RunSettings
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.tasks import NoiseTask, Tasks
from omnidrive.study import parse_definition, run_study
from omnidrive.study.computation.experiment import Experiment
from omnidrive.study.design.planned_run import PlannedRun
from omnidrive.study.progress import NullProgress, RunProgress

EACH = 0.002  # s of processor time of a run of the benchmark of the engine
SECONDS = 8.0  # of work, after the first blocks
OVERHEAD, SPEED_UP = 5.0, 1.7  # %, 1
LOOPS = {"kinematic": (5.3, 4000), "planar": (0.54, 1000)}  # per unit of known work; number of runs


@dataclass(frozen=True)
class Spin:
    """Plan whose runs take a fixed processor time, and its computation."""

    count: int

    def __len__(self) -> int:
        return self.count

    def keys(self, start: int, stop: int) -> list[str]:
        return [sha256(str(number).encode()).hexdigest() for number in range(start, stop)]

    def __getitem__(self, number: int) -> PlannedRun:
        (key,) = self.keys(number, number + 1)
        return PlannedRun(
            number, key, number, {}, paper_scenario(), RunSettings("noise", "pid", 30.0)
        )

    def __call__(self, numbers: Sequence[int]) -> list[RunRecord]:
        return [self.record(number) for number in numbers]

    def record(self, number: int) -> RunRecord:
        """Return a record with as many metrics as a tracking run has."""
        until = process_time() + EACH
        while process_time() < until:
            pass
        metrics = {f"metric_{k}": number * 0.1**k for k in range(15)}
        factors = {"plant_robot.mass": 10.0, "sample_time": 0.1}
        (key,) = self.keys(number, number + 1)
        return RunRecord(
            number, key, number, "pid", "noise", number, factors, "finished", True, metrics,
            {"step_time_median": 3.0, "step_time_p99": 5.0},
        )  # fmt: skip


class Stopwatch(NullProgress):
    """Rate of runs between the first block of about a second and the last one."""

    def __init__(self, clock: Callable[[], float], skipped: int) -> None:
        self._clock, self._skipped = clock, skipped
        self._first: tuple[int, float] | None = None
        self._last = (0, 0.0)

    def runs(self, progress: RunProgress) -> None:
        now = progress.done, self._clock()
        if self._first is None and progress.done >= self._skipped:
            self._first = now
        self._last = now

    @property
    def rate(self) -> float:
        """Runs per second."""
        assert self._first is not None
        return (self._last[0] - self._first[0]) / (self._last[1] - self._first[1])


def spin_rate(processes: int) -> float:
    """Return runs per second of wall time in worker processes."""
    skipped = 1500 * processes
    count = skipped + round(processes * SECONDS / EACH)
    watch = Stopwatch(perf_counter, skipped)
    with TemporaryDirectory() as folder:
        experiment = Experiment(Spin(count), Spin(count), folder, "spin")
        experiment.execute(processes, report=watch.runs, in_process=False)
    return watch.rate


def engine_rows() -> list[dict[str, object]]:
    one, two = spin_rate(1), spin_rate(2)
    rows = [at_most("engine and store, blocks of 1 s", 100.0 / (one * EACH) - 100.0, "%", OVERHEAD)]
    if (os.cpu_count() or 1) > 1:
        rows.append(at_least("two processes against one", two / one, "1", SPEED_UP))
    return rows


def loop_rows(plant: str) -> list[dict[str, object]]:
    """Return closed loops of 30 s at 10 Hz of fuzzy_t1 per second, and per unit of known work."""
    target, count = LOOPS[plant]
    scenario = paper_scenario().with_values(
        plant=plant, controllers=("fuzzy_t1",), tasks=Tasks(noise=NoiseTask(durations=(30.0,)))
    )
    data = {"format": "omnidrive-study-1", "name": "loops", "repetitions": count}
    definition = parse_definition({**data, "scenario": scenario_data(scenario)}, "loops")
    watch = Stopwatch(process_time, count // 6)
    with TemporaryDirectory() as folder:
        run_study(definition, Path(folder) / "study", progress=watch, figures=())
    runs = watch.rate * unit_time()
    return [
        row(f"closed loops per second, {plant}", watch.rate, "1/s"),
        at_least(f"closed loops per unit of known work, {plant}", runs, "1", target),
    ]


def main() -> None:
    rows = [each for plant in LOOPS for each in loop_rows(plant)]
    publish("studies", [*engine_rows(), *rows, row("cores", os.cpu_count(), "1")])


if __name__ == "__main__":
    main()
