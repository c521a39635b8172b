"""How much faster predictive controllers plan here than with CasADi and IPOPT, or with do-mpc.

Every case is a stream of problems that a robot met one after the other (nmpc_streams.py). All take
turns in one run, on the same problems in the same order; each time is that of a whole Python call,
warm, and includes the shift of the last plan that begins the search, where there is one. The ratios
are of medians over the steps, and a peer's time counts only if its plans are the same. Where a
limit or an obstacle is in the way of less than half of the steps, the median is one of the others:
the ratio over those steps stands beside it.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from figures import at_least, at_most, console, publish, ratio, row
from nmpc_contest import BLOCK, ROUNDS, Here, Holonomic, Outcome, ShiftedSqp, There, contest
from nmpc_ipopt import PAPERS_OPTIONS, TIGHT_OPTIONS, Ipopt
from nmpc_streams import (
    HEADING_NOISE,
    POSITION_NOISE,
    STEPS,
    AnyProblem,
    closed_loop_cost,
    holonomic_stream,
    obstacle_stream,
    statement,
    unicycle_stream,
)
from peer_process import PeerProcess
from rich.progress import Progress

from omnidrive.control.nmpc import Exit, IpoptSettings, UnicycleSolution, UnicycleSolver
from omnidrive.control.nmpc.holonomic import (
    HolonomicIpopt,
    HolonomicProblem,
    HolonomicSolution,
    HolonomicSolver,
)
from omnidrive.geometry import BodyTwist, Pose, move, twist_between

KICKED, SLOW = 28.0, 15.0  # rad/s: wheels that are at their limit after kicks only; throughout
SAME, SAME_SHARE = 1e-3, 0.95  # m/s and rad/s of the first control; of the steps
BINDS, CHEAPER = 1e-6, 1e-7  # least multiplier; least difference of costs, as a part
BATCH, BATCH_ROUNDS, FIRST_CALLS = 20_000, 5, 3


@dataclass(frozen=True)
class Case:
    """A stream of problems and who solves it."""

    name: str
    stream: Callable[[], list[AnyProblem]]
    ours: Callable[[], ShiftedSqp | Holonomic]
    target: float
    """Least ratio of IPOPT's median to ours."""
    p99_target: float | None = None
    """Least ratio of IPOPT's median to our 99th percentile."""
    limited_target: float | None = None
    """Least share of steps in which a wheel is at its limit."""
    peers: tuple[str, ...] = ("do-mpc",)


CASES = (
    Case("unicycle, N = 15", partial(unicycle_stream, 15), ShiftedSqp, 100.0),
    Case("wheels, N = 15", partial(holonomic_stream, 15, KICKED), Holonomic, 150.0, p99_target=5.0),
    Case("wheels, N = 50", partial(holonomic_stream, 50, KICKED), Holonomic, 100.0),
    Case("wheels always limited, N = 15", partial(holonomic_stream, 15, SLOW), Holonomic, 15.0,
         limited_target=0.9),
    Case("wheels + rates + 3 obstacles, N = 15", partial(obstacle_stream, 15, KICKED), Holonomic,
         60.0),
    Case("wheels + rates + 3 obstacles, N = 30", partial(obstacle_stream, 30, KICKED), Holonomic,
         40.0),
)  # fmt: skip


def case_rows(
    case: Case, process: PeerProcess | None, advance: Callable[[], None]
) -> Iterator[dict]:
    stream = case.stream()
    common = statement(stream[0])
    solvers = {"ours": Here(case.ours()), "IPOPT": Here(Ipopt(common, PAPERS_OPTIONS))}
    if process is not None:
        solvers |= {name: There(name, case.name, process) for name in case.peers}
    outcomes = contest(solvers, stream, advance)
    tight = Ipopt(common, TIGHT_OPTIONS)
    optima = [tight(problem) for problem in stream]
    ours = case.ours()
    solutions = [(ours(problem), ours.solution)[1] for problem in stream]
    yield from speed_rows(case, outcomes, [plan[0] for plan in optima])
    yield from exit_rows(case, solutions)
    if isinstance(solutions[0], HolonomicSolution):
        yield from obstruction_rows(case, stream, solutions, outcomes)
    yield from agreement_rows(case, stream, solutions, optima)


def speed_rows(case: Case, outcomes: dict[str, Outcome], optima: list) -> Iterator[dict]:
    ours = outcomes["ours"]
    for name, outcome in outcomes.items():
        title, times = f"{case.name}: faster than {name}", outcome.typical / ours.typical
        same = 1.0 if name == "ours" else np.mean(differences(outcome.firsts, optima) <= SAME)
        if same < SAME_SHARE:
            yield row(f"{title}: not fair, {same:.0%} of its plans are the same", 0.0, "1", "fair",
                      False)  # fmt: skip
        elif name == "IPOPT":
            yield ratio(title, times, case.target)
        elif name != "ours":
            yield row(title, times, "1")
        for what, seconds in {
            "undisturbed": outcome.typical,
            "median of calls": median(outcome.seconds),
            "99th percentile": np.percentile(outcome.seconds, 99),
            "after the others' turn": median(outcome.seconds[::BLOCK]),
        }.items():
            yield row(f"{case.name}: {name}, {what}", seconds * 1e6, "us")
    if case.p99_target is not None:
        value = outcomes["IPOPT"].typical / np.percentile(ours.seconds, 99)
        yield ratio(
            f"{case.name}: our 99th percentile below IPOPT's median", value, case.p99_target
        )


