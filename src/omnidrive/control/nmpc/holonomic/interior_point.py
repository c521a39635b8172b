"""Primal-dual interior-point method whose Newton steps are Riccati sweeps."""

from __future__ import annotations

from math import log
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.exit import CAPPED, CONVERGED, STALLED
from omnidrive.control.nmpc.holonomic.feasible_start import feasible_velocities, relaxed_bounds
from omnidrive.control.nmpc.holonomic.motion import (
    earlier_twist,
    limit_value,
    roll_out,
    stage_twists,
)
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.riccati import (
    MAX_SHIFT,
    Factors,
    Step,
    allocate_factors,
    allocate_step,
    factorise_shifted,
    newton_step,
)
from omnidrive.control.nmpc.holonomic.stage_point import (
    StagePoint,
    add_scaled,
    allocate_point,
    cost,
    evaluate,
    gradient_norm,
    lower_bound,
    overwrite,
)

_TO_BOUNDARY = 0.995
"""Fraction of the distance to a bound that a step may take (Nocedal & Wright, 2006, sec. 19.2)."""
_BARRIER_PER_GRADIENT = 1e-3
"""Least barrier per unit of the Lagrangian's gradient, up to the mean complementarity: if
complementarity converged faster than the gradient, which is possible while the Hessian is shifted,
the iterates would make short steps along the limits (Wright, "Primal-Dual Interior-Point Methods",
1997, chapter 6, bounds the same ratio). With ten times this value steps make no progress; with a
third of it the method converges less often."""
_MAX_HALVINGS = 30
_ARMIJO = 1e-4
"""Sufficient decrease, as a part of the predicted one (Nocedal & Wright, 2006, section 3.1)."""
_ROUNDING = 1e-12
"""Relative change of the merit that may be rounding."""


PROGRESS = np.dtype([("shift", "f8"), ("barrier", "f8"), ("iterations", "i8")], align=True)
"""Shift of the Hessian; fixed barrier, 0: none; and number of iterations."""


class InteriorPoint(NamedTuple):
    """State of the method between iterations."""

    point: StagePoint
    side_multipliers: Float[Array, "stages rows 2"]
    """Multipliers of the upper and the lower side of every limit, positive."""
    factors: Factors
    step: Step
    multiplier_step: Float[Array, "stages rows 2"]
    """Step of ``side_multipliers``."""
    products: Float[Array, "stages rows 2"]
    """Desired values of slack x multiplier."""
    progress: Any
    """One record of the type :data:`PROGRESS`."""


@compiled
def initialize(
    p: HolonomicProblem, unconstrained: Float[Array, "stages 3"], min_barrier: float
) -> InteriorPoint:
    """Return the state of feasible velocities and of multipliers on the central path.

    The product of slack and multiplier is the same for all sides of all limits: the excess of the
    start's cost over the unconstrained optimum over their number, but at least ``min_barrier``.
    """
    bounds = relaxed_bounds(p)
    stages, rows = bounds.shape
    velocities = feasible_velocities(p, bounds)
    excess = cost(p, roll_out(p, velocities), velocities) - lower_bound(p, unconstrained)
    point = allocate_point(velocities, bounds)
    evaluate(p, point)
    side_multipliers = max(excess / (2 * stages * rows), min_barrier) / point.slacks
    ip = InteriorPoint(
        point,
        side_multipliers,
        allocate_factors(stages, rows),
        allocate_step(stages, rows),
        np.empty((stages, rows, 2)),
        np.empty((stages, rows, 2)),
        np.zeros(1, PROGRESS),
    )
    _combine_multipliers(ip)
    return ip


