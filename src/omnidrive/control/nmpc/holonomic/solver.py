"""Solver of holonomic problems: at once where nothing is in the way, else in two attempts."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.active_set import hold_limits
from omnidrive.control.nmpc.holonomic.distance import keep_out_cost
from omnidrive.control.nmpc.holonomic.interior import CAPPED, CONVERGED, STALLED, advance, begin
from omnidrive.control.nmpc.holonomic.linear import unlimited
from omnidrive.control.nmpc.holonomic.motion import largest_part, roll_out, twists_of
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, KeepOuts, Limits
from omnidrive.control.nmpc.holonomic.solution import Account, HolonomicSolution, assess
from omnidrive.control.nmpc.solution import Exit
from omnidrive.errors import InvalidInput
from omnidrive.parameter import Bounds

_BETWEEN_LOOKS = 4
"""Iterations between two looks at the clock, where there is a deadline."""
_EXITS = {CONVERGED: Exit.CONVERGED, CAPPED: Exit.CAPPED, STALLED: Exit.STALLED}


class InteriorSettings(NamedTuple):
    """When the solver stops."""

    tolerance: Annotated[float, Bounds(1e-12, 1e-2, "1")] = 1e-8
    """Largest entry of the KKT conditions that counts as none."""
    max_iterations: Annotated[int, Bounds(1, 1000, "1")] = 200
    """Iterations of each method; after those of the interior-point method the plan so far is
    returned: it keeps the limits."""


@dataclass(frozen=True, slots=True)
class HolonomicSolver:
    """Finds the optimum of a :class:`HolonomicProblem`.

    Where nothing is in the way the optimum is that of a linear-quadratic problem, found at
    once (:func:`~omnidrive.control.nmpc.holonomic.linear.unlimited`) and accepted only if every
    limit allows it and it stays out of all keep-outs. Elsewhere Newton's method holds the limits
    that bind (:func:`~omnidrive.control.nmpc.holonomic.active_set.hold_limits`), and where it does
    not end soon an interior-point method begins anew.

    Attributes:
        settings: When it stops.
        deadline: Time after which the plan so far is returned, in s from the call; None: never.
            Every plan keeps the limits, and each step towards the optimum is one for the better.
    """

    settings: InteriorSettings = field(default_factory=InteriorSettings)
    deadline: float | None = None

    def __post_init__(self) -> None:
        if self.deadline is not None and not self.deadline >= 0.0:
            raise InvalidInput(f"a deadline must not be negative, got {self.deadline:g} s")

    def solve(self, problem: HolonomicProblem) -> HolonomicSolution:
        """Local optimum, reached from the optimum without limits; never raises."""
        if self.deadline is not None:
            return self._solve_by(perf_counter() + self.deadline, problem)
        velocities, multipliers, account, iterations, code = _solve(
            *problem[:-2], *problem.limits, *problem.keep_outs, *self.settings
        )
        return HolonomicSolution.accounted(
            velocities, multipliers, account, iterations, _EXITS[code]
        )

    def _solve_by(self, deadline: float, problem: HolonomicProblem) -> HolonomicSolution:
        tolerance, most = self.settings
        velocities = unlimited(problem)
        if not is_obstructed(problem, velocities):
            none = np.zeros((len(velocities), len(problem.limits.bounds)))
            return HolonomicSolution.of(problem, velocities, none, 0, Exit.CONVERGED)
        if perf_counter() < deadline:  # a few sweeps, without another look at the clock
            at, iterations = hold_limits(problem, velocities, *self.settings)
            if iterations >= 0:
                done = Exit.CONVERGED
                return HolonomicSolution.of(problem, at.velocities, at.pulls, iterations, done)
        before = perf_counter()
        search, until, exit = begin(problem, velocities, tolerance), 0, Exit.LATE
        while until < most and 2.0 * perf_counter() - before <= deadline:  # time for as much again
            before, until = perf_counter(), min(until + _BETWEEN_LOOKS, most)
            code = advance(problem, search, tolerance, until)
            if code != CAPPED or until == most:
                exit = _EXITS[code]
                break
        multipliers = search.at.pulls
        iterations = int(search.memory[2])
        return HolonomicSolution.of(problem, search.at.velocities, multipliers, iterations, exit)

    def load(self, problem: HolonomicProblem) -> None:
        """Compile, or load, all that a deadline might cut off while a robot drives."""
        velocities, (tolerance, most) = unlimited(problem), self.settings
        is_obstructed(problem, velocities)
        hold_limits(problem, velocities, tolerance, most)
        advance(problem, begin(problem, velocities, tolerance), tolerance, 1)

    def solve_many(
        self, problems: HolonomicProblem
    ) -> tuple[Float[Array, "problems stages 3"], Int[Array, " problems"]]:
        """Velocities and iterations of many problems of one shape.

        Args:
            problems: ``start``, ``previous``, ``targets`` and ``feedforward`` have one axis more,
                the first, over the problems; the rest is theirs in common.

        Returns:
            Velocities; iterations n as in a solution, or -1 - n where they did not converge.
        """
        return _minimise_many(problems, *self.settings)


@compiled
def _solve(  # noqa: PLR0917
    dt: float,
    start: Float[Array, " 3"],
    previous: Float[Array, " 3"],
    targets: Float[Array, "points 3"],
    feedforward: Float[Array, "stages 3"],
    state_weights: Float[Array, "points 3"],
    control_weights: Float[Array, " 3"],
    now: Float[Array, "rows 3"],
    before: Float[Array, "rows 3"],
    bounds: Float[Array, " rows"],
    corners: Float[Array, "corners 2"],
    first: Int[Array, " starts"],
    radii: Float[Array, " places"],
    weights: Float[Array, " places"],
    centres: Float[Array, "places points 2"],
    tolerance: float,
    max_iterations: int,
) -> tuple[Float[Array, "stages 3"], Float[Array, "stages rows"], Account, int, int]:
    """A plan and its account; a problem's fields are quicker to take one by one."""
    p = HolonomicProblem(
        dt,
        start,
        previous,
        targets,
        feedforward,
        state_weights,
        control_weights,
        Limits(now, before, bounds),
        KeepOuts(corners, first, radii, weights, centres),
    )
    velocities, multipliers, iterations, code = _minimise(p, tolerance, max_iterations)
    return velocities, multipliers, assess(p, velocities, multipliers), iterations, code


