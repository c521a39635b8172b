"""Speed of the NMPC solvers compared with CasADi and IPOPT, and with do-mpc.

Every case is a stream of consecutive problems of one robot (nmpc_streams.py). The solvers alternate
in one run, on the same problems in the same order; each time is that of a whole Python call,
warm, including the shift of the last plan if that is the guess. The ratios are of medians over the
steps, and a peer's time counts only if its plans are equal. If constraints are active in less than
half of the steps, the median is that of an unconstrained step: the ratio over the constrained steps
is a separate row.
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
from nmpc_comparison import (
    BLOCK,
    ROUNDS,
    HolonomicStream,
    LocalSolver,
    Outcome,
    PeerSolver,
    UnicycleStream,
    compare,
)
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

FAST, SLOW = 28.0, 15.0  # rad/s: wheel speed limit active after displacements only; always active
SAME, SAME_SHARE = (
    1e-3,
    0.95,
)  # tolerance of the first control in m/s and rad/s; required share of steps
ACTIVE, CHEAPER = 1e-6, 1e-7  # least multiplier; least relative difference of costs
BATCH, BATCH_ROUNDS, FIRST_CALLS = 20_000, 5, 3


@dataclass(frozen=True)
class Case:
    """A stream of problems and its solvers."""

    name: str
    stream: Callable[[], list[AnyProblem]]
    ours: Callable[[], UnicycleStream | HolonomicStream]
    target: float
    """Required ratio of IPOPT's median to omnidrive's."""
    p99_target: float | None = None
    """Required ratio of IPOPT's median to omnidrive's 99th percentile."""
    limited_target: float | None = None
    """Required share of steps with an active wheel speed limit."""
    peers: tuple[str, ...] = ("do-mpc",)


HolonomicCase = partial(Case, ours=HolonomicStream)

CASES = (
    Case("unicycle, N = 15", partial(unicycle_stream, 15), UnicycleStream, target=100.0),
    HolonomicCase(
        "wheels, N = 15", partial(holonomic_stream, 15, FAST), target=150.0, p99_target=5.0
    ),
    HolonomicCase("wheels, N = 50", partial(holonomic_stream, 50, FAST), target=100.0),
    HolonomicCase(
        "wheels always limited, N = 15",
        partial(holonomic_stream, 15, SLOW),
        target=15.0,
        limited_target=0.9,
    ),
    HolonomicCase(
        "wheels + rates + 3 obstacles, N = 15", partial(obstacle_stream, 15, FAST), target=60.0
    ),
    HolonomicCase(
        "wheels + rates + 3 obstacles, N = 30", partial(obstacle_stream, 30, FAST), target=40.0
    ),
)


def case_rows(
    case: Case, process: PeerProcess | None, advance: Callable[[], None]
) -> Iterator[dict]:
    stream = case.stream()
    common = statement(stream[0])
    solvers = {
        "ours": LocalSolver(case.ours()),
        "IPOPT": LocalSolver(Ipopt(common, PAPERS_OPTIONS)),
    }
    if process is not None:
        solvers |= {name: PeerSolver(name, case.name, process) for name in case.peers}
    outcomes = compare(solvers, stream, advance)
    tight = Ipopt(common, TIGHT_OPTIONS)
    optima = [tight(problem) for problem in stream]
    ours = case.ours()
    solutions = [(ours(problem), ours.solution)[1] for problem in stream]
    yield from speed_rows(case, outcomes, [plan[0] for plan in optima])
    yield from exit_rows(case, solutions)
    if isinstance(solutions[0], HolonomicSolution):
        yield from constraint_rows(case, stream, solutions, outcomes)
    yield from agreement_rows(case, stream, solutions, optima)


def speed_rows(case: Case, outcomes: dict[str, Outcome], optima: list) -> Iterator[dict]:
    ours = outcomes["ours"]
    for name, outcome in outcomes.items():
        title, times = f"{case.name}: faster than {name}", outcome.typical / ours.typical
        same = 1.0 if name == "ours" else np.mean(differences(outcome.firsts, optima) <= SAME)
        if same < SAME_SHARE:
            title = f"{title}: not comparable, {same:.0%} of its plans are equal"
            yield row(title, 0.0, "1", "comparable", False)
        elif name == "IPOPT":
            yield ratio(title, times, case.target)
        elif name != "ours":
            yield row(title, times, "1")
        for what, seconds in {
            "undisturbed": outcome.typical,
            "median of calls": median(outcome.seconds),
            "99th percentile": np.percentile(outcome.seconds, 99),
            "first call of a block": median(outcome.seconds[::BLOCK]),
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


def constraint_rows(
    case: Case,
    stream: list[HolonomicProblem],
    solutions: list[HolonomicSolution],
    outcomes: dict[str, Outcome],
) -> Iterator[dict]:
    """Yield the share of steps with active constraints, and the times of these."""
    rates = stream[0].limits.before.any(axis=1)
    name = f"{case.name}: a wheel speed limit is active"
    share = share_of(is_active(solution, ~rates) for solution in solutions)
    if case.limited_target is None:
        yield row(name, share, "of steps")
    else:
        yield at_least(name, share, "of steps", case.limited_target)
    if rates.any():
        share = share_of(is_active(solution, rates) for solution in solutions)
        yield row(f"{case.name}: a wheel acceleration limit is active", share, "of steps")
    if len(stream[0].keep_outs.radii):
        share = share_of(map(is_near, stream, solutions))
        yield row(f"{case.name}: a plan is near an obstacle", share, "of steps")
    constrained = np.array([solution.iterations > 0 for solution in solutions])
    yield row(f"{case.name}: constraints are active", np.mean(constrained), "of steps")
    typical = {k: median(outcome.undisturbed[constrained]) for k, outcome in outcomes.items()}
    for name, seconds in typical.items():
        if name != "ours":
            yield row(f"{case.name}: with active constraints, faster than {name}",
                      seconds / typical["ours"], "1")  # fmt: skip
        yield row(f"{case.name}: with active constraints, {name}, undisturbed",
                  seconds * 1e6, "us")  # fmt: skip


def share_of(flags: Iterable[bool]) -> float:
    return float(np.mean(list(flags)))


def is_active(solution: HolonomicSolution, limits: np.ndarray) -> bool:
    return bool(np.abs(solution.multipliers[:, limits]).max() > ACTIVE)


def is_near(problem: HolonomicProblem, solution: HolonomicSolution) -> bool:
    """Return whether the plan violates the distance to a disc: all constraints are soft."""
    zones = problem.keep_outs
    distances = np.linalg.norm(solution.states[:, :2] - zones.centres, axis=2)
    return bool((distances < zones.radii[:, None]).any())


def agreement_rows(
    case: Case, stream: list[AnyProblem], solutions: list[Any], optima: list[np.ndarray]
) -> Iterator[dict]:
    """Compare the first controls with the optimum, and the costs where they differ."""
    firsts = [first_control(*each) for each in zip(stream, solutions, strict=True)]
    errors = differences(firsts, [controls[0] for controls in optima])
    yield at_least(
        f"{case.name}: first control within 1e-5 of IPOPT's to 1e-10",
        np.mean(errors <= 1e-5), "of steps", 0.99,
    )  # fmt: skip
    yield row(f"{case.name}: largest difference of the first control", errors.max(), "m/s, rad/s")
    costs = np.array([solution.cost for solution in solutions])
    gains = np.array([cost_of(*each) for each in zip(stream, optima, strict=True)]) / costs - 1.0
    other = np.count_nonzero(errors > 1e-5)
    yield row(f"{case.name}: first controls that differ from IPOPT's", other, "steps")
    yield row(f"{case.name}: ours costs less", np.count_nonzero(gains > CHEAPER), "steps")
    yield row(f"{case.name}: IPOPT's costs less", np.count_nonzero(gains < -CHEAPER), "steps")
    yield row(f"{case.name}: IPOPT's costs less by at most", -100.0 * min(gains.min(), 0.0), "%")


def differences(first: list, second: list) -> np.ndarray:
    """Return the largest difference of the controls of every step."""
    return np.abs(np.array(first) - np.array(second)).max(axis=1)


def first_control(
    problem: AnyProblem, solution: UnicycleSolution | HolonomicSolution
) -> np.ndarray:
    """Return the first control as in nmpc_models.py: the body twist of a holonomic robot."""
    if isinstance(solution, UnicycleSolution):
        return solution.controls[0]
    start, end = solution.states[:2].tolist()
    return np.array(twist_between(Pose(*start), Pose(*end), problem.dt))


def cost_of(problem: AnyProblem, controls: np.ndarray) -> float:
    if not isinstance(problem, HolonomicProblem):
        return UnicycleSolution.of(problem, controls, 0, Exit.CAPPED).cost
    poses = [Pose(*problem.start.tolist())]
    for twist in controls.tolist():
        poses.append(move(poses[-1], BodyTwist(*twist), problem.dt))
    velocities = np.diff(poses, axis=0) / problem.dt
    multipliers = np.zeros((len(controls), len(problem.limits.bounds)))
    return HolonomicSolution.of(problem, velocities, multipliers, 0, Exit.CAPPED).cost


def closed_loop_rows() -> Iterator[dict]:
    ours = closed_loop_cost(15, FAST, HolonomicSolver())
    theirs = closed_loop_cost(15, FAST, HolonomicIpopt(IpoptSettings(tolerance=1e-10)))
    yield row("wheels, N = 15: cost of the closed loop", ours, "1")
    yield at_most("wheels, N = 15: cost of the closed loop, from IPOPT's",
                  100.0 * abs(ours / theirs - 1.0), "%", 0.01)  # fmt: skip


def batch_rows() -> Iterator[dict]:
    """Yield the throughput on copies of the stream with different noise."""
    stream = holonomic_stream(15, FAST)
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
    yield row("wheels, N = 15, batch: constraints are active", np.mean(iterations != 0),
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
    """Yield the times of first calls in new processes, with and without cached kernels."""
    unicycle, holonomic = unicycle_stream(15)[0], holonomic_stream(15, FAST)[0]
    calls = {
        "unicycle": (UnicycleSolver().solve, (unicycle, unicycle.feedforward)),
        "wheels": (HolonomicSolver().solve, (holonomic,)),
    }
    for name, call in calls.items():
        with TemporaryDirectory() as cache:
            _, cold = first_call(call, cache)
            imports, warm = zip(*(first_call(call, cache) for _ in range(FIRST_CALLS)), strict=True)
        yield at_most(
            f"{name}: first call, cached kernels, after the import", median(warm), "s", 1.0
        )
        yield row(f"{name}: first call, empty cache, after the import", cold, "s")
        yield row(f"{name}: the import", median(imports), "s")


def first_call(call: tuple, cache: str) -> tuple[float, float]:
    """Return the seconds of the import and of the call, with the kernel cache in ``cache``."""
    run = subprocess.run(
        [sys.executable, "-c", FIRST_CALL], input=pickle.dumps(call), capture_output=True,
        check=True, env=os.environ | {"NUMBA_CACHE_DIR": cache},
    )  # fmt: skip
    imported, called = map(float, run.stdout.split())
    return imported, called


def main() -> None:
    process, rows = PeerProcess.if_available("nmpc"), []
    # refreshed between blocks: a refresh thread would distort the times
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
