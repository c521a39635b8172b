"""Time of one call of `controller.step` of the recommended controller, and of the same with IPOPT.

The controller follows a figure eight on the plant `planar`, with and without the paper's noise.
Its states are recorded and given to every controller in the same order. With cold caches, another
process on the same processor core reads and writes an array of 32 MB between two calls. A time is
the wall-clock time of the whole Python call; that of a step is the median over the rounds, so that
calls which other programs interrupt do not count. N = 15, sample time 0.05 s.

The floor is what remains without a controller: a method that does nothing, a method that only calls
a kernel without statements, and one that also checks its arguments and makes a command of three
numbers.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from multiprocessing import get_context
from multiprocessing.connection import Connection
from time import perf_counter

import numpy as np
from figures import at_least, at_most, publish, row
from gauntlet_references import reference_of
from jaxtyping import Float
from known_work import unit_time

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, entry_point
from omnidrive.control import Command, Controller, Status
from omnidrive.control.components import (
    ControllerContext,
    HolonomicNmpcOptions,
    SolverName,
    holonomic_nmpc,
)
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference
from omnidrive.robot import named_robot
from omnidrive.simulation import PaperNoise, PlanarPlant, simulate

DT, ROUNDS = 0.05, 7
IPOPT_STEPS = 100  # in one round
WALKED = 32_000_000  # bytes
MEDIAN, P99 = 35.0, 150.0  # us; with warm caches, with cold ones
RATIO = 60.0

TimedState = tuple[float, State]


class Recorder:
    """A controller that records the times and states of its steps."""

    def __init__(self, controller: Controller) -> None:
        self.controller, self.dt = controller, controller.dt
        self.detail_units = controller.detail_units
        self.states: list[TimedState] = []

    def reset(self, state: State) -> None:
        self.controller.reset(state)

    def step(self, t: float, state: State, reference: Reference) -> Command:
        self.states.append((t, state))
        return self.controller.step(t, state, reference)


class Walker:
    """Another process on the processor core of this one; calls overwrite the caches."""

    def __init__(self) -> None:
        if hasattr(os, "sched_setaffinity"):  # Linux
            os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # the process inherits it
        context = get_context("spawn")
        self.connection, other = context.Pipe()
        context.Process(target=walk, args=(other,), daemon=True).start()
        self()

    def __call__(self) -> None:
        self.connection.send_bytes(b"walk")
        self.connection.recv_bytes()

    def close(self) -> None:
        """End the process."""
        self.connection.send_bytes(b"")


def walk(connection: Connection) -> None:
    """Read and write :data:`WALKED` bytes and answer, at every message until an empty one."""
    array = np.zeros(WALKED // 8)
    while message := connection.recv_bytes():
        array += 1.0
        connection.send_bytes(message)


def controller_of(robot: str, solver: SolverName) -> Controller:
    context = ControllerContext(named_robot(robot), DT, np.random.default_rng(0))
    return holonomic_nmpc(context, HolonomicNmpcOptions(solver=solver))


def recorded_states(robot: str, noisy: bool) -> list[TimedState]:
    recorder, reference = Recorder(controller_of(robot, "sqp")), reference_of("eight", robot)
    sensors = PaperNoise(np.random.default_rng(1)) if noisy else None
    plant, start = PlanarPlant(named_robot(robot)), reference.at(0.0).pose
    simulate(plant, recorder, reference, start=start, dt=DT, sensors=sensors)
    return recorder.states


def time_steps(
    controller: Controller | NoOp,
    states: list[TimedState],
    reference: Reference,
    before: Callable[[], None],
) -> list[float]:
    """Return the time of every step in us; ``before`` is called before each."""
    controller.reset(states[0][1])
    times = []
    for t, state in states:
        before()
        began = perf_counter()
        controller.step(t, state, reference)
        times.append(1e6 * (perf_counter() - began))
    return times


@compiled
def nothing(_: Float[Array, " 3"], __: float) -> None:
    """Do nothing."""


class NoOp:
    """A controller whose step does nothing."""

    def __init__(self) -> None:
        self.value = np.zeros(3)
        self.kernel = entry_point(nothing, self.value, 0.0)

    def reset(self, state: State) -> None:
        """Do nothing."""

    def step(self, t: float, state: State, reference: Reference) -> None:
        """Do nothing."""


class EmptyKernel(NoOp):
    """A controller whose step calls a kernel that does nothing."""

    def step(self, t: float, state: State, reference: Reference) -> None:
        """Call the kernel."""
        self.kernel(self.value, t)


class EmptyLaw(GuardedController, NoOp):
    """A guarded controller whose law does nothing."""

    def reset(self, state: State) -> None:
        """Do nothing."""

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Call the kernel, and make a command."""
        self.kernel(self.value, t)
        return Command(BodyTwist(*self.value.tolist()), Status.OK, (), "")


def floor_rows(walker: Walker) -> Iterator[dict[str, object]]:
    """Yield the times of controllers that compute nothing."""
    states, reference = recorded_states("paper", noisy=False), reference_of("eight", "paper")
    floors = {
        "no statement": NoOp(),
        "an empty kernel": EmptyKernel(),
        "checks, an empty kernel, a command": EmptyLaw(),
    }
    for name, floor in floors.items():
        for caches, before in {"warm": lambda: None, "cold": walker}.items():
            rounds = [time_steps(floor, states, reference, before) for _ in range(ROUNDS)]
            time = np.median(np.median(rounds, axis=0))
            yield row(f"floor: {name}, {caches} caches: median", time, "us")


def step_rows(robot: str, noisy: bool, walker: Walker) -> Iterator[dict[str, object]]:
    """Yield the times of one robot."""
    states, reference = recorded_states(robot, noisy), reference_of("eight", robot)
    ours, theirs = controller_of(robot, "sqp"), controller_of(robot, "casadi")
    name = f"{robot}, {'with' if noisy else 'without'} noise"
    medians, unit = {}, 1e6 * unit_time()
    for caches, before in {"warm": lambda: None, "cold": walker}.items():
        rounds = [time_steps(ours, states, reference, before) for _ in range(ROUNDS)]
        times = np.median(rounds, axis=0)
        medians[caches], p99 = np.median(times), np.percentile(times, 99)
        median_name, p99_name = (
            f"{name}, {caches} caches: {which}" for which in ("median", "99th percentile")
        )
        if caches == "warm":
            yield at_most(median_name, medians[caches], "us", MEDIAN)
            yield row(p99_name, p99, "us")
        else:
            yield row(median_name, medians[caches], "us")
            yield at_most(p99_name, p99, "us", P99)
    ipopt = np.median(time_steps(theirs, states[:IPOPT_STEPS], reference, walker))
    yield row(f"{name}, cold caches: IPOPT, median", ipopt, "us")
    yield at_least(f"{name}, cold caches: IPOPT over ours", ipopt / medians["cold"], "1", RATIO)
    yield row(f"{name}, warm caches: median per unit of known work", medians["warm"] / unit, "1")


def main() -> None:
    walker = Walker()
    rows = list(floor_rows(walker))
    for robot in ("paper", "small"):
        for noisy in (False, True):
            rows += step_rows(robot, noisy, walker)
    walker.close()
    publish("step", rows)


if __name__ == "__main__":
    main()
