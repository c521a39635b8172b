"""A primal-dual interior-point method for the wheels' limits, with Riccati sweeps for its steps."""

from __future__ import annotations

from math import log

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.limits import Iterate, evaluate, reduced_gradient, slowed
from omnidrive.control.nmpc.holonomic.motion import cost, roll_out, wheel_speed
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.riccati import Factors, Step, factorise, newton_step

Array = np.ndarray

CONVERGED, CAPPED, STALLED = range(3)

_TO_BOUNDARY = 0.995
"""Part of the way to a limit that a step may go (Nocedal & Wright, 2006, section 19.2)."""
_MAX_HALVINGS = 30
_ARMIJO = 1e-4
"""Share of the predicted fall that is enough (Nocedal & Wright, 2006, section 3.1)."""
_ROUNDING = 1e-12
"""Relative difference of the merit that may be rounding."""


@compiled
def _residuals(p: HolonomicProblem, at: Iterate) -> tuple[float, float]:
    """Largest entry of the Lagrangian's gradient, and largest room x multiplier."""
    pulls = at.multipliers[:, :, 0] - at.multipliers[:, :, 1]
    gradient = reduced_gradient(p, at.velocities, at.slopes, pulls)
    return np.abs(gradient).max(), (at.rooms * at.multipliers).max()


@compiled
def _merit(p: HolonomicProblem, velocities: Float[Array, "stages 3"], barrier: float) -> float:
    """J with a logarithmic barrier before every limit; infinite beyond."""
    total, yaw = cost(p, roll_out(p, velocities), velocities), p.start[2]
    for k in range(len(velocities)):
        vx, vy, rate = velocities[k, 0], velocities[k, 1], velocities[k, 2]
        for i in range(len(p.limits)):
            speed = wheel_speed(p, i, yaw, vx, vy, rate) / p.limits[i]
            if not abs(speed) < 1.0:
                return np.inf
            total -= barrier * log((1.0 - speed) * (1.0 + speed))
        yaw += p.dt * rate
    return total


@compiled
def _room(values: Float[Array, "stages wheels 2"], step: Float[Array, "stages wheels 2"]) -> float:
    """Largest part of a step, at most 1, that leaves every value positive or zero."""
    part = 1.0
    flat, changes = values.ravel(), step.ravel()
    for i in range(len(flat)):
        if changes[i] < 0.0:
            part = min(part, -flat[i] / changes[i])
    return part


@compiled
def _search(  # noqa: PLR0917
    p: HolonomicProblem, at: Iterate, step: Step, barrier: float, longest: float, least: float
) -> float:
    """Part of a step, found by halving, with which the merit falls enough; 0 if there is none."""
    none = np.zeros((len(at.velocities), len(p.limits)))
    for k in range(len(at.velocities)):
        for w in range(len(p.limits)):
            none[k, w] = barrier / at.rooms[k, w, 0] - barrier / at.rooms[k, w, 1]
    descent = (reduced_gradient(p, at.velocities, at.slopes, none) * step.velocities).sum()
    if not descent < 0.0:
        return 0.0
    merit, part = _merit(p, at.velocities, barrier), longest
    for _ in range(_MAX_HALVINGS):
        reached = _merit(p, at.velocities + part * step.velocities, barrier)
        if reached <= merit + _ARMIJO * part * descent + _ROUNDING * abs(merit):
            return part
        part *= 0.5
        if part < least:
            break
    return 0.0


@compiled
def _first(p: HolonomicProblem, unlimited: Float[Array, "stages 3"], least: float) -> Iterate:
    """Slowed velocities, and multipliers of one barrier, ``least`` or more."""
    stages, wheels = len(unlimited), len(p.limits)
    velocities = slowed(p, unlimited)
    excess = cost(p, roll_out(p, velocities), velocities) - cost(
        p, roll_out(p, unlimited), unlimited
    )
    at = Iterate(
        velocities,
        np.zeros((stages, wheels, 2)),
        np.empty((stages, wheels, 2)),
        np.empty((stages, wheels, 4)),
        np.empty((stages, 4, 4)),
    )
    evaluate(p, at)
    at.multipliers[:] = max(excess / (2 * stages * wheels), least) / at.rooms
    return at


@compiled
def solve_limited(
    p: HolonomicProblem,
    unlimited: Float[Array, "stages 3"],
    tolerance: float,
    max_iterations: int,
) -> tuple[Iterate, int, int]:
    """Local optimum within the wheels' limits, from the optimum without them.

    A primal-dual interior-point method whose iterates all keep within the limits: the rooms are
    not variables of their own. Mehrotra's predictor and corrector (Nocedal & Wright, "Numerical
    Optimization", 2nd ed. 2006, section 16.6) go on as long as they lower the merit. Where they do
    not, one barrier is held until its minimum is near (the monotone mode of Wachter & Biegler,
    Math. Program. 106, 2006). The Hessian is exact, and shifted where it is not positive definite.
    The first barrier is what the slowed start costs more than no limits.

    Returns:
        The last iterate, the number of iterations, and why it stopped.
    """
    stages, wheels = len(unlimited), len(p.limits)
    count = 2 * stages * wheels
    at = _first(p, unlimited, tolerance)
    f = Factors(np.zeros((stages, 3, 3)), np.zeros((stages, 3, 3)))
    step = Step(np.empty((stages, 3)), np.empty((stages, wheels, 2)), np.empty((stages, wheels, 2)))
    products = np.empty((stages, wheels, 2))
    shift, held = 0.0, 0.0
    for iteration in range(max_iterations):
        evaluate(p, at)
        slope, product = _residuals(p, at)
        if slope <= tolerance and product <= tolerance:
            return at, iteration, CONVERGED
        shift = factorise(p, at, f, shift)
        if held > 0.0 and max(slope, product) <= 10.0 * held:
            held = 0.0
        part = 0.0
        if held == 0.0:
            mean = (at.rooms * at.multipliers).sum() / count
            products[:] = 0.0
            newton_step(p, at, f, products, step)
            primal, dual = _room(at.rooms, step.rooms), _room(at.multipliers, step.multipliers)
            after = (
                (at.rooms + primal * step.rooms) * (at.multipliers + dual * step.multipliers)
            ).sum() / count
            barrier = max(mean * (after / mean) ** 3, 0.1 * tolerance)
            products[:] = barrier - step.rooms * step.multipliers
            newton_step(p, at, f, products, step)
            longest = min(1.0, _TO_BOUNDARY * _room(at.rooms, step.rooms))
            part = _search(p, at, step, barrier, longest, 0.1 * longest)
            if part == 0.0:
                held = max(barrier, 0.5 * mean)
        if part == 0.0:
            products[:] = held
            newton_step(p, at, f, products, step)
            longest = min(1.0, _TO_BOUNDARY * _room(at.rooms, step.rooms))
            part = _search(p, at, step, held, longest, 0.0)
            if part == 0.0:
                return at, iteration, STALLED
        dual = min(1.0, _TO_BOUNDARY * _room(at.multipliers, step.multipliers))
        at.velocities[:] += part * step.velocities
        at.multipliers[:] += dual * step.multipliers
    evaluate(p, at)
    return at, max_iterations, CAPPED
