"""Local optima: random problems of `holonomic-nmpc`, compared with IPOPT from several starts.

Every problem is that of a named robot beside a reference, in motion, with a heading error of up to
half a turn; its optimum without limits violates a limit or the distance to a keep-out zone. IPOPT
starts from the optima without limits of the problem, of that with the other turn of the heading,
and of those whose targets pass every zone at its left or at its right. The cheapest plan of all
counts as the optimum.

    python benchmarks/optima.py --problems 200 --seed 1
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from statistics import median
from time import process_time

import numpy as np
from figures import at_most, console, publish, row
from rich.progress import track

from omnidrive.control.nmpc import Exit, IpoptSettings
from omnidrive.control.nmpc.holonomic import (
    Actuation,
    HolonomicIpopt,
    HolonomicParameters,
    HolonomicProblem,
    HolonomicSolverSettings,
    KeepOutZone,
    stack_keep_outs,
)
from omnidrive.control.nmpc.holonomic.law import law_memory
from omnidrive.control.nmpc.holonomic.lqr import unconstrained_velocities
from omnidrive.control.nmpc.holonomic.solver import violates_constraints
from omnidrive.control.nmpc.holonomic.step import solve_problem
from omnidrive.robot import named_robot

ROBOTS = ("paper", "small", "kiwi", "mecanum", "lekiwi")
STAGES = 15
SQUARE = np.array([[0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]])
WORSE = 1e-3  # relative excess of cost
FEASIBLE = 1e-6  # relative violation up to which a plan counts
REPEATS = 3  # of every solution of ours, for its time


@dataclass
class Comparison:
    """Costs of one problem."""

    zones: bool
    ours: float
    best: float
    seconds: float
    """Processor time of our solution."""
    ipopt_seconds: float
    """Processor time of IPOPT's from the optimum without limits."""

    @property
    def excess(self) -> float:
        """Relative to the best cost."""
        return self.ours / self.best - 1.0


def random_problem(rng: np.random.Generator, zones: int) -> HolonomicProblem:
    """Return a problem with a number of keep-out zones near the reference."""
    robot, dt = named_robot(str(rng.choice(ROBOTS))), float(rng.choice([0.05, 0.1]))
    actuation, parameters = Actuation.of(robot), HolonomicParameters()
    wheels, fastest = robot.chassis.jacobian, robot.chassis.max_wheel_speed
    speed = fastest / np.abs(wheels[:, :2]).sum(axis=1).max()  # m/s, reached in every direction
    times, course = dt * np.arange(STAGES + 1), rng.uniform(-np.pi, np.pi)
    course += rng.uniform(-1.0, 1.0) * times  # rad/s
    steps = rng.uniform(0.0, speed) * dt * np.column_stack([np.cos(course), np.sin(course)])
    yaws = rng.uniform(-np.pi, np.pi) + rng.uniform(-1.0, 1.0) * times
    targets = np.column_stack([np.cumsum(steps, axis=0) - steps[0], yaws])
    offset = [*rng.normal(0.0, 0.3 * speed * dt * STAGES, 2), rng.uniform(-np.pi, np.pi)]
    previous = rng.normal(size=3) * [1.0, 1.0, 3.0]
    previous *= rng.uniform(0.0, 0.9) * fastest / np.abs(wheels @ previous).max()
    start = targets[0] + offset
    return HolonomicProblem(
        dt,
        start,
        previous,
        targets,
        np.diff(targets, axis=0) / dt,
        parameters.state_weights(STAGES + 1, dt),
        parameters.control_weights(),
        actuation.limits(robot.chassis, dt),
        stack_keep_outs([random_zone(rng, start, targets) for _ in range(zones)], STAGES + 1),
    )