@compiled
def _minimise(
    p: HolonomicProblem, tolerance: float, max_iterations: int
) -> tuple[Float[Array, "stages 3"], Float[Array, "stages rows"], int, int]:
    velocities = unlimited(p)
    if not is_obstructed(p, velocities):
        return velocities, np.zeros((len(velocities), len(p.limits.bounds))), 0, CONVERGED
    at, iterations = hold_limits(p, velocities, tolerance, max_iterations)
    if iterations >= 0:
        return at.velocities, at.pulls, iterations, CONVERGED
    search = begin(p, velocities, tolerance)
    code = advance(p, search, tolerance, max_iterations)
    return search.at.velocities, search.at.pulls, int(search.memory[2]), code


@compiled
def is_obstructed(p: HolonomicProblem, velocities: Float[Array, "stages 3"]) -> bool:
    """Whether a plan needs more than a limit allows, or comes too near a keep-out."""
    if largest_part(p, twists_of(p, velocities)) > 1.0:
        return True
    return keep_out_cost(p.keep_outs, roll_out(p, velocities)) > 0.0


@compiled
def _minimise_many(
    p: HolonomicProblem, tolerance: float, max_iterations: int
) -> tuple[Float[Array, "problems stages 3"], Int[Array, " problems"]]:
    velocities, iterations = np.empty(p.feedforward.shape), np.empty(len(p.start), dtype=np.int64)
    for k in range(len(p.start)):
        one = HolonomicProblem(
            p.dt,
            p.start[k],
            p.previous[k],
            p.targets[k],
            p.feedforward[k],
            p.state_weights,
            p.control_weights,
            p.limits,
            p.keep_outs,
        )
        found, _, spent, code = _minimise(one, tolerance, max_iterations)
        velocities[k] = found
        done = code == CONVERGED and np.isfinite(found).all()
        iterations[k] = spent if done else -1 - spent
    return velocities, iterations
