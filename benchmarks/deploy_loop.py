"""The real-time loop: punctuality beside busy processors, equality with simulations, cost.

Beside a busy core: the loop is pinned to the last processor, and on each of the others runs a
process that only spins. The simulated robot has a process of its own, which may run on any
processor but that of the loop, so beside the spinning ones.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from math import ceil
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from figures import at_most, console, row

from omnidrive.cli.scenario_options import ScenarioOptions
from omnidrive.components import configure
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import MonotonicClock, SimulatedClock
from omnidrive.deploy.command_gate import CommandGate
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import DriveResult, drive
from omnidrive.deploy.latest_readings import LatestReadings
from omnidrive.deploy.links.simulated import SimulatedLink, SimulatedProcess
from omnidrive.deploy.realtime import realtime
from omnidrive.deploy.scenario_robot import ScenarioRobot, scenario_pipeline
from omnidrive.evaluation.measures.metrics import position_error
from omnidrive.reference import Reference
from omnidrive.scenario.planned_scenario import PlannedScenario, plan_and_check
from omnidrive.simulation import Run, simulate
from omnidrive.simulation.run_log import RunLog

LAP = 12.6  # s
SLOW, FAST = 100.0, 500.0  # Hz
JITTER = 1.0  # ms


class Durations(NamedTuple):
    """Durations of the drives, s."""

    slow: float = 600.0
    fast: float = 120.0
    equal: float = 30.0
    plain: float = 30.0


QUICK = Durations(20.0, 20.0, 10.0, 10.0)
DRIVES = 5  # of which the median error is compared: a machine that stalls changes some


class Case(NamedTuple):
    """A robot of the size of a shoe box on a circle of 1 m, simulated with wheel friction."""

    planned: PlannedScenario
    label: str
    reference: Reference

    @property
    def dt(self) -> float:
        """Sample time, s."""
        return self.planned.scenario.sample_time

    def robot(self) -> ScenarioRobot:
        """Return the function that makes plant and sensors, with the noise of the scenario."""
        return ScenarioRobot(self.planned)

    def pipeline(self) -> Pipeline:
        """Return a new pipeline."""
        return scenario_pipeline(self.planned, self.label)


def case(controller: str, rate: float, duration: float) -> Case:
    """Return the case of a controller, its rate, Hz, and a duration, s."""
    laps = ceil(duration / LAP)
    chosen = ScenarioOptions(
        reference=f"circle,radius=1,laps={laps}", robot="small", plant="planar",
        preset="recommended", estimator=True, seed=3,
    ).resolve()  # fmt: skip
    controllers = {controller: configure("controllers", controller)}
    changes = {"sample_time": 1.0 / rate, "controllers": controllers}
    planned = plan_and_check(chosen.model_copy(update=changes))
    return Case(planned, controller, planned.reference(LAP * laps))


def spin(cpu: int) -> None:
    """Use a processor for ever."""
    os.sched_setaffinity(0, {cpu})
    while True:
        pass


@contextmanager
def busy(cpus: set[int]) -> Iterator[None]:
    """Run a spinning process on each of some processors within the context."""
    context = get_context("spawn")
    processes = [context.Process(target=spin, args=(cpu,), daemon=True) for cpu in cpus]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


@contextmanager
def progress(name: str, duration: float) -> Iterator[None]:
    """Show the time that remains, every five seconds."""
    ended, began = threading.Event(), time.monotonic()

    def report() -> None:
        while not ended.wait(5.0):
            left = duration - (time.monotonic() - began)
            sys.stderr.write(f"\r{name}: {max(left, 0.0):.0f} s left   ")

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        sys.stderr.write("\r")


def driven(made: Case, cpu: int, name: str, *, beside: bool = True) -> DriveResult:
    """Drive in real time on one processor, and beside busy ones if ``beside``."""
    link = SimulatedProcess(
        made.planned.plant_robot, made.robot(), made.reference.at(0.0).pose, made.dt
    )
    others = os.sched_getaffinity(0) - {cpu} if beside else set()
    controls = DriveControls(arm=True)
    limit = threading.Timer(made.reference.duration + 60.0, controls.stop, ["it takes too long"])
    limit.start()  # a robot that was held would wait for ever
    with busy(others), progress(name, made.reference.duration + 3.0):
        result = drive(
            link,
            made.pipeline(),
            made.reference,
            rate=1.0 / made.dt,
            start=made.reference.at(0.0).pose,
            controls=controls,
            cpu=cpu,
        )
    limit.cancel()
    allowed = "; ".join(map(str, result.measures))
    console.print(f"{name}: {allowed}; {result.ending}", highlight=False)
    return result


def loop_rows(
    name: str, made: Case, cpu: int, max_missed: float
) -> tuple[list[dict[str, object]], DriveResult]:
    """Return the rows of the punctuality of a drive, and the drive."""
    result = driven(made, cpu, name)
    timing = result.timing.summary()
    fifo = any(m.name == "SCHED_FIFO" and not m.refusal for m in result.measures)
    name = f"{name}, {'SCHED_FIFO' if fifo else 'normal priority'}"
    limited = partial(at_most, target=JITTER) if fifo else row
    return [
        at_most(f"{name}: missed", 100.0 * timing.miss_share, "%", max_missed),
        limited(f"{name}: jitter p99", 1e3 * timing.jitter_p99, "ms"),
        row(f"{name}: jitter, largest", 1e3 * timing.jitter_max, "ms"),
        row(f"{name}: until the command is sent, median", 1e6 * timing.busy_median, "us"),
        row(f"{name}: until the command is sent, p99", 1e6 * timing.busy_p99, "us"),
    ], result


@contextmanager
def timed(parts: dict[str, tuple[type, str]]) -> Iterator[dict[str, list[float]]]:
    """Measure the calls of methods within the context; yield their times by part, us."""
    found: dict[str, list[float]] = {name: [] for name in parts}
    before = {name: getattr(cls, method) for name, (cls, method) in parts.items()}

    def wrapped(call: Callable[..., Any], times: list[float]) -> Callable[..., Any]:
        def measured(*arguments: Any, **more: Any) -> Any:
            began = time.perf_counter_ns()
            try:
                return call(*arguments, **more)
            finally:
                times.append(1e-3 * (time.perf_counter_ns() - began))

        return measured

    for name, (cls, method) in parts.items():
        setattr(cls, method, wrapped(before[name], found[name]))
    try:
        yield found
    finally:
        for name, (cls, method) in parts.items():
            setattr(cls, method, before[name])


def cost_rows(name: str, made: Case, cpu: int) -> list[dict[str, object]]:
    """Return the median cost of a sample and of its parts, in a drive in real time."""
    pipeline = made.pipeline()
    parts = {
        "read": (SimulatedProcess, "read"),
        "align": (LatestReadings, "at"),
        "estimate": (type(pipeline.estimator), "update"),
        "supervise": (type(pipeline.supervisor), "check"),
        "control": (type(pipeline.controller), "step"),
        "gate": (CommandGate, "passed"),
        "send": (SimulatedProcess, "send"),
        "log": (RunLog, "add"),
    }
    with timed(parts) as found:
        result = driven(made, cpu, f"{name}: cost")
    whole = 1e6 * result.timing.summary().busy_median
    medians = {part: float(np.median(times)) for part, times in found.items() if times}
    rows = [row(f"{name}: {part}", value, "us") for part, value in medians.items()]
    rows.append(row(f"{name}: the rest of a sample", whole - sum(medians.values()), "us"))
    return rows


def simulated(made: Case) -> Run:
    """Return the simulation of a case, at once."""
    robot, pipeline = made.robot()(), made.pipeline()
    return simulate(
        robot.plant,
        pipeline.controller,
        made.reference,
        start=made.reference.at(0.0).pose,
        dt=made.dt,
        sensors=robot.sensors,
        estimator=pipeline.estimator,
        supervisor=pipeline.supervisor,
    )


def equality_rows(made: Case, cpu: int) -> list[dict[str, object]]:
    """Return the differences between a simulation and drives on a simulated and a real clock."""
    expected = simulated(made)
    link = SimulatedLink(made.robot()(), made.reference.at(0.0).pose)
    same = drive(
        link, made.pipeline(), made.reference,
        rate=1.0 / made.dt, start=link.start, clock=SimulatedClock(),
    )  # fmt: skip
    commands = same.run.command[:-1], expected.command[:-1]
    name = f"simulated and driven at {1.0 / made.dt:g} Hz"
    real = [driven(made, cpu, f"{name}, {k + 1}", beside=False).run for k in range(DRIVES)]
    errors = [mean_error(run) for run in real]
    median, simulated_error = float(np.median(errors)), mean_error(expected)
    return [
        at_most(f"{name}: difference of commands, simulated clock",
                float(np.abs(commands[0] - commands[1]).max()), "m/s", 1e-9),
        at_most(f"{name}: difference of ME, real time, median of {DRIVES} drives",
                100.0 * abs(median / simulated_error - 1.0), "%", 5.0),
        row(f"{name}: ME simulated", 1e3 * simulated_error, "mm"),
        row(f"{name}: ME in real time, median", 1e3 * median, "mm"),
        row(f"{name}: ME in real time, largest", 1e3 * max(errors), "mm"),
    ]  # fmt: skip


def mean_error(run: Run) -> float:
    """Return the mean position error of the estimate, which is all that a robot knows, m."""
    return float(position_error(run.measured, run.target).mean())


def stall_rows(cpu: int, duration: float) -> list[dict[str, object]]:
    """Return how often the machine does not run a loop that only sleeps, with the loop's measures.

    Such stalls, for example of a virtual machine, are part of every figure below.
    """
    clock, late = MonotonicClock(), []
    with realtime(cpu=cpu):
        due, end = time.monotonic(), time.monotonic() + duration
        while due < end:
            clock.sleep_until(due)
            late.append(time.monotonic() - due)
            due = max(due + 1e-3, time.monotonic())
    stalls = np.array(late)
    return [
        row("machine: stalls over 10 ms of a loop that only sleeps",
            float(np.sum(stalls > 0.01)) * 60.0 / duration, "per minute"),
        row("machine: longest stall", 1e3 * float(stalls.max()), "ms"),
    ]  # fmt: skip


def plain_loop(made: Case, cpu: int, duration: float) -> np.ndarray:
    """Return the errors of the periods, ms, of a loop that sleeps for the sample time.

    It reads, steps the pipeline and sends, as a user would write it, beside busy processors.
    """
    start = made.reference.at(0.0).pose
    link = SimulatedProcess(made.planned.plant_robot, made.robot(), start, made.dt)
    pipeline, dt = made.pipeline(), made.dt
    pipeline.prepare()
    pipeline.reset(start)
    before = os.sched_getaffinity(0)
    link.open(MonotonicClock())
    begins = []
    try:
        os.sched_setaffinity(0, {cpu})
        with busy(before - {cpu}):
            begin = time.monotonic()
            while (now := time.monotonic()) < begin + duration:
                begins.append(now)
                readings = link.read()
                if readings is not None:
                    fixes = tuple(f._replace(stamp=f.stamp - begin) for f in readings.fixes)
                    readings = readings._replace(stamp=now - begin, fixes=fixes)
                    step = pipeline.step(now - begin, readings, made.reference, dt)
                    link.send(step.command.value)
                time.sleep(dt)
    finally:
        link.close()
        os.sched_setaffinity(0, before)
    return 1e3 * np.abs(np.diff(begins) - dt)


def plain_rows(made: Case, cpu: int, duration: float, result: DriveResult):
    """Return the jitter of the periods of a plain loop and of a drive, and their ratio."""
    plain = float(np.percentile(plain_loop(made, cpu, duration), 99))
    ours = 1e3 * float(np.percentile(np.abs(np.diff(result.timing.lateness)), 99))
    name = f"periods at {1.0 / made.dt:g} Hz, error p99"
    return [
        row(f"{name}, plain loop of time.sleep", plain, "ms"),
        row(f"{name}, loop", ours, "ms"),
        row(f"{name}, plain over loop", plain / ours, "1"),
    ]


def rows(durations: Durations) -> list[dict[str, object]]:
    """Return the rows of the table."""
    cpu = max(os.sched_getaffinity(0))
    slow = case("holonomic-nmpc", SLOW, durations.slow)
    fast = case("feedforward", FAST, durations.fast)
    found = stall_rows(cpu, 2.0 * durations.plain)
    loop, result = loop_rows("loop at 100 Hz, holonomic-nmpc", slow, cpu, 0.1)
    found += loop + plain_rows(slow, cpu, durations.plain, result)
    found += loop_rows("loop at 500 Hz, feedforward", fast, cpu, 0.5)[0]
    found += equality_rows(case("holonomic-nmpc", SLOW, durations.equal), cpu)
    found += equality_rows(case("holonomic-nmpc", 20.0, durations.equal), cpu)
    found += cost_rows("100 Hz, holonomic-nmpc", case("holonomic-nmpc", SLOW, LAP), cpu)
    return found + cost_rows("500 Hz, feedforward", case("feedforward", FAST, LAP), cpu)
