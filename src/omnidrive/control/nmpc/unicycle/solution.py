"""Solution of a unicycle problem, with its residual evaluated independently of the solver."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Protocol, runtime_checkable

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.exit import Exit
from omnidrive.control.nmpc.unicycle.problem import UnicycleProblem
from omnidrive.control.nmpc.unicycle.stage_point import evaluate, kkt_residual

Assessment = tuple[Float[Array, "points 3"], float, float]
"""States, J and KKT residual."""


@dataclass(frozen=True, eq=False, slots=True)
class UnicycleSolution:
    """Plan for one :class:`UnicycleProblem`.

    Attributes:
        controls: u_k, within the limits; m/s, rad/s.
        states: x_k, the exact roll-out of ``controls``; m, m, rad.
        cost: J.
        residual: KKT residual of ``controls`` (:func:`~.stage_point.kkt_residual`). At a strict
            minimum a residual r puts each control within about r / 2 of the optimum (R = 1).
        iterations: Number of iterations of the solver.
        exit: Why the solver stopped.
    """

    controls: Float[Array, "stages 2"]
    states: Float[Array, "points 3"]
    cost: float
    residual: float
    iterations: int
    exit: Exit

    @classmethod
    def of(
        cls,
        problem: UnicycleProblem,
        controls: Float[Array, "stages 2"],
        iterations: int,
        exit: Exit,
    ) -> UnicycleSolution:
        """Return the solution with states, cost and residual evaluated from ``controls`` alone."""
        return cls.from_assessment(controls, assess(problem, controls), iterations, exit)

    @classmethod
    def from_assessment(
        cls,
        controls: Float[Array, "stages 2"],
        assessment: Assessment,
        iterations: int,
        exit: Exit,
    ) -> UnicycleSolution:
        """Return the solution from the result of :func:`assess` on ``controls``."""
        states, cost, residual = assessment
        if not isfinite(cost):
            exit = Exit.UNUSABLE
        return cls(controls, states, cost, residual, iterations, exit)


@runtime_checkable
class UnicycleOptimizer(Protocol):
    """Interface of solvers: the same problem and guess give the same solution."""

    def solve(self, problem: UnicycleProblem, guess: Float[Array, "stages 2"]) -> UnicycleSolution:
        """Return a local optimum near ``guess`` (m/s, rad/s); never raise."""
        ...


@compiled
def assess(problem: UnicycleProblem, controls: Float[Array, "stages 2"]) -> Assessment:
    """Return states, cost and KKT residual of ``controls``."""
    point, value = evaluate(problem, controls)
    return point.states, value, kkt_residual(problem, point)
