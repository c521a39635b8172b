"""Newton's method with the limits held that bind: quick where their set is soon found."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.holonomic.iterate import Iterate, evaluate, iterate, largest_slope
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.riccati import factors, is_convex, newton_step, step_of
from omnidrive.control.nmpc.holonomic.start import bounds_of

_MAX_ITERATIONS = 8
"""Iterations after which the set will hardly be found: they take less than a third of the time of
the interior-point method."""
_STIFFNESS = 1e6
"""Weight of a held value's square by the largest weight of J: so much that one step reaches the
bound to the sixth digit, so little that ten digits of the multipliers are left."""


@compiled
def hold_limits(
    p: HolonomicProblem, unlimited: Float[Array, "stages 3"], tolerance: float, most: int
) -> tuple[Iterate, int]:
    """Optimum reached from the plan without limits by holding those that bind at their bounds.

    The primal-dual active set method, which is a semismooth Newton method (Hintermuller, Ito &
    Kunisch, SIAM J. Optim. 13, 2002), with the exact Hessian, or with keep-outs as planes where
    that is not positive definite. What breaks a bound is held; what is held and pulls inward is let
    go. Held values are kept at their bounds by multipliers and the weight of an augmented
    Lagrangian (Nocedal & Wright, "Numerical Optimization", 2nd ed. 2006, section 17.3). There is no
    line search: it ends at an optimum, or in vain.

    Args:
        p: The problem.
        unlimited: Its optimum without limits and keep-outs.
        tolerance: Of the KKT conditions.
        most: Iterations to make at most; it gives up sooner where more seldom help.

    Returns:
        The last iterate, within all limits if it is the optimum; iterations, or -1 if it is not.
    """
    bounds = bounds_of(p)
    stages, rows = bounds.shape
    at, held = iterate(unlimited.copy(), bounds), np.zeros((stages, rows))
    f, step, pulls = factors(stages, rows), step_of(stages, rows), np.zeros((stages, rows))
    stiffness = _STIFFNESS * max(p.control_weights.max(), p.dt * p.dt * p.state_weights.max())
    iterations = 0
    while True:
        evaluate(p, at)
        off = _hold_and_release(at, held)
        if off <= tolerance and largest_slope(p.dt, at) <= tolerance:
            return at, iterations
        if iterations >= min(most, _MAX_ITERATIONS):
            return at, -1
        for k in range(stages):
            for i in range(rows):
                f.weights[k, i], pulls[k, i] = 0.0, 0.0
                if held[k, i] != 0.0:
                    f.weights[k, i] = stiffness
                    above = _room_kept(at, k, i, tolerance) - _room(at, held, k, i)
                    pulls[k, i] = at.pulls[k, i] + stiffness * held[k, i] * above
        if not is_convex(p, at, f):
            return at, -1
        newton_step(p, at, f, pulls, step)
        for k in range(stages):
            for i in range(rows):
                at.pulls[k, i] = pulls[k, i] + f.weights[k, i] * step.values[k, i]
        at.velocities[:] += step.velocities
        iterations += 1


@inlined
def _hold_and_release(at: Iterate, held: Float[Array, "stages rows"]) -> float:
    """Update ``held``: 1 at the upper bound, -1 at the lower; how far the worst value is off.

    As a product of room and multiplier, or infinite where any limit is broken, held or let go.
    """
    worst = 0.0
    for k in range(held.shape[0]):
        for i in range(held.shape[1]):
            if held[k, i] * at.pulls[k, i] < 0.0:
                held[k, i], at.pulls[k, i] = 0.0, 0.0  # the bends still have its pull
                worst = np.inf
            elif held[k, i] != 0.0:
                room = _room(at, held, k, i)
                off = room * max(1.0, abs(at.pulls[k, i])) if room >= 0.0 else np.inf
                worst = max(worst, off)
            elif at.rooms[k, i, 0] < 0.0 or at.rooms[k, i, 1] < 0.0:
                held[k, i] = 1.0 if at.rooms[k, i, 0] < 0.0 else -1.0
                worst = np.inf
    return worst


@inlined
def _room(at: Iterate, held: Float[Array, "stages rows"], k: int, i: int) -> float:
    """What is left up to the bound at which a value is held."""
    room: float = at.rooms[k, i, 0] if held[k, i] > 0.0 else at.rooms[k, i, 1]
    return room


@inlined
def _room_kept(at: Iterate, k: int, i: int, tolerance: float) -> float:
    """Room to leave before a bound, so that rounding breaks no limit."""
    pull: float = abs(at.pulls[k, i])
    return 0.1 * tolerance / max(1.0, pull)
