"""Solver of holonomic problems: at once where no wheel is at its limit, else interior-point."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.interior import (
    CAPPED,
    CONVERGED,
    STALLED,
    solve_limited,
)
from omnidrive.control.nmpc.holonomic.limits import within_limits
from omnidrive.control.nmpc.holonomic.linear import unlimited
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.solution import HolonomicSolution
from omnidrive.control.nmpc.solution import Exit
from omnidrive.parameter import Bounds

Array = np.ndarray

_EXITS = {CONVERGED: Exit.CONVERGED, CAPPED: Exit.CAPPED, STALLED: Exit.STALLED}


class InteriorSettings(NamedTuple):
    """When the solver stops."""

    tolerance: Annotated[float, Bounds(1e-12, 1e-2, "1")] = 1e-8
    """Largest entry of the KKT conditions that counts as none."""
    max_iterations: Annotated[int, Bounds(1, 1000, "1")] = 200
    """Interior-point iterations after which the plan so far is returned: it keeps the limits."""


@dataclass(frozen=True, slots=True)
class HolonomicSolver:
    """Finds the optimum of a :class:`HolonomicProblem`.

    Where no wheel reaches its limit the optimum is that of a linear-quadratic problem, found at
    once (:func:`~omnidrive.control.nmpc.holonomic.linear.unlimited`) and accepted only if every
    wheel can follow it. Elsewhere an interior-point method goes on from it.
    """

    settings: InteriorSettings = field(default_factory=InteriorSettings)

    def solve(self, problem: HolonomicProblem) -> HolonomicSolution:
        """Local optimum, reached from the optimum without limits; never raises."""
        velocities, multipliers, iterations, code = _minimise(problem, *self.settings)
        return HolonomicSolution.of(problem, velocities, multipliers, iterations, _EXITS[code])

    def solve_many(
        self, problems: HolonomicProblem
    ) -> tuple[Float[Array, "problems stages 3"], Int[Array, " problems"]]:
        """Velocities and iterations of many problems of one shape.

        Args:
            problems: ``start``, ``targets`` and ``feedforward`` have one axis more, the first, over
                the problems; the rest is theirs in common.

        Returns:
            Velocities, and interior-point iterations: negative where they did not converge.
        """
        return _minimise_many(problems, *self.settings)


@compiled
def _minimise(
    p: HolonomicProblem, tolerance: float, max_iterations: int
) -> tuple[Float[Array, "stages 3"], Float[Array, "stages wheels"], int, int]:
    velocities = unlimited(p)
    if not within_limits(p, velocities) > 1.0:
        return velocities, np.zeros((len(velocities), len(p.limits))), 0, CONVERGED
    at, iterations, code = solve_limited(p, velocities, tolerance, max_iterations)
    return at.velocities, at.multipliers[:, :, 0] - at.multipliers[:, :, 1], iterations, code


@compiled
def _minimise_many(
    p: HolonomicProblem, tolerance: float, max_iterations: int
) -> tuple[Float[Array, "problems stages 3"], Int[Array, " problems"]]:
    velocities, iterations = np.empty(p.feedforward.shape), np.empty(len(p.start), dtype=np.int64)
    for k in range(len(p.start)):
        one = HolonomicProblem(
            p.dt,
            p.start[k],
            p.targets[k],
            p.feedforward[k],
            p.state_weights,
            p.control_weights,
            p.wheels,
            p.limits,
        )
        found, _, spent, code = _minimise(one, tolerance, max_iterations)
        velocities[k] = found
        iterations[k] = spent if code == CONVERGED else -spent
    return velocities, iterations