@compiled
def iterate(p: HolonomicProblem, ip: InteriorPoint, tolerance: float, max_iterations: int) -> int:
    """Iterate until convergence or a total of ``max_iterations``; return the exit code.

    All iterates of this primal-dual interior-point method are strictly feasible: slacks are not
    separate unknowns. Mehrotra's predictor-corrector steps (Nocedal & Wright, "Numerical
    Optimization", 2nd ed. 2006, section 16.6) are taken while they decrease the merit. Otherwise
    the barrier is fixed until its minimum is near (the monotone mode of Wachter & Biegler, Math.
    Program. 106, 2006). The Hessian is exact, and modified where it is not positive definite:
    :func:`~omnidrive.control.nmpc.holonomic.riccati.factorise_shifted`.
    """
    point, progress = ip.point, ip.progress[0]
    while True:
        _combine_multipliers(ip)
        evaluate(p, point)
        gradient, product, mean = _residuals(p, ip)
        if gradient <= tolerance and product <= tolerance:
            return CONVERGED
        if progress.iterations >= max_iterations:
            return CAPPED
        _fill_weights(ip)
        progress.shift = factorise_shifted(p, point, ip.factors, progress.shift)
        if progress.shift >= MAX_SHIFT:
            return STALLED
        if progress.barrier > 0.0 and max(gradient, product) <= 10.0 * progress.barrier:
            progress.barrier = 0.0
        length = 0.0
        if progress.barrier == 0.0:
            min_barrier = max(0.1 * tolerance, min(_BARRIER_PER_GRADIENT * gradient, mean))
            barrier = _predictor(p, ip, mean, min_barrier)
            length = _corrector(p, ip, barrier, 0.1)
            if length == 0.0:
                progress.barrier = max(barrier, 0.5 * mean)
        if length == 0.0:
            ip.products[:] = progress.barrier
            length = _corrector(p, ip, progress.barrier, 0.0)
            if length == 0.0:
                return STALLED
        dual = min(1.0, _TO_BOUNDARY * _max_dual_step(ip))
        add_scaled(point.velocities, length, ip.step.velocities)
        add_scaled(ip.side_multipliers, dual, ip.multiplier_step)
        progress.iterations += 1


@compiled
def _combine_multipliers(ip: InteriorPoint) -> None:
    """Fill in the multipliers of the point: those of the upper minus those of the lower sides."""
    multipliers, sides = ip.point.multipliers, ip.side_multipliers
    for k in range(multipliers.shape[0]):
        for w in range(multipliers.shape[1]):
            multipliers[k, w] = sides[k, w, 0] - sides[k, w, 1]


@compiled
def _fill_weights(ip: InteriorPoint) -> None:
    """Fill in the second derivatives of the barrier by the values of the limits."""
    weights, slacks, sides = ip.factors.weights, ip.point.slacks, ip.side_multipliers
    for k in range(weights.shape[0]):
        for w in range(weights.shape[1]):
            weights[k, w] = sides[k, w, 0] / slacks[k, w, 0]
            weights[k, w] += sides[k, w, 1] / slacks[k, w, 1]


@compiled
def _residuals(p: HolonomicProblem, ip: InteriorPoint) -> tuple[float, float, float]:
    """Return the norm of the Lagrangian's gradient, and largest and mean slack x multiplier."""
    slacks, sides = ip.point.slacks, ip.side_multipliers
    largest, total = 0.0, 0.0
    for k in range(slacks.shape[0]):
        for w in range(slacks.shape[1]):
            for side in range(2):
                product = slacks[k, w, side] * sides[k, w, side]
                largest, total = max(largest, product), total + product
    return gradient_norm(p.dt, ip.point), largest, total / slacks.size


@compiled
def _fill_step(p: HolonomicProblem, ip: InteriorPoint) -> None:
    """Fill in the Newton step towards slack x multiplier = ``products``."""
    slacks, products, sides = ip.point.slacks, ip.products, ip.side_multipliers
    values, changes = ip.step.values, ip.multiplier_step
    multipliers = np.empty(values.shape)
    for k in range(values.shape[0]):
        for w in range(values.shape[1]):
            upper, lower = products[k, w, 0] / slacks[k, w, 0], products[k, w, 1] / slacks[k, w, 1]
            multipliers[k, w] = upper - lower
    newton_step(p, ip.point, ip.factors, multipliers, ip.step)
    for k in range(values.shape[0]):
        for w in range(values.shape[1]):
            for side, change in ((0, -values[k, w]), (1, values[k, w])):
                desired = products[k, w, side] - sides[k, w, side] * change
                changes[k, w, side] = desired / slacks[k, w, side] - sides[k, w, side]


