"""What a solver of holonomic problems returns, with the means to check it."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.iterate import (
    cost,
    evaluate,
    iterate,
    largest_slope,
)
from omnidrive.control.nmpc.holonomic.motion import largest_part, roll_out, twists_of
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.start import bounds_of
from omnidrive.control.nmpc.solution import Exit

Account = tuple[Float[Array, "points 3"], float, float, float]
"""States, J, KKT residual and violation."""


@dataclass(frozen=True, eq=False, slots=True)
class HolonomicSolution:
    """A plan for one :class:`HolonomicProblem`.

    Attributes:
        velocities: v_k in W; m/s, m/s, rad/s.
        states: x_k, the exact roll-out of ``velocities``; m, m, rad.
        multipliers: Of every limit at every stage, in units of J: positive where the upper bound
            holds the robot back, negative where the lower does.
        cost: J.
        residual: Largest entry of the gradient of the Lagrangian and of multiplier x room left.
        violation: By how much the worst limit is exceeded, as a part of its bound; 0 if none is.
        iterations: Of the method that found it; 0 where no limit binds and no keep-out is near.
        exit: Why the solver stopped.
    """

    velocities: Float[Array, "stages 3"]
    states: Float[Array, "points 3"]
    multipliers: Float[Array, "stages wheels"]
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
        """Evaluate a plan afresh, trusting no solver's own account."""
        account = assess(problem, velocities, multipliers)
        return cls.accounted(velocities, multipliers, account, iterations, exit)

    @classmethod
    def accounted(
        cls,
        velocities: Float[Array, "stages 3"],
        multipliers: Float[Array, "stages rows"],
        account: Account,
        iterations: int,
        exit: Exit,
    ) -> HolonomicSolution:
        """Of a plan and what :func:`assess` says of it."""
        states, value, residual, violation = account
        if not isfinite(value + residual + violation):
            exit = Exit.UNUSABLE
        return cls(velocities, states, multipliers, value, residual, violation, iterations, exit)

    def check(self, problem: HolonomicProblem) -> tuple[float, float]:
        """Residual and violation, evaluated afresh."""
        _, _, residual, violation = assess(problem, self.velocities, self.multipliers)
        return residual, violation


@runtime_checkable
class HolonomicPlanner(Protocol):
    """Problem in, solution out; the same problem gives the same solution."""

    def solve(self, problem: HolonomicProblem) -> HolonomicSolution:
        """Local optimum; never raises."""
        ...


@compiled
def assess(
    p: HolonomicProblem,
    velocities: Float[Array, "stages 3"],
    multipliers: Float[Array, "stages rows"],
) -> Account:
    """States, J, KKT residual and violation of a plan, from nothing but the problem."""
    stages, states = len(velocities), roll_out(p, velocities)
    binding = multipliers.any()
    at = iterate(velocities, bounds_of(p) if binding else np.empty((stages, 0)))
    if binding:
        at.pulls[:] = multipliers
    evaluate(p, at)
    residual = largest_slope(p.dt, at)
    for k in range(stages):
        for i in range(at.bounds.shape[1]):
            pull = at.pulls[k, i]
            room = at.rooms[k, i, 0] if pull > 0.0 else at.rooms[k, i, 1]
            residual = max(residual, abs(pull * room))
    violation = max(largest_part(p, twists_of(p, velocities)) - 1.0, 0.0)
    return states, cost(p, states, velocities), residual, violation
