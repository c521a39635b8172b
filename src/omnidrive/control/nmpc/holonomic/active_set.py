"""Primal-dual active set method: fast if the active set is found within a few iterations."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.feasible_start import relaxed_bounds
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.riccati import (
    allocate_factors,
    allocate_step,
    factorise_convex,
    newton_step,
)
from omnidrive.control.nmpc.holonomic.stage_point import (
    StagePoint,
    add_scaled,
    allocate_point,
    evaluate,
    gradient_norm,
)

_MAX_ITERATIONS = 8
"""Iterations after which the active set is rarely found: they take less than a third of the time
of the interior-point method."""
_PENALTY = 1e6
"""Penalty of the augmented Lagrangian over the largest weight of J: large enough that one step
reaches the bound to the sixth digit, small enough that ten digits of the multipliers remain."""


@compiled
def solve_active_set(
    p: HolonomicProblem,
    unconstrained: Float[Array, "stages 3"],
    tolerance: float,
    max_iterations: int,
) -> tuple[StagePoint, int]:
    """Solve the problem by Newton steps with the active limits as equality constraints.

    The primal-dual active set method, which is a semismooth Newton method (Hintermuller, Ito &
    Kunisch, SIAM J. Optim. 13, 2002), with the exact Hessian, or with planes in place of keep-out
    zones where the exact one is not positive definite. A violated limit becomes active; an active
    limit whose multiplier has the wrong sign becomes inactive. Active limits are enforced by an
    augmented Lagrangian (Nocedal & Wright, "Numerical Optimization", 2nd ed. 2006, section 17.3).
    There is no line search: the method ends at an optimum or fails.

    Args:
        p: The problem.
        unconstrained: Its optimum without limits and keep-out zones.
        tolerance: Of the KKT conditions.
        max_iterations: Maximum number of iterations; it stops earlier where more rarely help.

    Returns:
        The last iterate, which satisfies all limits if it is the optimum; and the number of
        iterations, or -1 on failure.
    """
    bounds = relaxed_bounds(p)
    stages, rows = bounds.shape
    point, active = allocate_point(unconstrained.copy(), bounds), np.zeros((stages, rows))
    f, step = allocate_factors(stages, rows), allocate_step(stages, rows)
    multipliers = np.zeros((stages, rows))
    penalty = _PENALTY * _largest_weight(p)
    iterations = 0
    while True:
        evaluate(p, point)
        error = _update_active_set(point, active)
        if error <= tolerance and gradient_norm(p.dt, point) <= tolerance:
            return point, iterations
        if iterations >= min(max_iterations, _MAX_ITERATIONS):
            return point, -1
        _fill_multipliers(point, active, penalty, tolerance, f.weights, multipliers)
        if not factorise_convex(p, point, f):
            return point, -1
        newton_step(p, point, f, multipliers, step)
        for k in range(stages):
            for i in range(rows):
                point.multipliers[k, i] = multipliers[k, i] + f.weights[k, i] * step.values[k, i]
        add_scaled(point.velocities, 1.0, step.velocities)
        iterations += 1


@compiled
def _update_active_set(point: StagePoint, active: Float[Array, "stages rows"]) -> float:
    """Update ``active`` (1: upper bound, -1: lower bound, 0: none); return the largest error.

    The error of an active limit is slack x multiplier; infinite if the active set changes or an
    active limit is violated.
    """
    largest = 0.0
    for k in range(active.shape[0]):
        for i in range(active.shape[1]):
            if active[k, i] * point.multipliers[k, i] < 0.0:
                active[k, i], point.multipliers[k, i] = 0.0, 0.0  # still part of point.hessian
                largest = np.inf
            elif active[k, i] != 0.0:
                slack = _slack(point, active, k, i)
                error = slack * max(1.0, abs(point.multipliers[k, i])) if slack >= 0.0 else np.inf
                largest = max(largest, error)
            elif point.slacks[k, i, 0] < 0.0 or point.slacks[k, i, 1] < 0.0:
                active[k, i] = 1.0 if point.slacks[k, i, 0] < 0.0 else -1.0
                largest = np.inf
    return largest


@compiled
def _fill_multipliers(  # noqa: PLR0917
    point: StagePoint,
    active: Float[Array, "stages rows"],
    penalty: float,
    tolerance: float,
    weights: Float[Array, "stages rows"],
    multipliers: Float[Array, "stages rows"],
) -> None:
    """Fill in weights and multipliers of the augmented Lagrangian."""
    for k in range(active.shape[0]):
        for i in range(active.shape[1]):
            weights[k, i], multipliers[k, i] = 0.0, 0.0
            if active[k, i] != 0.0:
                weights[k, i] = penalty
                excess = _slack_margin(point, k, i, tolerance) - _slack(point, active, k, i)
                multipliers[k, i] = point.multipliers[k, i] + penalty * active[k, i] * excess


@compiled
def _slack(point: StagePoint, active: Float[Array, "stages rows"], k: int, i: int) -> float:
    """Return the slack of the active side of a limit."""
    slack: float = point.slacks[k, i, 0] if active[k, i] > 0.0 else point.slacks[k, i, 1]
    return slack


@compiled
def _slack_margin(point: StagePoint, k: int, i: int, tolerance: float) -> float:
    """Return the slack to keep at an active limit, so that rounding does not violate it."""
    multiplier: float = abs(point.multipliers[k, i])
    return 0.1 * tolerance / max(1.0, multiplier)


@compiled
def _largest_weight(p: HolonomicProblem) -> float:
    """Return the largest weight in the cost, of states per square of the sample time."""
    largest = 0.0
    for a in range(3):
        largest = max(largest, p.control_weights[a])
        for k in range(len(p.state_weights)):
            largest = max(largest, p.dt * p.dt * p.state_weights[k, a])
    return largest