@compiled
def _predictor(p: HolonomicProblem, ip: InteriorPoint, mean: float, min_barrier: float) -> float:
    """Take Mehrotra's predictor step: set the corrector's ``products`` and return its barrier."""
    slacks, values, products = ip.point.slacks, ip.step.values, ip.products
    sides, changes = ip.side_multipliers, ip.multiplier_step
    products[:] = 0.0
    _fill_step(p, ip)
    primal = _max_primal_step(ip.point, ip.step, 1.0)
    dual, after = _max_dual_step(ip), 0.0
    for k in range(slacks.shape[0]):
        for w in range(slacks.shape[1]):
            for side, change in ((0, -values[k, w]), (1, values[k, w])):
                products[k, w, side] = -change * changes[k, w, side]
                after += (slacks[k, w, side] + primal * change) * (
                    sides[k, w, side] + dual * changes[k, w, side]
                )
    barrier = max(mean * (after / slacks.size / mean) ** 3, min_barrier)
    flat = products.ravel()
    for i in range(len(flat)):
        flat[i] += barrier
    return barrier


@compiled
def _corrector(p: HolonomicProblem, ip: InteriorPoint, barrier: float, min_ratio: float) -> float:
    """Fill in the step towards ``products``; return its length, 0 if it is too short.

    Args:
        p: The problem.
        ip: State of the method.
        barrier: Of the merit.
        min_ratio: Shortest length, over the longest feasible one.
    """
    _fill_step(p, ip)
    longest = _max_primal_step(ip.point, ip.step, _TO_BOUNDARY)
    return _line_search(p, ip, barrier, longest, min_ratio * longest)


@compiled
def _max_primal_step(point: StagePoint, step: Step, fraction: float) -> float:
    """Return the step length, at most 1, that uses ``fraction`` of the first slack to vanish."""
    length = 1.0
    for k in range(point.slacks.shape[0]):
        for w in range(point.slacks.shape[1]):
            slack = point.slacks[k, w, 0] if step.values[k, w] > 0.0 else point.slacks[k, w, 1]
            if length * abs(step.values[k, w]) > fraction * slack:
                length = fraction * slack / abs(step.values[k, w])
    return length


@compiled
def _max_dual_step(ip: InteriorPoint) -> float:
    """Return the step length, at most 1, up to which no multiplier becomes negative."""
    length = 1.0
    sides, changes = ip.side_multipliers.ravel(), ip.multiplier_step.ravel()
    for i in range(len(sides)):
        if length * changes[i] < -sides[i]:
            length = -sides[i] / changes[i]
    return length


@compiled
def _merit(
    p: HolonomicProblem,
    velocities: Float[Array, "stages 3"],
    bounds: Float[Array, "stages rows"],
    barrier: float,
) -> float:
    """Return J plus the logarithmic barrier of all limits; infinite outside the limits."""
    total, twists = cost(p, roll_out(p, velocities), velocities), stage_twists(p, velocities)
    for k in range(len(velocities)):
        product, earlier = 1.0, earlier_twist(p, twists, k)
        for i in range(bounds.shape[1]):
            value = limit_value(p, i, twists, k, earlier) / bounds[k, i]
            if not abs(value) < 1.0:
                return np.inf
            product *= (1.0 - value) * (1.0 + value)
        total -= barrier * log(product)
    return total


@compiled
def _line_search(
    p: HolonomicProblem, ip: InteriorPoint, barrier: float, longest: float, shortest: float
) -> float:
    """Halve the step until the merit decreases enough; return its length, 0 on failure."""
    point, step = ip.point, ip.step
    descent = _product_sum(point.gradient_velocity, step.velocities)
    descent += _product_sum(point.gradient_state, step.poses)
    for k in range(point.slacks.shape[0]):
        for w in range(point.slacks.shape[1]):
            derivative = barrier / point.slacks[k, w, 0] - barrier / point.slacks[k, w, 1]
            descent += derivative * step.values[k, w]
    if not descent < 0.0:
        return 0.0
    merit, length = _merit(p, point.velocities, point.bounds, barrier), longest
    velocities = np.empty(point.velocities.shape)
    for _ in range(_MAX_HALVINGS):
        overwrite(velocities, point.velocities)
        add_scaled(velocities, length, step.velocities)
        reached = _merit(p, velocities, point.bounds, barrier)
        if reached <= merit + _ARMIJO * length * descent + _ROUNDING * abs(merit):
            return length
        length *= 0.5
        if length < shortest:
            break
    return 0.0


@compiled
def _product_sum(left: Float[Array, "rows 3"], right: Float[Array, "rows 3"]) -> float:
    """Return the sum of the products of all elements."""
    total = 0.0
    for k in range(left.shape[0]):
        for a in range(3):
            total += left[k, a] * right[k, a]
    return total
