"""Comparison of solvers on one stream of problems, in alternating blocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from nmpc_streams import AnyProblem, numbers, statement
from peer_process import PeerProcess
from timing import time_calls

from omnidrive.control.nmpc import UnicycleSolution, UnicycleSolver
from omnidrive.control.nmpc.holonomic import HolonomicSolution, HolonomicSolver

ROUNDS, BLOCK = 5, 20  # repetitions of the stream; consecutive steps of one solver


class StreamSolver(Protocol):
    """Solver with memory, called with the problems of a stream in their order."""

    def reset(self) -> None: ...

    def __call__(self, problem: Any) -> np.ndarray:
        """Return the controls: velocities in W from ``HolonomicStream``, twists from peers."""
        ...


@dataclass
class UnicycleStream:
    """omnidrive's unicycle solver, with the shifted last plan as guess, as in its controller."""

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
class HolonomicStream:
    """omnidrive's holonomic solver, which needs no guess."""

    solver: HolonomicSolver = field(default_factory=HolonomicSolver)
    solution: HolonomicSolution | None = None

    def reset(self) -> None:
        self.solution = None

    def __call__(self, problem: Any) -> np.ndarray:
        self.solution = self.solver.solve(problem)
        return self.solution.velocities


@dataclass
class LocalSolver:
    """A solver in this process."""

    solver: StreamSolver

    def block(self, problems: list[AnyProblem], fresh: bool) -> tuple[list[float], list]:
        """Return the seconds of every call, and the first controls."""
        if fresh:
            self.solver.reset()
        seconds, plans = time_calls(self.solver, ((problem,) for problem in problems))
        return seconds, [plan[0] for plan in plans]


@dataclass
class PeerSolver:
    """A solver in the peers' process, which times its calls itself."""

    peer: str
    case: str
    process: PeerProcess

    def block(self, problems: list[AnyProblem], fresh: bool) -> tuple[list[float], list]:
        """Return the seconds of every call, and the first controls."""
        parts = [{name: a.tolist() for name, a in numbers(p).items()} for p in problems]
        request = {"peer": self.peer, "case": self.case, "statement": statement(problems[0])}
        answer = self.process.request(request | {"reset": fresh, "problems": parts})
        return answer["seconds"], answer["controls"]


@dataclass
class Outcome:
    """Times and results of one solver."""

    seconds: list[float] = field(default_factory=list)
    """Of every call, in all rounds, in s."""
    firsts: list = field(default_factory=list)
    """First controls of every step of the last round."""

    @property
    def typical(self) -> float:
        """Median over the steps of :attr:`undisturbed`, in s."""
        return float(np.median(self.undisturbed))

    @property
    def undisturbed(self) -> np.ndarray:
        """Shortest time of every step over the rounds, in s.

        The median of all calls would be biased: on a shared machine a long call is interrupted
        more often than a short one, which favours the faster solver.
        """
        return np.reshape(self.seconds, (ROUNDS, -1)).min(axis=0)


def compare(
    solvers: dict[str, LocalSolver | PeerSolver],
    stream: list[AnyProblem],
    advance: Callable[[], None],
) -> dict[str, Outcome]:
    """Run all solvers on the same problems, after a block that warms them up."""
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