def exit_rows(case: Case, solutions: list[Any]) -> Iterator[dict]:
    exits = Counter(solution.exit for solution in solutions)
    unfinished = exits[Exit.STALLED] + exits[Exit.UNUSABLE]
    yield at_most(f"{case.name}: neither converged nor capped", unfinished, "steps", 0)
    yield row(f"{case.name}: capped", exits[Exit.CAPPED], "steps")


def obstruction_rows(
    case: Case,
    stream: list[HolonomicProblem],
    solutions: list[HolonomicSolution],
    outcomes: dict[str, Outcome],
) -> Iterator[dict]:
    """In how many steps something is in the way of the plan, and how fast these are."""
    rates = stream[0].limits.before.any(axis=1)
    name = f"{case.name}: a wheel of the plan is at its limit"
    share = share_of(binds(solution, ~rates) for solution in solutions)
    if case.limited_target is None:
        yield row(name, share, "of steps")
    else:
        yield at_least(name, share, "of steps", case.limited_target)
    if rates.any():
        share = share_of(binds(solution, rates) for solution in solutions)
        yield row(f"{case.name}: a wheel accelerates as it can", share, "of steps")
    if len(stream[0].keep_outs.radii):
        share = share_of(map(is_near, stream, solutions))
        yield row(f"{case.name}: a plan gives way to an obstacle", share, "of steps")
    obstructed = np.array([solution.iterations > 0 for solution in solutions])
    yield row(f"{case.name}: something is in the way", np.mean(obstructed), "of steps")
    typical = {k: median(outcome.undisturbed[obstructed]) for k, outcome in outcomes.items()}
    for name, seconds in typical.items():
        if name != "ours":
            yield row(f"{case.name}: where something is in the way, faster than {name}",
                      seconds / typical["ours"], "1")  # fmt: skip
        yield row(f"{case.name}: where something is in the way, {name}, undisturbed",
                  seconds * 1e6, "us")  # fmt: skip


def share_of(answers: Iterable[bool]) -> float:
    return float(np.mean(list(answers)))


def binds(solution: HolonomicSolution, limits: np.ndarray) -> bool:
    return bool(np.abs(solution.multipliers[:, limits]).max() > BINDS)


def is_near(problem: HolonomicProblem, solution: HolonomicSolution) -> bool:
    """Whether the plan comes nearer to a disc than it should, as all that are evaded at a cost."""
    places = problem.keep_outs
    distances = np.linalg.norm(solution.states[:, :2] - places.centres, axis=2)
    return bool((distances < places.radii[:, None]).any())


def agreement_rows(
    case: Case, stream: list[AnyProblem], solutions: list[Any], optima: list[np.ndarray]
) -> Iterator[dict]:
    """How near our first controls are to the optimum, and who is better where they are not."""
    firsts = [first_control(*each) for each in zip(stream, solutions, strict=True)]
    apart = differences(firsts, [controls[0] for controls in optima])
    yield at_least(
        f"{case.name}: first control within 1e-5 of IPOPT's to 1e-10",
        np.mean(apart <= 1e-5), "of steps", 0.99,
    )  # fmt: skip
    yield row(f"{case.name}: greatest difference of it", apart.max(), "m/s, rad/s")
    costs = np.array([solution.cost for solution in solutions])
    gains = np.array([cost_of(*each) for each in zip(stream, optima, strict=True)]) / costs - 1.0
    other = np.count_nonzero(apart > 1e-5)
    yield row(f"{case.name}: first controls that are not IPOPT's", other, "steps")
    yield row(f"{case.name}: ours costs less", np.count_nonzero(gains > CHEAPER), "steps")
    yield row(f"{case.name}: IPOPT's costs less", np.count_nonzero(gains < -CHEAPER), "steps")
    yield row(f"{case.name}: IPOPT's costs less by at most", -100.0 * min(gains.min(), 0.0), "%")


def differences(some: list, others: list) -> np.ndarray:
    """Largest difference of the controls of every step."""
    return np.abs(np.array(some) - np.array(others)).max(axis=1)


def first_control(
    problem: AnyProblem, solution: UnicycleSolution | HolonomicSolution
) -> np.ndarray:
    """As in nmpc_models.py: of the holonomic robot the body twist."""
    if isinstance(solution, UnicycleSolution):
        return solution.controls[0]
    here, there = solution.states[:2].tolist()
    return np.array(twist_between(Pose(*here), Pose(*there), problem.dt))


