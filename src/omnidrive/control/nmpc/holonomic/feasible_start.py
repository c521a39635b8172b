"""Strictly feasible start of the interior-point method."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.lqr import lqr_policy
from omnidrive.control.nmpc.holonomic.motion import earlier_twist, limit_value
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.geometry.arc import arc_twist, arc_velocity
from omnidrive.robot.slip import Vector

_START_RATIO = 0.9
"""Largest ratio of a limit's value to its bound at the start."""
_BRAKING_RATIO = 0.99
"""Largest ratio of a limit's value to its bound under braking, before the bound is relaxed."""
_LEAST_PART = 0.01
"""Part of a change of twist below which it is left out."""


@compiled
def couples_stages(p: HolonomicProblem) -> bool:
    """Return whether any limit depends on the twists of two stages."""
    return bool(p.limits.before.any())


@compiled
def relaxed_bounds(p: HolonomicProblem) -> Float[Array, "stages rows"]:
    """Return the bound of every limit at every stage: its own, or the one that braking needs.

    A robot that is faster than its limits allow cannot satisfy them at once if its deceleration
    is limited too. A bound that the hardest braking violates is relaxed to the value of braking.
    With inertial limits, a turn of the twist in B may violate speed limits in any stage.
    """
    stages, rows = len(p.feedforward), len(p.limits.bounds)
    bounds = np.empty((stages, rows))
    for k in range(stages):
        for i in range(rows):
            bounds[k, i] = p.limits.bounds[i]
    twists = np.empty((stages, 3))
    for k in range(stages if couples_stages(p) else 0):
        if _brake(p, twists, k) > _BRAKING_RATIO:
            _relax(p, bounds, twists, k)
        elif not p.limits.inertial:  # the twist is constant from now on
            break
    return bounds


@compiled
def _relax(
    p: HolonomicProblem,
    bounds: Float[Array, "stages rows"],
    twists: Float[Array, "stages 3"],
    k: int,
) -> None:
    """Relax the bounds of a stage to the values of its twist."""
    earlier = earlier_twist(p, twists, k)
    for i in range(bounds.shape[1]):
        value = abs(limit_value(p, i, twists, k, earlier))
        bounds[k, i] = max(bounds[k, i], value / _BRAKING_RATIO)


@compiled
def feasible_velocities(
    p: HolonomicProblem, bounds: Float[Array, "stages rows"]
) -> Float[Array, "stages 3"]:
    """Return velocities near the unconstrained policy that keep slack at all limits.

    Stage by stage, the twist starts at that of the stage before, or at the braking twist, and
    moves towards the twist of the unconstrained policy as far as the limits allow. The initial
    twist satisfies all limits; if no limit couples stages, it is rest. As limits are linear in the
    twist unless they are inertial, every twist between the initial and the desired one up to the
    first limit satisfies them as well; if they are, the change is halved until it does.
    """
    gains, offsets = lqr_policy(p)
    coupled, stages = couples_stages(p), len(gains)
    velocities, twists = np.empty((stages, 3)), np.zeros((stages, 3))
    desired = np.empty(3)
    x, y, yaw = p.start[0], p.start[1], p.start[2]
    for k in range(stages):
        movable = not coupled or _brake(p, twists, k) <= _BRAKING_RATIO
        if not movable:
            _relax(p, bounds, twists, k)
        for i, state in enumerate((x, y, yaw)):
            desired[i] = offsets[k, i] - gains[k, i] * state
        rate = desired[2]
        ahead, left = arc_twist(p.dt, yaw, desired[0], desired[1], rate)
        change = (ahead - twists[k, 0], left - twists[k, 1], rate - twists[k, 2])
        fraction = _feasible_fraction(p, bounds, twists, k, change) if movable else 0.0
        change = (fraction * change[0], fraction * change[1], fraction * change[2])
        for a in range(3):
            twists[k, a] += change[a]
        if p.limits.inertial:
            _shorten(p, bounds, twists, k, change)
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
    fraction, earlier = 1.0, earlier_twist(p, twists, k)
    for i in range(bounds.shape[1]):
        value, derivative = limit_value(p, i, twists, k, earlier), 0.0
        largest = max(_START_RATIO * bounds[k, i], abs(value))
        for a in range(3):
            derivative += p.limits.now[i, a] * change[a]
        if abs(value + fraction * derivative) > largest:
            end = largest if derivative > 0.0 else -largest
            fraction = max((end - value) / derivative, 0.0)
    return fraction


@compiled
def _shorten(
    p: HolonomicProblem,
    bounds: Float[Array, "stages rows"],
    twists: Float[Array, "stages 3"],
    k: int,
    change: Vector,
) -> None:
    """Halve a stage's change of twist until it keeps slack: its yaw rate turns the one before."""
    part = 1.0
    while part > 0.0 and _stage_ratio(p, bounds[k], twists, k) > _BRAKING_RATIO:
        shorter = 0.5 * part if part > _LEAST_PART else 0.0
        for a in range(3):
            twists[k, a] += (shorter - part) * change[a]
        part = shorter


@compiled
def _brake(p: HolonomicProblem, twists: Float[Array, "stages 3"], k: int) -> float:
    """Fill in stage k's twist: that of the stage before, or a braking multiple of it.

    If the twist before satisfies all limits, it is kept. Otherwise the multiple, at most 1, with
    the least ratio to the bounds is taken, subject to those limits that a constant twist
    satisfies. It is found by ternary search: the ratio is convex in the factor. Return the ratio.
    """
    twists[k, 2] = twists[k - 1, 2] if k > 0 else p.previous[2]
    before = earlier_twist(p, twists, k)
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
    if not p.limits.inertial:
        return _max_ratio(p, before, factor)
    return _stage_ratio(p, p.limits.bounds, twists, k)


@compiled
def _stage_ratio(
    p: HolonomicProblem, bounds: Float[Array, " rows"], twists: Float[Array, "stages 3"], k: int
) -> float:
    """Return the largest ratio of a limit's value to its bound at a stage."""
    largest, earlier = 0.0, earlier_twist(p, twists, k)
    for i in range(len(bounds)):
        largest = max(largest, abs(limit_value(p, i, twists, k, earlier)) / bounds[i])
    return largest


@compiled
def _max_ratio(p: HolonomicProblem, before: Vector, factor: float) -> float:
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
