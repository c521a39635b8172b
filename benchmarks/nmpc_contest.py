"""Several solvers on one stream of problems, block by block in turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from nmpc_streams import AnyProblem, numbers, statement
from peer_process import PeerProcess
from timed import timed

from omnidrive.control.nmpc import UnicycleSolution, UnicycleSolver
from omnidrive.control.nmpc.holonomic import HolonomicSolution, HolonomicSolver

ROUNDS, BLOCK = 5, 20  # of the whole stream; steps of one solver in a turn


class Planner(Protocol):
    """A solver and its memory; it is given the problems of a stream in their order."""

    def reset(self) -> None: ...

    def __call__(self, problem: Any) -> np.ndarray:
        """Controls of the plan; ours of the holonomic robot are velocities in W, others twists."""
        ...


@dataclass
class ShiftedSqp:
    """Ours for the unicycle, begun as in its controller: from the last plan, shifted by a stage."""

    solver: UnicycleSolver = field(default_factory=UnicycleSolver)
    solution: UnicycleSolution | None = None

    def reset(self) -> None:
        self.solution = None

    def __call__(self, problem: Any) -> np.ndarray:
        guess = problem.feedforward
        if self.solution is not None:
            guess = np.concatenate([self.solution.controls[1:], guess[-1:]])
        self.solution = self.solver.solve(problem, guess)
        return self.solution.controls


@dataclass
class Holonomic:
    """Ours for the holonomic robot, which needs no memory."""

    solver: HolonomicSolver = field(default_factory=HolonomicSolver)
    solution: HolonomicSolution | None = None

    def reset(self) -> None:
        self.solution = None

    def __call__(self, problem: Any) -> np.ndarray:
        self.solution = self.solver.solve(problem)
        return self.solution.velocities


@dataclass
class Here:
    """A planner in this process."""

    planner: Planner

    def block(self, problems: list[AnyProblem], fresh: bool) -> tuple[list[float], list]:
        """Seconds of every call, and first controls."""
        if fresh:
            self.planner.reset()
        seconds, plans = timed(self.planner, ((problem,) for problem in problems))
        return seconds, [plan[0] for plan in plans]


@dataclass
class There:
    """A planner in the peers' process, which times its calls itself."""

    peer: str
    case: str
    process: PeerProcess

    def block(self, problems: list[AnyProblem], fresh: bool) -> tuple[list[float], list]:
        """Seconds of every call, and first controls."""
        parts = [{name: a.tolist() for name, a in numbers(p).items()} for p in problems]
        request = {"peer": self.peer, "case": self.case, "statement": statement(problems[0])}
        answer = self.process.request(request | {"reset": fresh, "problems": parts})
        return answer["seconds"], answer["controls"]


@dataclass
class Outcome:
    """What one solver did."""

    seconds: list[float] = field(default_factory=list)
    """Of every call, in all rounds."""
    firsts: list = field(default_factory=list)
    """First controls of every step, of the last round."""

    @property
    def typical(self) -> float:
        """Median over the steps of :attr:`undisturbed`."""
        return float(np.median(self.undisturbed))

    @property
    def undisturbed(self) -> np.ndarray:
        """Seconds of every step: the least of its rounds.

        The median of all calls would not do: where others use the machine too, a long call is
        interrupted more often than a short one, which flatters whoever is faster.
        """
        return np.reshape(self.seconds, (ROUNDS, -1)).min(axis=0)


def contest(
    solvers: dict[str, Here | There], stream: list[AnyProblem], advance: Callable[[], None]
) -> dict[str, Outcome]:
    """All solvers on the same problems, after a block that only warms them."""
    for solver in solvers.values():
        solver.block(stream[:BLOCK], fresh=True)
    outcomes = {name: Outcome() for name in solvers}
    for _ in range(ROUNDS):
        for outcome in outcomes.values():
            outcome.firsts = []
        for begin in range(0, len(stream), BLOCK):
            for name, solver in solvers.items():
                seconds, firsts = solver.block(stream[begin : begin + BLOCK], fresh=begin == 0)
                outcomes[name].seconds += seconds
                outcomes[name].firsts += firsts
            advance()
    return outcomes