def cost_of(problem: AnyProblem, controls: np.ndarray) -> float:
    if not isinstance(problem, HolonomicProblem):
        return UnicycleSolution.of(problem, controls, 0, Exit.CAPPED).cost
    poses = [Pose(*problem.start.tolist())]
    for twist in controls.tolist():
        poses.append(move(poses[-1], BodyTwist(*twist), problem.dt))
    velocities = np.diff(poses, axis=0) / problem.dt
    none = np.zeros((len(controls), len(problem.limits.bounds)))
    return HolonomicSolution.of(problem, velocities, none, 0, Exit.CAPPED).cost


def closed_loop_rows() -> Iterator[dict]:
    ours = closed_loop_cost(15, KICKED, HolonomicSolver())
    theirs = closed_loop_cost(15, KICKED, HolonomicIpopt(IpoptSettings(tolerance=1e-10)))
    yield row("wheels, N = 15: cost of the closed loop", ours, "1")
    yield at_most("wheels, N = 15: cost of the closed loop, from IPOPT's",
                  100.0 * abs(ours / theirs - 1.0), "%", 0.01)  # fmt: skip


def batch_rows() -> Iterator[dict]:
    """The stream many times over, each time with other noise."""
    stream = holonomic_stream(15, KICKED)
    rng, picked = np.random.default_rng(2), np.resize(np.arange(len(stream)), BATCH)
    noise = rng.normal(0.0, (POSITION_NOISE, POSITION_NOISE, HEADING_NOISE), (BATCH, 3))
    many = stream[0]._replace(
        start=np.array([p.start for p in stream])[picked] + noise,
        previous=np.array([p.previous for p in stream])[picked],
        targets=np.array([p.targets for p in stream])[picked],
        feedforward=np.array([p.feedforward for p in stream])[picked],
    )
    solver, rates = HolonomicSolver(), []
    solver.solve_many(many._replace(start=many.start[:1]))
    for _ in range(BATCH_ROUNDS):
        began = perf_counter()
        _, iterations = solver.solve_many(many)
        rates.append(np.count_nonzero(iterations >= 0) / (perf_counter() - began))
    yield at_least("wheels, N = 15, batch: converged, one thread", median(rates), "1/s", 75_000)
    yield row("wheels, N = 15, batch: converged", np.mean(iterations >= 0), "of problems")
    yield row("wheels, N = 15, batch: a wheel is at its limit", np.mean(iterations != 0),
              "of problems")  # fmt: skip


FIRST_CALL = """
import pickle, sys
from time import perf_counter
began = perf_counter()
solve, arguments = pickle.load(sys.stdin.buffer)
imported = perf_counter()
solve(*arguments)
print(imported - began, perf_counter() - imported)
"""


def first_call_rows() -> Iterator[dict]:
    """In processes of their own: kernels compiled, and then taken from where they are kept."""
    unicycle, holonomic = unicycle_stream(15)[0], holonomic_stream(15, KICKED)[0]
    calls = {
        "unicycle": (UnicycleSolver().solve, (unicycle, unicycle.feedforward)),
        "wheels": (HolonomicSolver().solve, (holonomic,)),
    }
    for name, call in calls.items():
        with TemporaryDirectory() as kept:
            _, cold = first_call(call, kept)
            imports, warm = zip(*(first_call(call, kept) for _ in range(FIRST_CALLS)), strict=True)
        yield at_most(f"{name}: first call, kernels kept, after the import", median(warm), "s", 1.0)
        yield row(f"{name}: first call, nothing kept, after the import", cold, "s")
        yield row(f"{name}: the import", median(imports), "s")


def first_call(call: tuple, kept: str) -> tuple[float, float]:
    """Seconds of the import and of the call, with kernels kept in the folder ``kept``."""
    run = subprocess.run(
        [sys.executable, "-c", FIRST_CALL], input=pickle.dumps(call), capture_output=True,
        check=True, env=os.environ | {"NUMBA_CACHE_DIR": kept},
    )  # fmt: skip
    imported, called = map(float, run.stdout.split())
    return imported, called


def main() -> None:
    process, rows = PeerProcess.if_available("nmpc"), []
    # drawn between turns: a thread that draws would be in the times
    with Progress(console=console, transient=True, auto_refresh=False) as progress:

        def advance(task: int) -> None:
            progress.update(task, advance=1, refresh=True)

        for case in CASES:
            task = progress.add_task(case.name, total=ROUNDS * STEPS / BLOCK)
            rows += case_rows(case, process, partial(advance, task))
        for part in (closed_loop_rows, batch_rows, first_call_rows):
            task = progress.add_task(part.__name__.removesuffix("_rows").replace("_", " "), total=1)
            progress.refresh()
            rows += part()
            advance(task)
    if process is not None:
        process.close()
    publish("nmpc", rows)


if __name__ == "__main__":
    main()
