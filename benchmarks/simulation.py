"""Speed of the plants, their response to commands, and their differences from mujoco-rollers.

Real-time factors are simulated seconds per second of the thread's processor time, hence per core.
They are medians; the plants alternate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from statistics import median
from time import thread_time

import numpy as np
from figures import at_least, at_most, publish, row
from rich.console import Console
from rich.table import Table
from s_path import SPath

from omnidrive.control import FeedforwardController
from omnidrive.geometry import BodyTwist, Pose, twist_between
from omnidrive.robot import ROBOTS, Robot
from omnidrive.scenario import make_plant
from omnidrive.simulation import MujocoPlant, Plant, identify_lag, simulate, simulate_commands

ORIGIN = Pose(0.0, 0.0, 0.0)
PLANTS = ("mujoco-rollers", "mujoco-balls", "planar", "kinematic")
FACTORS = {
    "mujoco-rollers": 25.0,
    "mujoco-balls": 250.0,
    "planar": 1000.0,
    "kinematic": 10_000.0,
}
ROUNDS = 5
SECONDS = {
    "mujoco-rollers": 2.0,
    "mujoco-balls": 6.0,
    "planar": 60.0,
    "kinematic": 200.0,
}  # per round
CURVE = BodyTwist(0.5, 0.2, 0.6)
BATCH = (20, 100)  # runs, commands

FRICTIONS = (0.8, 0.1)
STEADY = (BodyTwist(0.5, 0.0, 0.0), BodyTwist(0.0, 0.5, 0.0), BodyTwist(0.0, 0.0, 1.0))
SETTLING, DURATION, SAMPLE = 2.5, 4.0, 0.01  # s
START = BodyTwist(1.0, 0.0, 0.0)  # commanded at once, from rest
START_DURATION = 2.0  # s

LIMITS = {0.8: 1.2, 0.1: 1.0}  # cm, difference of planar from mujoco-rollers on an S-shaped path
CONTROL = 0.05  # s
PHASES = 3  # number of other initial roller angles

console = Console(width=120)


def speed_rows() -> Iterator[dict[str, object]]:
    """Yield real-time factors: steps of 0.1 s; for planar also of 0.02 s and in a batch."""
    tasks: dict[tuple[str, str, str], Callable[[], float]] = {}
    for robot in ROBOTS.values():
        for name in PLANTS:
            plant, seconds = make_plant(robot, name), SECONDS[name]
            tasks[robot.name, name, "0.1 s"] = lambda p=plant, s=seconds: speed_of_steps(p, s, 0.1)
        planar = make_plant(robot, "planar")
        tasks[robot.name, "planar", "0.02 s"] = lambda p=planar: speed_of_steps(p, 20.0, 0.02)
        tasks[robot.name, "planar", "a batch"] = lambda r=robot: speed_of_batch(r)
    factors: dict[tuple[str, str, str], list[float]] = {key: [] for key in tasks}
    for _ in range(1 + ROUNDS):
        for key, task in tasks.items():
            factors[key].append(task())
    for (robot_name, name, how), values in factors.items():
        title, value = (
            f"real-time factor: {name}, {robot_name}, {how}",
            median(values[1:]),
        )  # the first round is a warm-up
        yield (
            at_least(title, value, "1", FACTORS[name])
            if name in FACTORS
            else row(title, value, "1")
        )


def speed_of_steps(plant: Plant, seconds: float, dt: float) -> float:
    plant.reset(ORIGIN)
    start = thread_time()
    for _ in range(round(seconds / dt)):
        plant.step(CURVE, dt)
    return seconds / (thread_time() - start)


def speed_of_batch(robot: Robot) -> float:
    runs, steps = BATCH
    starts, commands = np.zeros((runs, 3)), np.tile(np.array(CURVE), (runs, steps, 1))
    start = thread_time()
    simulate_commands(robot, starts, commands, 0.1)
    return runs * steps * 0.1 / (thread_time() - start)


def velocity_rows() -> Iterator[dict[str, object]]:
    """Yield and print errors of the velocity for every robot, plant and friction."""
    titles = ("robot", "plant", "friction", "bias mm/s", "mrad/s", "ripple mm/s", "mrad/s",
              "slip cm", "lag ms", "yaw ms")  # fmt: skip
    names = ("bias", "yaw bias", "ripple", "yaw ripple", "slip", "lag", "yaw lag")
    units = ("mm/s", "mrad/s", "mm/s", "mrad/s", "cm", "ms", "ms")
    table = Table(*titles, title="Realised and commanded velocity")
    for robot in ROBOTS.values():
        for name in PLANTS:
            for friction in FRICTIONS if name != "kinematic" else FRICTIONS[:1]:
                plant = make_plant(replace(robot, friction=friction), name)
                figures = (*steady(plant), slip(plant), *lags(plant))
                table.add_row(robot.name, name, f"{friction:g}", *(f"{v:.2f}" for v in figures))
                for title, value, unit in zip(names, figures, units, strict=True):
                    yield row(f"{title}: {name}, {robot.name}, friction {friction:g}", value, unit)
    console.print(table)


def steady(plant: Plant) -> tuple[float, float, float, float]:
    """Return bias and ripple of steady motion, the largest of three directions; mm/s and mrad/s.

    Bias is the mean velocity between poses minus the commanded one, and ripple the standard
    deviation of the velocity in samples of 10 ms. The robot accelerates for two seconds.
    """
    biases, ripples = [], []
    for command in STEADY:
        plant.reset(ORIGIN)
        for k in range(round(2.0 / 0.05)):
            plant.step(BodyTwist(*(v * k / 40.0 for v in command)), 0.05)
        before = plant.step(command, SETTLING - 2.0).pose
        states = [plant.step(command, SAMPLE) for _ in range(round(DURATION / SAMPLE))]
        poses = [before, *(state.pose for state in states)]
        realised = np.array([twist_between(a, b, SAMPLE) for a, b in pairwise(poses)])
        biases.append(np.abs(realised.mean(axis=0) - command))
        ripples.append(realised.std(axis=0))
    figures = []
    for each in (biases, ripples):
        largest = 1e3 * np.max(each, axis=0)
        figures += [float(largest[:2].max()), float(largest[2])]
    return figures[0], figures[1], figures[2], figures[3]


def slip(plant: Plant) -> float:
    """Return the lag in position two seconds after a command of 1 m/s from rest, cm."""
    plant.reset(ORIGIN)
    for _ in range(round(START_DURATION / 0.1)):
        state = plant.step(START, 0.1)
    return 100.0 * (START.vx * START_DURATION - state.pose.x)


def lags(plant: Plant) -> tuple[float, float]:
    """Return the identified time constants of translation and rotation, ms."""
    lag, yaw_lag = identify_lag(plant, np.random.default_rng(1))
    return 1e3 * lag, 1e3 * yaw_lag


def agreement_rows() -> Iterator[dict[str, object]]:
    """Yield the largest distances to mujoco-rollers at the same time on an S-shaped path, cm."""
    for friction in FRICTIONS:
        robot = replace(ROBOTS["small"], friction=friction)
        limit = LIMITS[friction]
        for turning, heading in ((True, "tangential"), (False, "constant")):
            for ramp, start in ((0.0, "at once"), (1.0, "in 1 s"), (2.0, "in 2 s")):
                path = SPath(turning, ramp)
                where = f"S at 0.7 m/s {start}, heading {heading}, friction {friction:g}"
                rollers = open_loop(MujocoPlant(robot), path)
                for name in ("planar", "mujoco-balls"):
                    difference = distance(open_loop(make_plant(robot, name), path), rollers)
                    title = f"{where}: {name}, same commands"
                    yield (
                        at_most(title, difference, "cm", limit)
                        if name == "planar"
                        else row(title, difference, "cm")
                    )
                if ramp != 1.0:
                    yield from closed_loop_rows(robot, path, where, limit, hard=ramp == 0.0)


def closed_loop_rows(
    robot: Robot, path: SPath, where: str, limit: float, *, hard: bool
) -> Iterator[dict[str, object]]:
    """Yield the same with feedback that does not model friction: a start at once causes slip."""
    rollers = closed_loop(MujocoPlant(robot), path)
    difference = distance(closed_loop(make_plant(robot, "planar"), path), rollers)
    title = f"{where}: planar, with feedback"
    if hard and robot.friction < 0.5:
        rngs = [np.random.default_rng(seed) for seed in range(PHASES)]
        others = [closed_loop(MujocoPlant(robot, "rollers", rng), path) for rng in rngs]
        yield row(title, difference, "cm")
        largest = max(distance(other, rollers) for other in others)
        yield row(f"{where}: mujoco-rollers at other initial angles", largest, "cm")
    else:
        yield at_most(title, difference, "cm", limit)


def open_loop(plant: Plant, path: SPath) -> np.ndarray:
    plant.reset(path.pose(0.0))
    return np.array([plant.step(twist, CONTROL).pose for twist in path.commands(CONTROL)])


def closed_loop(plant: Plant, path: SPath) -> np.ndarray:
    controller = FeedforwardController(CONTROL)
    return simulate(plant, controller, path, start=path.pose(0.0), dt=CONTROL).pose


def distance(poses: np.ndarray, others: np.ndarray) -> float:
    return float(100.0 * np.hypot(*(poses - others)[:, :2].T).max())


def main() -> None:
    velocities = list(velocity_rows())
    rows = [*speed_rows(), *agreement_rows()]
    publish("simulation", [*rows, *velocities], printed=len(rows))


if __name__ == "__main__":
    main()
