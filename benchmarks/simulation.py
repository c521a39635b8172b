"""How fast the plants are, how they follow commands, and how far the planar one is from rollers.

Real-time factors are simulated seconds per second of the thread's own processor time: per core,
whatever else runs. The plants take turns; medians.
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
from omnidrive.simulation import MujocoPlant, Plant, identify_lag, simulate, simulate_batch
from omnidrive.study import PlantName, make_plant

ORIGIN = Pose(0.0, 0.0, 0.0)
PLANTS: tuple[PlantName, ...] = ("mujoco-rollers", "mujoco-balls", "planar", "kinematic")
FACTORS = {"mujoco-rollers": 25.0, "mujoco-balls": 250.0, "planar": 1000.0}
ROUNDS = 5
SECONDS = {
    "mujoco-rollers": 2.0,
    "mujoco-balls": 6.0,
    "planar": 60.0,
    "kinematic": 20.0,
}  # per round
CURVE = BodyTwist(0.5, 0.2, 0.6)
BATCH = (20, 100)  # runs, commands

FRICTIONS = (0.8, 0.1)
STEADY = (BodyTwist(0.5, 0.0, 0.0), BodyTwist(0.0, 0.5, 0.0), BodyTwist(0.0, 0.0, 1.0))
SETTLE, WATCH, SAMPLE = 2.5, 4.0, 0.01  # s
DASH = BodyTwist(1.0, 0.0, 0.0)  # asked for at once, from rest
DASHING = 2.0  # s

LIMITS = {0.8: 1.2, 0.1: 1.0}  # cm, of planar against rollers on an S
CONTROL = 0.05  # s
PHASES = 3  # other first angles of the rollers

console = Console(width=120)


def speed_rows() -> Iterator[dict[str, object]]:
    """Real-time factors: of steps of 0.1 s; of the planar plant, of 0.02 s and in a batch too."""
    tasks: dict[tuple[str, PlantName, str], Callable[[], float]] = {}
    for robot in ROBOTS.values():
        for name in PLANTS:
            plant, seconds = make_plant(robot, name), SECONDS[name]
            tasks[robot.name, name, "0.1 s"] = lambda p=plant, s=seconds: driven(p, s, 0.1)
        planar = make_plant(robot, "planar")
        tasks[robot.name, "planar", "0.02 s"] = lambda p=planar: driven(p, 20.0, 0.02)
        tasks[robot.name, "planar", "a batch"] = lambda r=robot: rolled_out(r)
    factors: dict[tuple[str, PlantName, str], list[float]] = {key: [] for key in tasks}
    for _ in range(1 + ROUNDS):
        for key, task in tasks.items():
            factors[key].append(task())
    for (robot_name, name, how), values in factors.items():
        title, value = (
            f"real-time factor: {name}, {robot_name}, {how}",
            median(values[1:]),
        )  # the first one warms up
        yield (
            at_least(title, value, "1", FACTORS[name])
            if name in FACTORS
            else row(title, value, "1")
        )


def driven(plant: Plant, seconds: float, dt: float) -> float:
    plant.reset(ORIGIN)
    began = thread_time()
    for _ in range(round(seconds / dt)):
        plant.step(CURVE, dt)
    return seconds / (thread_time() - began)


def rolled_out(robot: Robot) -> float:
    runs, steps = BATCH
    starts, commands = np.zeros((runs, 3)), np.tile(np.array(CURVE), (runs, steps, 1))
    began = thread_time()
    simulate_batch(robot, starts, commands, 0.1)
    return runs * steps * 0.1 / (thread_time() - began)


def velocity_rows() -> Iterator[dict[str, object]]:
    """What becomes of commanded velocities, for every robot, plant and friction; also printed."""
    titles = ("robot", "plant", "friction", "bias mm/s", "mrad/s", "ripple mm/s", "mrad/s",
              "slip cm", "lag ms", "yaw ms")  # fmt: skip
    names = ("bias", "yaw bias", "ripple", "yaw ripple", "slip", "lag", "yaw lag")
    units = ("mm/s", "mrad/s", "mm/s", "mrad/s", "cm", "ms", "ms")
    table = Table(*titles, title="Realised against commanded velocity")
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
    """Bias and ripple of steady motion, the worst of three directions; mm/s and mrad/s.

    Bias: the mean velocity from pose to pose less what is asked for. Ripple: the standard deviation
    of the velocity in samples of 10 ms. Speed is gained gently, over two seconds.
    """
    biases, ripples = [], []
    for asked in STEADY:
        plant.reset(ORIGIN)
        for k in range(round(2.0 / 0.05)):
            plant.step(BodyTwist(*(v * k / 40.0 for v in asked)), 0.05)
        before = plant.step(asked, SETTLE - 2.0).pose
        states = [plant.step(asked, SAMPLE) for _ in range(round(WATCH / SAMPLE))]
        poses = [before, *(state.pose for state in states)]
        done = np.array([twist_between(a, b, SAMPLE) for a, b in pairwise(poses)])
        biases.append(np.abs(done.mean(axis=0) - asked))
        ripples.append(done.std(axis=0))
    figures = []
    for each in (biases, ripples):
        worst = 1e3 * np.max(each, axis=0)
        figures += [float(worst[:2].max()), float(worst[2])]
    return figures[0], figures[1], figures[2], figures[3]


def slip(plant: Plant) -> float:
    """How far a robot falls behind a command of 1 m/s from rest, in two seconds; in cm."""
    plant.reset(ORIGIN)
    for _ in range(round(DASHING / 0.1)):
        state = plant.step(DASH, 0.1)
    return 100.0 * (DASH.vx * DASHING - state.pose.x)


def lags(plant: Plant) -> tuple[float, float]:
    """Time constants of translation and rotation as they are identified, in ms."""
    lag, yaw_lag = identify_lag(plant, np.random.default_rng(1))
    return 1e3 * lag, 1e3 * yaw_lag


def agreement_rows() -> Iterator[dict[str, object]]:
    """Greatest distance from where the plant with rollers is at the same time, on an S; in cm."""
    for friction in FRICTIONS:
        robot = replace(ROBOTS["small"], friction=friction)
        limit = LIMITS[friction]
        for turning, heading in ((True, "along it"), (False, "kept")):
            for ramp, start in ((0.0, "at once"), (1.0, "in 1 s"), (2.0, "in 2 s")):
                path = SPath(turning, ramp)
                where = f"S at 0.7 m/s {start}, heading {heading}, friction {friction:g}"
                rollers = open_loop(MujocoPlant(robot), path)
                for name in ("planar", "mujoco-balls"):
                    apart = distance(open_loop(make_plant(robot, name), path), rollers)
                    title = f"{where}: {name}, same commands"
                    yield (
                        at_most(title, apart, "cm", limit)
                        if name == "planar"
                        else row(title, apart, "cm")
                    )
                if ramp != 1.0:
                    yield from closed_loop_rows(robot, path, where, limit, hard=ramp == 0.0)


def closed_loop_rows(
    robot: Robot, path: SPath, where: str, limit: float, *, hard: bool
) -> Iterator[dict[str, object]]:
    """The same with feedback; it knows of no friction, so that a start at once spins the wheels."""
    rollers = closed_loop(MujocoPlant(robot), path)
    apart = distance(closed_loop(make_plant(robot, "planar"), path), rollers)
    title = f"{where}: planar, with feedback"
    if hard and robot.friction < 0.5:
        rngs = [np.random.default_rng(seed) for seed in range(PHASES)]
        others = [closed_loop(MujocoPlant(robot, "rollers", rng), path) for rng in rngs]
        yield row(title, apart, "cm")
        yield row(f"{where}: rollers at other angles", max(distance(o, rollers) for o in others),
                  "cm")  # fmt: skip
    else:
        yield at_most(title, apart, "cm", limit)


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
