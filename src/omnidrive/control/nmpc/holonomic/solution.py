"""Solution of a holonomic problem, with its residual evaluated independently of the solver."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.exit import Exit
from omnidrive.control.nmpc.holonomic.feasible_start import relaxed_bounds
from omnidrive.control.nmpc.holonomic.motion import max_limit_ratio, roll_out, stage_twists
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.stage_point import (
    allocate_point,
    cost,
    evaluate,
    gradient_norm,
    overwrite,
)

Assessment = tuple[Float[Array, "points 3"], float, float, float]
"""States, J, KKT residual and violation."""


@dataclass(frozen=True, eq=False, slots=True)
class HolonomicSolution:
    """Plan for one :class:`HolonomicProblem`.

    Attributes:
        velocities: v_k in W; m/s, m/s, rad/s.
        states: x_k, the exact roll-out of ``velocities``; m, m, rad.
        multipliers: Lagrange multipliers of the limits of every stage, in the unit of J: positive
            if the upper bound is active, negative if the lower bound is active.
        cost: J.
        residual: Largest entry of the gradient of the Lagrangian and of multiplier x slack.
        violation: Largest excess over a bound, relative to the bound; 0 if all limits hold.
        iterations: Iterations of the method that found the plan; 0 if no limit is active and no
            keep-out zone is near.
        exit: Why the solver stopped.
    """

    velocities: Float[Array, "stages 3"]
    states: Float[Array, "points 3"]
    multipliers: Float[Array, "stages rows"]
    cost: float
    residual: float
    violation: float
    iterations: int
    exit: Exit

    @classmethod
    def of(
        cls,
        problem: HolonomicProblem,
        velocities: Float[Array, "stages 3"],
        multipliers: Float[Array, "stages rows"],
        iterations: int,
        exit: Exit,
    ) -> HolonomicSolution:
        """Return the solution with all else evaluated from velocities and multipliers alone."""
        assessment = assess(problem, velocities, multipliers)
        return cls.from_assessment(velocities, multipliers, assessment, iterations, exit)

    @classmethod
    def from_assessment(
        cls,
        velocities: Float[Array, "stages 3"],
        multipliers: Float[Array, "stages rows"],
        assessment: Assessment,
        iterations: int,
        exit: Exit,
    ) -> HolonomicSolution:
        """Return the solution from the result of :func:`assess`."""
        states, value, residual, violation = assessment
        if not isfinite(value + residual + violation):
            exit = Exit.UNUSABLE
        return cls(velocities, states, multipliers, value, residual, violation, iterations, exit)

    def check(self, problem: HolonomicProblem) -> tuple[float, float]:
        """Evaluate residual and violation again, and return them."""
        _, _, residual, violation = assess(problem, self.velocities, self.multipliers)
        return residual, violation


@runtime_checkable
class HolonomicOptimizer(Protocol):
    """Interface of solvers: the same problem gives the same solution."""

    def solve(self, problem: HolonomicProblem) -> HolonomicSolution:
        """Return a local optimum; never raise."""
        ...


@compiled
def assess(
    p: HolonomicProblem,
    velocities: Float[Array, "stages 3"],
    multipliers: Float[Array, "stages rows"],
) -> Assessment:
    """Return states, J, KKT residual and violation of a plan, computed from the problem alone."""
    stages, states = len(velocities), roll_out(p, velocities)
    active = multipliers.any()
    point = allocate_point(velocities, relaxed_bounds(p) if active else np.empty((stages, 0)))
    if active:
        overwrite(point.multipliers, multipliers)
    evaluate(p, point)
    residual = gradient_norm(p.dt, point)
    for k in range(stages):
        for i in range(point.bounds.shape[1]):
            multiplier = point.multipliers[k, i]
            slack = point.slacks[k, i, 0] if multiplier > 0.0 else point.slacks[k, i, 1]
            residual = max(residual, abs(multiplier * slack))
    violation = max(max_limit_ratio(p, stage_twists(p, velocities)) - 1.0, 0.0)
    return states, cost(p, states, velocities), residual, violation
