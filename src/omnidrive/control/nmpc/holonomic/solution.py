"""What a solver of holonomic problems returns, with the means to check it."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.limits import reduced_gradient
from omnidrive.control.nmpc.holonomic.motion import cost, roll_out, wheel_speed_slopes
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.solution import Exit

Array = np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class HolonomicSolution:
    """A plan for one :class:`HolonomicProblem`.

    Attributes:
        velocities: v_k in W; m/s, m/s, rad/s.
        states: x_k, the exact roll-out of ``velocities``; m, m, rad.
        multipliers: Of every wheel's limit at every stage, in units of J: positive where the upper
            limit holds the wheel back, negative where the lower does.
        cost: J.
        residual: Largest entry of the gradient of the Lagrangian and of multiplier x room left.
        violation: By how much the worst wheel exceeds its limit, as a part of it; 0 if none does.
        iterations: Of the interior-point method; 0 where no limit binds.
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
        multipliers: Float[Array, "stages wheels"],
        iterations: int,
        exit: Exit,
    ) -> HolonomicSolution:
        """Evaluate a plan afresh, trusting no solver's own account."""
        residual, violation = assess(problem, velocities, multipliers)
        states = roll_out(problem, velocities)
        value = cost(problem, states, velocities)
        if not isfinite(value + residual + violation):
            exit = Exit.UNUSABLE
        return cls(velocities, states, multipliers, value, residual, violation, iterations, exit)

    def check(self, problem: HolonomicProblem) -> tuple[float, float]:
        """Residual and violation, evaluated afresh."""
        return assess(problem, self.velocities, self.multipliers)


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
    multipliers: Float[Array, "stages wheels"],
) -> tuple[float, float]:
    """KKT residual and violation of a plan, from nothing but the problem."""
    stages, wheels = len(velocities), len(p.limits)
    slopes, bends, yaw = np.empty((stages, wheels, 4)), np.empty((4, 4)), p.start[2]
    residual, violation = 0.0, 0.0
    for k in range(stages):
        stage = (yaw, velocities[k, 0], velocities[k, 1], velocities[k, 2])
        for w in range(wheels):
            speed = wheel_speed_slopes(p, w, stage, slopes[k, w], bends) / p.limits[w]
            slopes[k, w] /= p.limits[w]
            violation = max(violation, abs(speed) - 1.0)
            room = 1.0 - speed if multipliers[k, w] > 0.0 else 1.0 + speed
            residual = max(residual, abs(multipliers[k, w]) * abs(room))
        yaw += p.dt * velocities[k, 2]
    gradient = reduced_gradient(p, velocities, slopes, multipliers)
    return max(residual, np.abs(gradient).max()), violation
