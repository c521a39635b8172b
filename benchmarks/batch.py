"""Closed loops of 30 s at 10 Hz per second and core in a batch, and their ratio to `simulate`.

All runs follow a figure eight with the paper's noise. Rates are runs per second of processor time
of one thread, and runs in the time of a unit of known work, to compare them between machines; the
ratio of two threads is that of wall-clock times, and needs two idle cores. All are medians; plants,
controllers and both ways alternate. The time to compile a loop on its first use is the processor
time in a new process with an empty cache, without that of the plant's and the controller's own
steps.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from itertools import repeat
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np
from figures import at_least, publish, row
from known_work import unit_time

from omnidrive.control import Controller, FeedforwardController, holonomic_nmpc
from omnidrive.control.nmpc.holonomic import Actuation
from omnidrive.control.pid import classical_pid, fuzzy_pid
from omnidrive.reference import Eight, ShapeReference
from omnidrive.robot import named_robot
from omnidrive.simulation import (
    KinematicPlant,
    PaperNoise,
    PlanarPlant,
    Plant,
    simulate,
    simulate_batch,
)

DT, DURATION = 0.1, 30.0  # s
ROUNDS = 7
ROBOT = named_robot("paper")
PLANTS: dict[str, Callable[[], Plant]] = {
    "kinematic": lambda: KinematicPlant(ROBOT),
    "planar": lambda: PlanarPlant(ROBOT),
}
CONTROLLERS: dict[str, Callable[[], Controller]] = {
    "feedforward": lambda: FeedforwardController(DT),
    "pid": lambda: classical_pid("recommended", DT, ROBOT),
    "fuzzy_t1": lambda: fuzzy_pid("t1", "recommended", DT, ROBOT),
    "fuzzy_t2": lambda: fuzzy_pid("t2", "recommended", DT, ROBOT),
    "fuzzy_t3": lambda: fuzzy_pid("t3", "recommended", DT, ROBOT),
    "holonomic-nmpc": lambda: holonomic_nmpc(ROBOT.chassis, DT, actuation=Actuation.of(ROBOT)),
}
TARGETS = {
    ("kinematic", "fuzzy_t1"): 6.1,
    ("planar", "fuzzy_t1"): 0.62,
    ("planar", "holonomic-nmpc"): 0.29,
}
"""Least number of runs in the time of a unit of known work: 0.9 of those measured."""
RUNS = {"kinematic": 160, "planar": 32}  # per round; a tenth for fuzzy_t3
THREADS_TARGET = 1.7
"""Least ratio of the rates of two threads and of one."""

REFERENCE = ShapeReference(Eight(), DURATION)

COMPILATION = """
from time import process_time
import sys
sys.path.insert(0, sys.argv[1])
import batch
from omnidrive.simulation.batch.closed_loops import ClosedLoops
plant, controller = batch.PLANTS[sys.argv[2]](), batch.CONTROLLERS[sys.argv[3]]()
batch.simulate(plant, controller, batch.REFERENCE, start=batch.START, dt=batch.DT)
began = process_time()
ClosedLoops(plant, controller, keeps_logs=False)
print(process_time() - began)
"""

START = REFERENCE.at(0.0).pose


def rate_in_batch(plant: str, controller: str, runs: int) -> float:
    """Return runs per second of processor time with one thread."""
    began = process_time()
    run_batch(plant, controller, runs, 1)
    return runs / (process_time() - began)


def run_batch(plant: str, controller: str, runs: int, threads: int) -> None:
    for _ in simulate_batch(
        PLANTS[plant](),
        CONTROLLERS[controller](),
        repeat(REFERENCE, runs),
        dt=DT,
        sensors=PaperNoise,
        threads=threads,
    ):
        pass


def rate_alone(plant: str, controller: str) -> float:
    """Return the same for one run with ``simulate``."""
    parts = PLANTS[plant](), CONTROLLERS[controller]()
    noise = PaperNoise(np.random.default_rng(0))
    began = process_time()
    simulate(*parts, REFERENCE, start=START, dt=DT, sensors=noise)
    return 1.0 / (process_time() - began)


def rate_rows() -> list[dict[str, object]]:
    """Return the rates, and their ratios to those of ``simulate``."""
    pairs = [(plant, controller) for plant in PLANTS for controller in CONTROLLERS]
    rates: dict[tuple[str, str], list[tuple[float, float, float]]] = {pair: [] for pair in pairs}
    for _ in range(1 + ROUNDS):
        for plant, controller in pairs:
            runs = RUNS[plant] // (10 if controller == "fuzzy_t3" else 1)
            unit = unit_time()
            rate = rate_in_batch(plant, controller, runs)
            alone = rate_alone(plant, controller)
            rates[plant, controller].append((rate, rate * unit, rate / alone))
    rows = []
    for pair, found in rates.items():
        rate, runs, ratio = (median(each) for each in zip(*found[1:], strict=True))  # when warm
        name = " / ".join(pair)
        rows.append(row(f"runs per second and core: {name}", rate, "1/s"))
        per_unit = f"runs per unit of known work: {name}"
        rows.append(
            at_least(per_unit, runs, "1", TARGETS[pair])
            if pair in TARGETS
            else row(per_unit, runs, "1")
        )
        rows.append(row(f"ratio to simulate: {name}", ratio, "1"))
    return rows


def thread_rows() -> list[dict[str, object]]:
    """Return the ratios of the rates of two threads and of one."""
    rows = []
    for plant in PLANTS:
        ratios = []
        for _ in range(1 + ROUNDS):
            seconds = []
            for threads in (1, 2):
                began = perf_counter()
                run_batch(plant, "fuzzy_t1", 4 * RUNS[plant], threads)
                seconds.append(perf_counter() - began)
            ratios.append(seconds[0] / seconds[1])
        name = f"two threads over one: {plant} / fuzzy_t1"
        rows.append(at_least(name, median(ratios[1:]), "1", THREADS_TARGET))
    return rows


def compilation_rows() -> list[dict[str, object]]:
    """Return the processor time to compile a loop, s."""
    rows = []
    for plant in PLANTS:
        for controller in ("feedforward", "fuzzy_t1", "holonomic-nmpc"):
            with TemporaryDirectory() as folder:
                done = subprocess.run(
                    [sys.executable, "-c", COMPILATION, sys.path[0], plant, controller],
                    env={**os.environ, "NUMBA_CACHE_DIR": folder},
                    capture_output=True,
                    text=True,
                    check=True,
                )
            rows.append(row(f"compilation: {plant} / {controller}", float(done.stdout), "s"))
    return rows


def main() -> None:
    publish("batch", [*rate_rows(), *thread_rows(), *compilation_rows()])


if __name__ == "__main__":
    main()