def random_zone(rng: np.random.Generator, start: np.ndarray, targets: np.ndarray) -> KeepOutZone:
    """Return a disc or a rounded square that blocks the way to a target or the reference."""
    while True:
        target = targets[rng.integers(STAGES // 2, STAGES + 1), :2]
        radius = rng.uniform(0.1, 0.4) * max(np.linalg.norm(target - start[:2]), 0.2)
        centre = start[:2] + rng.uniform(0.3, 0.9) * (target - start[:2])
        centre = centre + rng.uniform(-1.0, 1.0, 2) * radius
        if np.linalg.norm(centre - start[:2]) > 1.5 * radius:
            break
    if rng.random() < 0.5:
        return KeepOutZone(centre, radius)
    return KeepOutZone(centre, 0.5 * radius, radius * SQUARE)


def other_turn(p: HolonomicProblem) -> HolonomicProblem:
    """Return the problem whose targets are reached by the other turn of the heading."""
    turn = -2.0 * np.pi if p.targets[0, 2] > p.start[2] else 2.0 * np.pi
    return p._replace(targets=p.targets + np.array([0.0, 0.0, turn]))


def around(p: HolonomicProblem, sides: tuple[int, ...]) -> HolonomicProblem:
    """Return the problem whose targets pass every zone at a side: left 1, right -1, 0 as it is."""
    targets = p.targets.copy()
    for j, side in enumerate(sides):
        corners = p.keep_outs.corners[p.keep_outs.first[j] : p.keep_outs.first[j + 1]]
        radius = p.keep_outs.radii[j] + np.linalg.norm(corners, axis=1).max()
        along = targets[-1, :2] - p.start[:2]
        left = np.array([-along[1], along[0]]) / max(np.linalg.norm(along), 1e-9)
        for k in range(STAGES + 1):
            offset = targets[k, :2] - p.keep_outs.centres[j, k]
            if side and np.linalg.norm(offset) < 1.5 * radius:
                needed = side * 1.1 * radius - offset @ left
                targets[k, :2] += max(side * needed, 0.0) * side * left
    return p._replace(targets=targets)


def starts(p: HolonomicProblem) -> Iterator[tuple[HolonomicProblem, np.ndarray]]:
    """Yield problems, equal to ``p`` up to whole turns of the heading, and guesses."""
    for each in (p, other_turn(p)):
        for sides in product((0, 1, -1), repeat=len(p.keep_outs.radii)):
            yield each, unconstrained_velocities(around(each, sides))
    yield p, unconstrained_velocities(other_turn(p))
    yield p, np.zeros((STAGES, 3))


def compare(p: HolonomicProblem, ipopt: HolonomicIpopt) -> Comparison:
    plan, times = law_memory(STAGES, len(p.limits.bounds), 0).plan, []
    for _ in range(REPEATS):
        same, began = p._replace(targets=p.targets.copy()), process_time()
        solve_problem(same, plan, plan.velocities[:0], *HolonomicSolverSettings())
        times.append(process_time() - began)
    ours, violation = float(plan.figures["cost"][0]), float(plan.figures["violation"][0])
    best, first = ours, 0.0
    for k, (each, guess) in enumerate(starts(p)):
        began = process_time()
        found = ipopt.solve(each, guess)
        if k == 0:
            first = process_time() - began
        if found.exit is Exit.CONVERGED and found.violation <= max(FEASIBLE, violation):
            best = min(best, found.cost)
    return Comparison(len(p.keep_outs.radii) > 0, ours, best, median(times), first)


def rows(name: str, found: list[Comparison], target: float) -> Iterator[dict]:
    excesses = np.array([each.excess for each in found])
    share = np.mean(excesses > WORSE)
    yield at_most(f"{name}: worse than the best by more than 0.1 %", share, "of problems", target)
    yield row(f"{name}: problems", len(found), "1")
    yield row(f"{name}: largest excess of cost", 100.0 * excesses.max(), "%")
    yield row(f"{name}: median time", 1e6 * median(each.seconds for each in found), "us")
    yield row(f"{name}: IPOPT's median time over ours",
              median(each.ipopt_seconds / each.seconds for each in found), "1")  # fmt: skip


def draw(rng: np.random.Generator, zones: int) -> HolonomicProblem:
    """Return a random problem with active constraints."""
    while True:
        p = random_problem(rng, zones)
        if violates_constraints(p, unconstrained_velocities(p)):
            return p


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng, ipopt = np.random.default_rng(arguments.seed), HolonomicIpopt(IpoptSettings(1e-9, 500))
    found = []
    for k in track(range(arguments.problems), console=console, transient=True):
        found.append(compare(draw(rng, (0, 1, 0, 2)[k % 4]), ipopt))
    without, within = ([c for c in found if c.zones is zones] for zones in (False, True))
    publish("optima", [*rows("without zones", without, 0.01), *rows("with zones", within, 0.1)])


if __name__ == "__main__":
    main()
