"""Choice between two plans, and the second start of the solver: on the other side of a zone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.keep_out_cost import signed_distance
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, KeepOutArrays

RELEASE = 0.02
"""KKT residual, over the cost of the first plan, at which the half-plane is removed: from there the
iterates remain on their side. With a fifth or with five times this value more of them return, or
stop at the maximum number of iterations."""
HYSTERESIS = 0.05
"""Relative difference of costs below which a plan that continues the latest one is kept."""
_LESS = 1e-4
"""As :data:`HYSTERESIS`, for the first plan if there is no latest one: not only rounding."""
_RADIUS = 1e3
"""Radius of the disc whose boundary is that of a half-plane, in m."""


@compiled
def crossed_zone(
    p: HolonomicProblem,
    unconstrained: Float[Array, "points 3"],
    states: Float[Array, "points 3"],
) -> tuple[int, int]:
    """Return the zone that a plan might better pass on its other side, and the state next to it.

    Of the zones on whose other side the optimum without limits or the plan itself has a state, it
    is the one whose distance the plan violates most, in terms of cost.

    Args:
        p: The problem.
        unconstrained: States of its optimum without limits and keep-out zones.
        states: States of a plan.

    Returns:
        The indices of zone and state; -1 and 0 without such a zone.
    """
    zones, zone, point, largest = p.keep_outs, -1, 0, 0.0
    for j in range(len(zones.radii)):
        total, deepest, nearest = 0.0, 0.0, 0
        for k in range(1, len(states)):
            violation = _violation(zones, j, k, states)
            total += zones.weights[j] * violation * violation
            if violation > deepest:
                deepest, nearest = violation, k
        if total > largest and (
            _crosses(zones, j, nearest, states, unconstrained)
            or _crosses(zones, j, nearest, states, states)
        ):
            zone, point, largest = j, nearest, total
    return zone, point


@compiled
def _violation(zones: KeepOutArrays, j: int, k: int, states: Float[Array, "points 3"]) -> float:
    """Return by how much the distance of state k to zone j is too short, in m."""
    distance, _, _, _ = signed_distance(zones, j, k, states[k, 0], states[k, 1])
    violation: float = max(zones.radii[j] - distance, 0.0)
    return violation


@compiled
def _crosses(
    zones: KeepOutArrays,
    j: int,
    k: int,
    states: Float[Array, "points 3"],
    others: Float[Array, "points 3"],
) -> bool:
    """Return whether any of the other states is not on the side of zone j on which state k is."""
    _, nx, ny, _ = signed_distance(zones, j, k, states[k, 0], states[k, 1])
    for i in range(1, len(others)):
        x, y = others[i, 0] - zones.centres[j, i, 0], others[i, 1] - zones.centres[j, i, 1]
        if nx * x + ny * y < 0.0:
            return True
    return False


@compiled
def block_side(
    p: HolonomicProblem, states: Float[Array, "points 3"], j: int, k: int
) -> HolonomicProblem:
    """Return the problem with a further keep-out zone: the side on which a plan passes zone j.

    This zone is a half-plane beyond the tangent of zone j that is opposite to the plan, at the
    states at which the plan is next to zone j, and one before and after them.

    Args:
        p: The problem.
        states: States of a plan.
        j: Index of a zone whose distance the plan violates.
        k: Index of a state at which it does.
    """
    zones = p.keep_outs
    _, nx, ny, _ = signed_distance(zones, j, k, states[k, 0], states[k, 1])
    begin, end, last, count = k, k, len(states) - 1, len(zones.radii)
    while begin > 1 and _violation(zones, j, begin - 1, states) > 0.0:
        begin -= 1
    while end < last and _violation(zones, j, end + 1, states) > 0.0:
        end += 1
    extent = 0.0
    for i in range(zones.first[j], zones.first[j + 1]):
        extent = max(extent, -nx * zones.corners[i, 0] - ny * zones.corners[i, 1])
    centres = np.empty((count + 1, last + 1, 2))
    for i in range(last + 1):
        for a in range(count):
            centres[a, i, 0], centres[a, i, 1] = zones.centres[a, i, 0], zones.centres[a, i, 1]
        away = 2.0 * _RADIUS  # behind all other states
        if max(begin - 1, 1) <= i <= end + 1:
            away = _RADIUS - zones.radii[j] - extent
        centres[count, i, 0] = zones.centres[j, i, 0] + away * nx
        centres[count, i, 1] = zones.centres[j, i, 1] + away * ny
    blocked = KeepOutArrays(
        np.concatenate((zones.corners, np.zeros((1, 2)))),
        np.append(zones.first, zones.first[-1] + 1),
        np.append(zones.radii, _RADIUS),
        np.append(zones.weights, zones.weights[j]),
        centres,
    )
    return HolonomicProblem(
        p.dt,
        p.start,
        p.previous,
        p.targets,
        p.feedforward,
        p.state_weights,
        p.control_weights,
        p.limits,
        blocked,
    )


@compiled
def replaces(  # noqa: PLR0917
    p: HolonomicProblem,
    plan: Float[Array, "stages 3"],
    plan_cost: float,
    other: Float[Array, "stages 3"],
    other_cost: float,
    latest: Float[Array, "later 3"],
) -> bool:
    """Return whether to follow another plan in place of the first one: the cheaper one.

    The one that is nearer to the rest of the latest plan is kept up to a difference of costs of
    :data:`HYSTERESIS`, so that the robot does not hesitate between two ways.

    Args:
        p: The problem.
        plan: Velocities of the first plan.
        plan_cost: J of the first plan.
        other: Velocities of the other plan.
        other_cost: J of the other plan.
        latest: Velocities of the latest plan from now on; empty: there is none.
    """
    if len(latest) == 0:
        return other_cost < (1.0 - _LESS) * plan_cost
    if _distance(p, other, latest) < _distance(p, plan, latest):
        return (1.0 - HYSTERESIS) * other_cost <= plan_cost
    return other_cost < (1.0 - HYSTERESIS) * plan_cost


@compiled
def _distance(
    p: HolonomicProblem, plan: Float[Array, "stages 3"], latest: Float[Array, "later 3"]
) -> float:
    """Return the sum of the weighted squares of the differences between two plans' velocities."""
    total = 0.0
    for k in range(min(len(plan), len(latest))):
        for a in range(3):
            difference = plan[k, a] - latest[k, a]
            total += p.control_weights[a] * difference * difference
    return total
