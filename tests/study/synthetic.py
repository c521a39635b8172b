"""Plans whose runs are computed in no time, for tests of store and engine."""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass, field
from hashlib import sha256
from math import nan
from pathlib import Path
from time import sleep

import pyarrow as pa

from omnidrive.evaluation.run_record import RunRecord
from omnidrive.scenario.run_settings import RunSettings
from omnidrive.study.computation.run_recording import relabelled
from omnidrive.study.design.planned_run import PlannedRun
from tests.study.small import small_scenario

CONTROLLERS = ("pid", "fuzzy_t1", "fuzzy_t2")
SCENARIO = small_scenario(controllers=("feedforward",))


@dataclass
class SyntheticPlan:
    """Plan of ``count`` runs, of which every ``period`` runs have the same keys."""

    count: int
    period: int = 10**9
    asked: list[int] = field(default_factory=list)
    """Numbers of the runs that were planned."""

    def __len__(self):
        return self.count

    def keys(self, start, stop):
        return [sha256(f"{n % self.period}".encode()).hexdigest() for n in range(start, stop)]

    def __getitem__(self, number):
        self.asked.append(number)
        repetition, index = divmod(number, len(CONTROLLERS))
        job = RunSettings("track", CONTROLLERS[index], 20.0, repeat=repetition)
        factors = {"plant_robot.mass": 10.0 + 0.1 * repetition, "sample_time": 0.1}
        (key,) = self.keys(number, number + 1)
        return PlannedRun(number, key, repetition, factors, SCENARIO, job, repetition)


def record(run):
    """Return the record of a run; its values depend on the key only."""
    value = int(run.key[:12], 16) / 16**12
    metrics = {"me": value, "arrival": nan if value < 0.1 else 20.0, "tiny": value * 1e-300}
    outcome = "controller_failed" if value > 0.95 else "finished"
    empty = RunRecord(
        -1, run.key, -1, "", "", 0, {}, outcome, outcome == "finished", metrics,
        {"step_time_median": 3.0}, "" if outcome == "finished" else "at 3 s: it failed\nTraceback",
    )  # fmt: skip
    return relabelled(empty, run)


def table_bytes(table):
    """Return a table as bytes; NaN is equal to itself."""
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table.combine_chunks())
    return sink.getvalue().to_pybytes()


@dataclass(frozen=True)
class Compute:
    """Computation of records; it notes which runs it computes."""

    plan: SyntheticPlan
    noted: Path | None = None
    seconds: float = 0.0
    """Time of each run, s."""
    killing: tuple[int, ...] = ()
    """Runs that kill their process."""

    def __call__(self, numbers):
        found = []
        for number in numbers:
            if self.noted:
                with self.noted.open("a") as file:
                    file.write(f"{number}\n")
            if number in self.killing:
                os.kill(os.getpid(), signal.SIGKILL)
            sleep(self.seconds)
            found.append(record(self.plan[number]))
        return found
