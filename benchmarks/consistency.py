"""Consistency of the pose filter: NEES and NIS against their chi-square bands.

Four robots follow four motions on a plant with rollers; the initial wheel angles are random and
unknown to the filter. Each run is filtered with several kinds of noise of the pose fixes. The NEES
is the squared error of the pose over its covariance at the end of a run, 3 on average; the NIS is
that of the innovations of all fixes that the gate accepts. The 95 % bands are those of the means
over all seeds (Bar-Shalom, Li & Kirubarajan, "Estimation with Applications to Tracking and
Navigation", 2001, section 5.4). The covariance stated by wrong fixes is three times too small for
even seeds and too large for odd ones.

    python benchmarks/consistency.py --seeds 10 --robots paper,kiwi --plant mujoco-rollers
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from figures import at_least, at_most, console, publish, row
from rich.table import Table
from scipy.stats import chi2

from omnidrive.estimation import (
    EstimatorSettings,
    PoseEstimator,
    PoseFixSettings,
    SensorReadings,
    SensorSettings,
)
from omnidrive.geometry import BodyTwist, Pose, twist_between, wrap
from omnidrive.reference import Circle, Eight, ShapeReference
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation import MujocoPlant, PlanarPlant, Plant, PlantState, SensorSuite

DT = 0.05  # s
ROBOTS = ("paper", "small", "kiwi", "mecanum")
MOTIONS = {"circle": 12.0, "eight": 20.0, "spiral": 20.0, "rest": 10.0}  # durations, s
WHITE = PoseFixSettings(position_sigma=0.02, yaw_sigma=0.01)
NOISES = {
    "white": WHITE,
    "biased": replace(WHITE, position_bias=0.05, yaw_bias=0.03),
    "slow": replace(WHITE, position_bias=0.05, yaw_bias=0.03, bias_time=30.0),
    "outlying": replace(WHITE, outliers=0.05),
    "wrong": WHITE,
    "paper": PoseFixSettings(law="paper"),
}
JUMP = 10.0  # of the clock, s
GATE = float(chi2.isf(EstimatorSettings().false_alarms, 3))
WARM_UP = 100.0  # time of the fixes before a robot at rest is observed, s
WRONG = 3.0  # ratio of true and stated covariance, or its inverse
SHARE = 0.9  # of the cells that must hold


@dataclass
class Cell:
    """Normalised squared errors and innovations of the runs of one cell."""

    name: str
    nees: list[float] = field(default_factory=list)
    nis: list[float] = field(default_factory=list)
    error: list[float] = field(default_factory=list)  # position at the end, m
    relocations: int = 0

    def band(self, values: list[float]) -> tuple[float, float]:
        """Return the 95 % band of the mean of squares with three degrees of freedom."""
        low, high = chi2.ppf([0.025, 0.975], 3 * len(values)) / len(values)
        return float(low), float(high)

    def holds(self, values: list[float]) -> bool:
        low, high = self.band(values)
        return bool(low <= np.mean(values) <= high)


def target(motion: str, t: float) -> tuple[Pose, BodyTwist]:
    """Return the pose and the twist in W of a motion at ``t`` (s)."""
    if motion in {"circle", "eight"}:
        shape = Circle() if motion == "circle" else Eight()
        point = ShapeReference(shape, MOTIONS[motion]).at(t)
        return point.pose, BodyTwist(*point.twist)
    if motion == "rest":
        return Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
    share = t / MOTIONS["spiral"]
    a, rate = 2.0 * np.pi * share, 2.0 * np.pi / MOTIONS["spiral"]
    c, s, radius, growth = np.cos(a), np.sin(a), 0.5 * share, 0.5 / MOTIONS["spiral"]
    twist = growth * c - radius * rate * s, growth * s + radius * rate * c, growth
    return Pose(radius * c, radius * s, 0.5 * share), BodyTwist(*map(float, twist))


def path(robot: Robot, motion: str, seed: int, plant_name: str) -> list[PlantState]:
    """Return the states of a run every ``DT``, controlled with the true pose."""
    rng = np.random.default_rng(seed)
    plant: Plant = PlanarPlant(robot, rng)
    if plant_name == "mujoco-rollers":
        plant = MujocoPlant(robot, "rollers", rng)
    states = [plant.reset(target(motion, 0.0)[0])]
    for k in range(round(MOTIONS[motion] / DT)):
        goal, twist = target(motion, DT * k)
        pose = states[-1].pose
        u, v = twist[0] + goal.x - pose.x, twist[1] + goal.y - pose.y
        c, s = np.cos(pose.yaw), np.sin(pose.yaw)
        turn = twist[2] + wrap(goal.yaw - pose.yaw)
        states.append(plant.step(BodyTwist(c * u + s * v, c * v - s * u, turn), DT))
    return states


def filter_run(robot: Robot, states: list[PlantState], noise: str, seed: int, cell: Cell) -> None:
    """Filter a run and append its results to ``cell``, whose name the sensors' noise depends on.

    A robot at rest starts at an unknown pose, after a jump of the clock, and with a stationary
    bias: at a known pose its error and covariance are both zero. The NIS is that of the second
    half, after the fixes' covariance
    has been adapted.
    """
    told = SensorSettings(fixes=NOISES[noise])
    # independent in every cell: otherwise cells at rest share one mean
    rng = np.random.default_rng([seed, *cell.name.encode()])
    suite = SensorSuite(told, robot.chassis, rng)
    estimator = PoseEstimator(robot, told)
    suite.reset(states[0].pose)
    estimator.reset(states[0].pose)
    start = 0.0
    if states[0].pose == states[-1].pose:
        start = WARM_UP
        suite.read(start - DT, states[0])
        for stamp in (start - JUMP, start - 2.0 * DT, start - DT):
            estimator.update(SensorReadings(stamp, states[0].wheel_angles))
    restarts = len(estimator.restarts)
    scale = 1.0 if noise != "wrong" else (WRONG if seed % 2 else 1.0 / WRONG) ** 0.5
    for k, state in enumerate(states):
        readings = suite.read(start + DT * k, state)
        fixes = tuple(
            fix._replace(position_sigma=scale * fix.position_sigma, yaw_sigma=scale * fix.yaw_sigma)
            for fix in readings.fixes
        )
        found = estimator.update(readings._replace(fixes=fixes))
        if fixes and 2 * k > len(states) and estimator.nis <= GATE:
            cell.nis.append(estimator.nis)
    assert found.pose is not None
    error = np.array(twist_between(found.pose, states[-1].pose, 1.0))
    cell.nees.append(float(error @ np.linalg.solve(found.covariance, error)))
    cell.error.append(float(np.hypot(error[0], error[1])))
    events = [*estimator.relocations, *estimator.restarts[restarts:]]
    cell.relocations += sum(t > start + 1.0 for t in events)  # the first fix may be an outlier


def cells(args: argparse.Namespace) -> Iterator[Cell]:
    """Yield every cell with its name, the noise last."""
    noises = args.noises.split(",")
    for name, motion in product(args.robots.split(","), args.motions.split(",")):
        robot = named_robot(name)
        found = {noise: Cell(f"{name}, {motion}, {noise}") for noise in noises}
        for seed in range(args.seeds):
            states = path(robot, motion, seed, args.plant)
            for noise, cell in found.items():
                filter_run(robot, states, noise, seed, cell)
        yield from found.values()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--motions", default=",".join(MOTIONS))
    parser.add_argument("--noises", default=",".join(NOISES))
    parser.add_argument("--plant", default="planar", choices=("planar", "mujoco-rollers"))
    table = Table("cell", "NEES", "NIS", "error, mm", "relocations", "in the band")
    held, relocations, rows = [], 0, []
    for cell in cells(parser.parse_args()):
        holds = cell.holds(cell.nees), cell.holds(cell.nis)
        nees, nis, error = (float(np.mean(each)) for each in (cell.nees, cell.nis, cell.error))
        verdict = " ".join(each for each, ok in zip(("NEES", "NIS"), holds, strict=True) if ok)
        table.add_row(
            cell.name,
            f"{nees:.2f}",
            f"{nis:.2f}",
            f"{1e3 * error:.2f}",
            f"{cell.relocations}",
            verdict,
        )
        relocations += cell.relocations
        if not cell.name.endswith("paper"):  # its bias has one course in all runs, hence no band
            held.extend(holds)
        rows += [row(f"{cell.name}: NEES", nees, "1"), row(f"{cell.name}: NIS", nis, "1")]
    console.print(table)
    totals = [at_most("false relocations", relocations, "1", 0.0)]
    if held:
        totals.append(at_least("means in their 95 % bands", float(np.mean(held)), "1", SHARE))
    publish("consistency", totals + rows, printed=len(totals))


if __name__ == "__main__":
    main()
