"""Where the interior-point method begins: a plan with room before every limit."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.holonomic.linear import policy
from omnidrive.control.nmpc.holonomic.motion import limited, twist, velocity
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

_INSIDE = 0.9
"""Part of its bound that the first plan may need of a limit."""
_REACHABLE = 0.99
"""Part of a limit's bound that braking may need before the limit counts as out of reach."""


@inlined
def is_coupled(p: HolonomicProblem) -> bool:
    """Whether any limit binds one stage to the next."""
    return bool(p.limits.before.any())


@compiled
def bounds_of(p: HolonomicProblem) -> Float[Array, "stages rows"]:
    """Bound of every limit at every stage: its own, or a little more than what braking needs.

    A robot that is faster than its limits allow, and may brake only so fast, cannot keep them at
    first. A bound that the hardest braking breaks is widened to what that needs.
    """
    stages, rows = len(p.feedforward), len(p.limits.bounds)
    bounds = np.empty((stages, rows))
    for k in range(stages):
        bounds[k] = p.limits.bounds
    twists, k = np.empty((stages, 3)), 0
    while is_coupled(p) and k < stages and _brake(p, twists, k) > _REACHABLE:
        for i in range(rows):
            bounds[k, i] = max(bounds[k, i], abs(limited(p, i, twists, k)) / _REACHABLE)
        k += 1
    return bounds


@compiled
def slowed(p: HolonomicProblem, bounds: Float[Array, "stages rows"]) -> Float[Array, "stages 3"]:
    """Velocities that go on as before as little as the limits demand.

    Stage by stage, from the twist of the stage before towards what were best from there on without
    limits. Going on with that twist, or braking, keeps all limits; where none binds a stage to the
    next, so does standing still. As all are linear in the twist, so does every twist between that
    one and the wanted one up to the first limit.
    """
    gains, offsets = policy(p)
    coupled, stages = is_coupled(p), len(gains)
    slower, twists, wanted = np.empty((stages, 3)), np.zeros((stages, 3)), np.empty(3)
    x, y, yaw = p.start[0], p.start[1], p.start[2]
    for k in range(stages):
        within = not coupled or _brake(p, twists, k) <= _REACHABLE
        for i, state in enumerate((x, y, yaw)):
            wanted[i] = offsets[k, i] - gains[k, i] * state
        rate = wanted[2]
        ahead, left = twist(p.dt, yaw, wanted[0], wanted[1], rate)
        change = (ahead - twists[k, 0], left - twists[k, 1], rate - twists[k, 2])
        part = _part(p, bounds, twists, k, change) if within else 0.0
        for a in range(3):
            twists[k, a] += part * change[a]
        vx, vy = velocity(p.dt, yaw, twists[k, 0], twists[k, 1], twists[k, 2])
        slower[k, 0], slower[k, 1], slower[k, 2] = vx, vy, twists[k, 2]
        x, y, yaw = x + p.dt * vx, y + p.dt * vy, yaw + p.dt * twists[k, 2]
    return slower


@inlined
def _part(
    p: HolonomicProblem,
    bounds: Float[Array, "stages rows"],
    twists: Float[Array, "stages 3"],
    k: int,
    change: tuple[float, float, float],
) -> float:
    """Largest part of a change of stage k's twist, at most 1, that leaves room at every limit."""
    part = 1.0
    for i in range(bounds.shape[1]):
        here, slope = limited(p, i, twists, k), 0.0
        most = max(_INSIDE * bounds[k, i], abs(here))
        for a in range(3):
            slope += p.limits.now[i, a] * change[a]
        if abs(here + part * slope) > most:
            part = max(((most if slope > 0.0 else -most) - here) / slope, 0.0)
    return part


@compiled
def _brake(p: HolonomicProblem, twists: Float[Array, "stages 3"], k: int) -> float:
    """Fill in stage k's twist: that of the stage before, unless a limit is too near.

    Then it is the multiple of it, at most 1, that needs the least part of all bounds, but breaks
    none that going on as before would not. Found by ternary search: what is needed of a bound is
    convex in the factor. Returns the part.
    """
    before = twists[k - 1] if k > 0 else p.previous
    low, high = 0.0, 1.0
    if _needed(p, before, 1.0) <= _REACHABLE:
        low = 1.0
    for _ in range(60 if low < high else 0):
        one, other = (2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0
        if _needed(p, before, one) < _needed(p, before, other):
            high = other
        else:
            low = one
    factor = 0.5 * (low + high)
    for a in range(3):
        twists[k, a] = factor * before[a]
    return _needed(p, before, factor)


@inlined
def _needed(p: HolonomicProblem, before: Float[Array, " 3"], factor: float) -> float:
    """Largest part of a bound that ``factor`` times the twist before needs.

    It counts a million times as much where going on as before would keep the bound.
    """
    largest = 0.0
    for i in range(len(p.limits.bounds)):
        now, past = 0.0, 0.0
        for a in range(3):
            now += p.limits.now[i, a] * before[a] / p.limits.bounds[i]
            past += p.limits.before[i, a] * before[a] / p.limits.bounds[i]
        needed = abs(factor * now - past)
        if needed > _REACHABLE >= abs(now - past):
            needed *= 1e6
        largest = max(largest, needed)
    return largest
