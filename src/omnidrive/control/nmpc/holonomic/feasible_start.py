"""Strictly feasible start of the interior-point method."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.lqr import lqr_policy
from omnidrive.control.nmpc.holonomic.motion import limit_value
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.geometry.arc import arc_twist, arc_velocity

_START_RATIO = 0.9
"""Largest ratio of a limit's value to its bound at the start."""
_BRAKING_RATIO = 0.99
"""Largest ratio of a limit's value to its bound under braking, before the bound is relaxed."""


@compiled
def couples_stages(p: HolonomicProblem) -> bool:
    """Return whether any limit depends on the twists of two stages."""
    return bool(p.limits.before.any())


@compiled
def relaxed_bounds(p: HolonomicProblem) -> Float[Array, "stages rows"]:
    """Return the bound of every limit at every stage: its own, or the one that braking needs.

    A robot that is faster than its limits allow cannot satisfy them at once if its deceleration
    is limited too. A bound that the hardest braking violates is relaxed to the value of braking.
    """
    stages, rows = len(p.feedforward), len(p.limits.bounds)
    bounds = np.empty((stages, rows))
    for k in range(stages):
        for i in range(rows):
            bounds[k, i] = p.limits.bounds[i]
    twists, k = np.empty((stages, 3)), 0
    while couples_stages(p) and k < stages and _brake(p, twists, k) > _BRAKING_RATIO:
        for i in range(rows):
            bounds[k, i] = max(bounds[k, i], abs(limit_value(p, i, twists, k)) / _BRAKING_RATIO)
        k += 1
    return bounds


@compiled
def feasible_velocities(
    p: HolonomicProblem, bounds: Float[Array, "stages rows"]
) -> Float[Array, "stages 3"]:
    """Return velocities near the unconstrained policy that keep slack at all limits.

    Stage by stage, the twist starts at that of the stage before, or at the braking twist, and
    moves towards the twist of the unconstrained policy as far as the limits allow. The initial
    twist satisfies all limits; if no limit couples stages, it is rest. As all limits are linear in
    the twist, every twist between the initial and the desired one up to the first limit satisfies
    them as well.
    """
    gains, offsets = lqr_policy(p)
    coupled, stages = couples_stages(p), len(gains)
    velocities, twists = np.empty((stages, 3)), np.zeros((stages, 3))
    desired = np.empty(3)
    x, y, yaw = p.start[0], p.start[1], p.start[2]
    for k in range(stages):
        movable = not coupled or _brake(p, twists, k) <= _BRAKING_RATIO
        for i, state in enumerate((x, y, yaw)):
            desired[i] = offsets[k, i] - gains[k, i] * state
        rate = desired[2]
        ahead, left = arc_twist(p.dt, yaw, desired[0], desired[1], rate)
        change = (ahead - twists[k, 0], left - twists[k, 1], rate - twists[k, 2])
        fraction = _feasible_fraction(p, bounds, twists, k, change) if movable else 0.0
        for a in range(3):
            twists[k, a] += fraction * change[a]
        vx, vy = arc_velocity(p.dt, yaw, twists[k, 0], twists[k, 1], twists[k, 2])
        velocities[k, 0], velocities[k, 1], velocities[k, 2] = vx, vy, twists[k, 2]
        x, y, yaw = x + p.dt * vx, y + p.dt * vy, yaw + p.dt * twists[k, 2]
    return velocities


@compiled
def _feasible_fraction(
    p: HolonomicProblem,
    bounds: Float[Array, "stages rows"],
    twists: Float[Array, "stages 3"],
    k: int,
    change: tuple[float, float, float],
) -> float:
    """Return the largest fraction, at most 1, of a twist's change that keeps slack everywhere."""
    fraction = 1.0
    for i in range(bounds.shape[1]):
        value, derivative = limit_value(p, i, twists, k), 0.0
        largest = max(_START_RATIO * bounds[k, i], abs(value))
        for a in range(3):
            derivative += p.limits.now[i, a] * change[a]
        if abs(value + fraction * derivative) > largest:
            end = largest if derivative > 0.0 else -largest
            fraction = max((end - value) / derivative, 0.0)
    return fraction


@compiled
def _brake(p: HolonomicProblem, twists: Float[Array, "stages 3"], k: int) -> float:
    """Fill in stage k's twist: that of the stage before, or a braking multiple of it.

    If the twist before satisfies all limits, it is kept. Otherwise the multiple, at most 1, with
    the least ratio to the bounds is taken, subject to those limits that a constant twist
    satisfies. It is found by ternary search: the ratio is convex in the factor. Return the ratio.
    """
    before = twists[k - 1] if k > 0 else p.previous
    low, high = 0.0, 1.0
    if _max_ratio(p, before, 1.0) <= _BRAKING_RATIO:
        low = 1.0
    for _ in range(60 if low < high else 0):
        lower, upper = (2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0
        if _max_ratio(p, before, lower) < _max_ratio(p, before, upper):
            high = upper
        else:
            low = lower
    factor = 0.5 * (low + high)
    for a in range(3):
        twists[k, a] = factor * before[a]
    return _max_ratio(p, before, factor)


@compiled
def _max_ratio(p: HolonomicProblem, before: Float[Array, " 3"], factor: float) -> float:
    """Return the largest ratio of a limit's value to its bound for ``factor`` times ``before``.

    A violated limit that a constant twist would satisfy counts a million times as much.
    """
    largest = 0.0
    for i in range(len(p.limits.bounds)):
        now, past = 0.0, 0.0
        for a in range(3):
            now += p.limits.now[i, a] * before[a] / p.limits.bounds[i]
            past += p.limits.before[i, a] * before[a] / p.limits.bounds[i]
        ratio = abs(factor * now - past)
        if ratio > _BRAKING_RATIO >= abs(now - past):
            ratio *= 1e6
        largest = max(largest, ratio)
    return largest
