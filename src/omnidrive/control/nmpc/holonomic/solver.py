"""Solver of holonomic problems: linear-quadratic, active set, then interior point."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.exit import CAPPED, CONVERGED, EXITS, Exit
from omnidrive.control.nmpc.holonomic.active_set import solve_active_set
from omnidrive.control.nmpc.holonomic.interior_point import InteriorPoint, initialize, iterate
from omnidrive.control.nmpc.holonomic.keep_out_cost import keep_out_cost
from omnidrive.control.nmpc.holonomic.lqr import unconstrained_velocities
from omnidrive.control.nmpc.holonomic.motion import max_limit_ratio, roll_out, stage_twists
from omnidrive.control.nmpc.holonomic.other_side import RELEASE, block_side, crossed_zone, replaces
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, KeepOutArrays, Limits
from omnidrive.control.nmpc.holonomic.solution import Assessment, HolonomicSolution, assess
from omnidrive.control.nmpc.holonomic.stage_point import cost
from omnidrive.errors import InvalidInput
from omnidrive.parameter import Bounds

_BLOCK = 4
"""Iterations between two checks of the deadline."""
_NO_PLAN = np.empty((0, 3))


class HolonomicSolverSettings(NamedTuple):
    """Stopping criteria of :class:`HolonomicSolver`."""

    tolerance: Annotated[float, Bounds(1e-12, 1e-2, "1")] = 1e-8
    """KKT residual below which a plan counts as converged."""
    max_iterations: Annotated[int, Bounds(1, 1000, "1")] = 200
    """Number of iterations of each method, after which the latest iterate of the interior-point
    method is returned; it satisfies the limits."""


@dataclass(frozen=True, slots=True)
class HolonomicSolver:
    """Solver of :class:`HolonomicProblem`, compiled.

    The optimum without limits is that of a linear-quadratic problem
    (:func:`~omnidrive.control.nmpc.holonomic.lqr.unconstrained_velocities`); it is the solution if
    it satisfies all limits and keeps its distance from all keep-out zones. Otherwise an active set
    method is tried (:func:`~omnidrive.control.nmpc.holonomic.active_set.solve_active_set`), and if
    that does not converge within a few iterations, an interior-point method
    (:func:`~omnidrive.control.nmpc.holonomic.interior_point.iterate`).

    A plan that passes a keep-out zone on the other side of its centre than the optimum without
    limits may not be the best one. Then the interior-point method starts again, until its
    iterates are near an optimum without the side of the plan
    (:func:`~omnidrive.control.nmpc.holonomic.other_side.block_side`), and goes on without this
    condition. The cheaper plan is the solution.

    Attributes:
        settings: Stopping criteria.
        deadline: Time after which the latest iterate is returned, in s from the call; None: no
            deadline. Every iterate returned satisfies the limits.

    Raises:
        InvalidInput: The deadline is negative.
    """

    settings: HolonomicSolverSettings = field(default_factory=HolonomicSolverSettings)
    deadline: float | None = None

    def __post_init__(self) -> None:
        if self.deadline is not None and not self.deadline >= 0.0:
            raise InvalidInput(f"a deadline must not be negative, got {self.deadline:g} s")

    def solve(
        self, problem: HolonomicProblem, latest: Float[Array, "later 3"] = _NO_PLAN
    ) -> HolonomicSolution:
        """Return the better of the local optima that are found; never raise.

        Args:
            problem: The problem.
            latest: Velocities of the latest plan from now on, which decide between optima of nearly
                the same cost: :func:`~.other_side.replaces`. Empty: there is none.
        """
        if self.deadline is not None:
            return self._solve_by(perf_counter() + self.deadline, problem, latest)
        velocities, multipliers, assessment, iterations, code = _solve_holonomic(
            *problem[:-2], *problem.limits, *problem.keep_outs, latest, *self.settings
        )
        return HolonomicSolution.from_assessment(
            velocities, multipliers, assessment, iterations, EXITS[code]
        )

    def _solve_by(
        self, deadline: float, problem: HolonomicProblem, latest: Float[Array, "later 3"]
    ) -> HolonomicSolution:
        unconstrained = unconstrained_velocities(problem)
        if not violates_constraints(problem, unconstrained):
            multipliers = np.zeros((len(unconstrained), len(problem.limits.bounds)))
            return HolonomicSolution.of(problem, unconstrained, multipliers, 0, Exit.CONVERGED)
        plan = self._first_by(deadline, problem, unconstrained)
        states = roll_out(problem, unconstrained)
        j, k = crossed_zone(problem, states, plan.states)
        if j < 0 or plan.exit is not Exit.CONVERGED:
            return plan
        blocked = block_side(problem, plan.states, j, k)
        ip = initialize(blocked, unconstrained, self.settings.tolerance)
        exit = self._iterate_by(deadline, blocked, ip, RELEASE * plan.cost)
        if exit is Exit.CONVERGED:
            exit = self._iterate_by(deadline, problem, ip, self.settings.tolerance)
        other = _solution(problem, ip, exit)
        velocities = plan.velocities, plan.cost, other.velocities, other.cost
        better = exit is Exit.CONVERGED and replaces(problem, *velocities, latest)
        return other if better else plan

    def _first_by(
        self, deadline: float, problem: HolonomicProblem, unconstrained: Float[Array, "stages 3"]
    ) -> HolonomicSolution:
        if perf_counter() < deadline:  # a few sweeps, without checking the clock between them
            point, iterations = solve_active_set(problem, unconstrained, *self.settings)
            if iterations >= 0:
                return HolonomicSolution.of(
                    problem, point.velocities, point.multipliers, iterations, Exit.CONVERGED
                )
        ip = initialize(problem, unconstrained, self.settings.tolerance)
        exit = self._iterate_by(deadline, problem, ip, self.settings.tolerance)
        return _solution(problem, ip, exit)

    def _iterate_by(
        self, deadline: float, problem: HolonomicProblem, ip: InteriorPoint, tolerance: float
    ) -> Exit:
        """Iterate while there is time for as much as the last block took."""
        before, max_iterations = perf_counter(), self.settings.max_iterations
        until = int(ip.progress[0]["iterations"])
        while until < max_iterations and 2.0 * perf_counter() - before <= deadline:
            before, until = perf_counter(), min(until + _BLOCK, max_iterations)
            code = iterate(problem, ip, tolerance, until)
            if code != CAPPED or until == max_iterations:
                return EXITS[code]
        return Exit.LATE

    def precompile(self, problem: HolonomicProblem) -> None:
        """Compile or load all kernels that :meth:`solve` with a deadline calls."""
        velocities, (tolerance, max_iterations) = unconstrained_velocities(problem), self.settings
        violates_constraints(problem, velocities)
        solve_active_set(problem, velocities, tolerance, max_iterations)
        iterate(problem, initialize(problem, velocities, tolerance), tolerance, 1)
        states = roll_out(problem, velocities)
        crossed_zone(problem, states, states)
        if len(problem.keep_outs.radii):
            block_side(problem, states, 0, 1)
        replaces(problem, velocities, 0.0, velocities, 0.0, _NO_PLAN)

    def solve_many(
        self, problems: HolonomicProblem
    ) -> tuple[Float[Array, "problems stages 3"], Int[Array, " problems"]]:
        """Solve many problems with common weights, limits and keep-out zones.

        Args:
            problems: ``start``, ``previous``, ``targets`` and ``feedforward`` have a leading axis
                over the problems; all other fields are common to them.

        Returns:
            Velocities; and for each problem the number of iterations n, or -1 - n if it did not
            converge.
        """
        return _solve_many(problems, *self.settings)


def _solution(problem: HolonomicProblem, ip: InteriorPoint, exit: Exit) -> HolonomicSolution:
    """Return the iterate of the interior-point method."""
    iterations = int(ip.progress[0]["iterations"])
    return HolonomicSolution.of(
        problem, ip.point.velocities, ip.point.multipliers, iterations, exit
    )


@compiled
def _solve_holonomic(  # noqa: PLR0917
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
    inertial: bool,
    corners: Float[Array, "corners 2"],
    first: Int[Array, " starts"],
    radii: Float[Array, " zones"],
    weights: Float[Array, " zones"],
    centres: Float[Array, "zones points 2"],
    latest: Float[Array, "later 3"],
    tolerance: float,
    max_iterations: int,
) -> tuple[Float[Array, "stages 3"], Float[Array, "stages rows"], Assessment, int, int]:
    """Return velocities, multipliers, assessment, iterations and exit code.

    The fields of the problem are separate arguments because a call with a tuple takes longer.
    """
    p = HolonomicProblem(
        dt,
        start,
        previous,
        targets,
        feedforward,
        state_weights,
        control_weights,
        Limits(now, before, bounds, inertial),
        KeepOutArrays(corners, first, radii, weights, centres),
    )
    velocities, multipliers, iterations, code = minimise(p, latest, tolerance, max_iterations)
    return velocities, multipliers, assess(p, velocities, multipliers), iterations, code


Optimum = tuple[Float[Array, "stages 3"], Float[Array, "stages rows"], int, int]
"""Velocities and multipliers of a local optimum, iterations and exit code."""


@compiled
def minimise(
    p: HolonomicProblem, latest: Float[Array, "later 3"], tolerance: float, max_iterations: int
) -> Optimum:
    """Return the better of the local optima that are found, see :meth:`HolonomicSolver.solve`."""
    unconstrained = unconstrained_velocities(p)
    if not violates_constraints(p, unconstrained):
        return unconstrained, np.zeros((len(unconstrained), len(p.limits.bounds))), 0, CONVERGED
    first = _first_optimum(p, unconstrained, tolerance, max_iterations)
    if len(p.keep_outs.radii) == 0 or first[3] != CONVERGED:
        return first
    states = roll_out(p, first[0])
    j, k = crossed_zone(p, roll_out(p, unconstrained), states)
    if j < 0:
        return first
    blocked, first_cost = block_side(p, states, j, k), cost(p, states, first[0])
    ip = initialize(blocked, unconstrained, tolerance)
    code = iterate(blocked, ip, RELEASE * first_cost, max_iterations)
    if code == CONVERGED:
        code = iterate(p, ip, tolerance, max_iterations)
    other = ip.point.velocities
    if code == CONVERGED:
        other_cost = cost(p, roll_out(p, other), other)
        if replaces(p, first[0], first_cost, other, other_cost, latest):
            return other, ip.point.multipliers, int(ip.progress[0]["iterations"]), code
    return first


@compiled
def _first_optimum(
    p: HolonomicProblem,
    unconstrained: Float[Array, "stages 3"],
    tolerance: float,
    max_iterations: int,
) -> Optimum:
    """Return the local optimum that is reached from the optimum without limits."""
    point, iterations = solve_active_set(p, unconstrained, tolerance, max_iterations)
    if iterations >= 0:
        return point.velocities, point.multipliers, iterations, CONVERGED
    ip = initialize(p, unconstrained, tolerance)
    code = iterate(p, ip, tolerance, max_iterations)
    return ip.point.velocities, ip.point.multipliers, int(ip.progress[0]["iterations"]), code


@compiled
def violates_constraints(p: HolonomicProblem, velocities: Float[Array, "stages 3"]) -> bool:
    """Return whether a plan violates a limit or the distance to a keep-out zone."""
    if max_limit_ratio(p, stage_twists(p, velocities)) > 1.0:
        return True
    return keep_out_cost(p.keep_outs, roll_out(p, velocities)) > 0.0


@compiled
def _solve_many(
    p: HolonomicProblem, tolerance: float, max_iterations: int
) -> tuple[Float[Array, "problems stages 3"], Int[Array, " problems"]]:
    velocities, iterations = np.empty(p.feedforward.shape), np.empty(len(p.start), dtype=np.int64)
    latest = np.empty((0, 3))
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
        found, _, spent, code = minimise(one, latest, tolerance, max_iterations)
        velocities[k] = found
        converged = code == CONVERGED and np.isfinite(found).all()
        iterations[k] = spent if converged else -1 - spent
    return velocities, iterations
