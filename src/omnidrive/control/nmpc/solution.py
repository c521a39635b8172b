"""What a solver returns, with the means to check it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import isfinite
from typing import Protocol, runtime_checkable

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc import unicycle
from omnidrive.control.nmpc.problem import Problem


class Exit(Enum):
    """Why the solver stopped; the value is the message."""

    CONVERGED = "the KKT residual is below the tolerance"
    CAPPED = "the iteration cap was reached first"
    LATE = "the deadline was reached first"
    STALLED = "no step lowers the cost any further, yet the KKT residual is above the tolerance"
    UNUSABLE = "the problem or its solution is not finite"


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """A plan for one :class:`Problem`.

    Attributes:
        controls: u_k, within the limits; m/s, rad/s.
        states: x_k, the exact roll-out of ``controls``; m, m, rad.
        cost: J.
        residual: KKT residual of ``controls`` (:func:`unicycle.kkt_residual`). At a strict
            minimum a residual r puts each control within about r / 2 of the optimum (R = 1).
        iterations: What the solver spent.
        exit: Why it stopped.
    """

    controls: Float[Array, "stages 2"]
    states: Float[Array, "points 3"]
    cost: float
    residual: float
    iterations: int
    exit: Exit

    @classmethod
    def of(
        cls, problem: Problem, controls: Float[Array, "stages 2"], iterations: int, exit: Exit
    ) -> Solution:
        """Evaluate ``controls`` on ``problem`` afresh, trusting no solver's own account."""
        return cls.assessed(controls, unicycle.assess(problem, controls), iterations, exit)

    @classmethod
    def assessed(
        cls,
        controls: Float[Array, "stages 2"],
        assessment: tuple[Float[Array, "points 3"], float, float],
        iterations: int,
        exit: Exit,
    ) -> Solution:
        """Of controls that :func:`unicycle.assess` has assessed."""
        states, cost, residual = assessment
        if not isfinite(cost):
            exit = Exit.UNUSABLE
        return cls(controls, states, cost, residual, iterations, exit)


@runtime_checkable
class Solver(Protocol):
    """Problem in, solution out; the same problem and guess give the same solution."""

    def solve(self, problem: Problem, guess: Float[Array, "stages 2"]) -> Solution:
        """Improve ``guess`` (m/s, rad/s) until it is optimal; never raise."""
        ...
