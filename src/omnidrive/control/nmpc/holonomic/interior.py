"""A primal-dual interior-point method for all limits, with Riccati sweeps for its steps."""

from __future__ import annotations

from math import log
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.holonomic.distance import keep_out_cost
from omnidrive.control.nmpc.holonomic.iterate import (
    Iterate,
    cost,
    evaluate,
    iterate,
    largest_slope,
)
from omnidrive.control.nmpc.holonomic.motion import limited, roll_out, twists_of
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.riccati import (
    LARGEST_SHIFT,
    Factors,
    Step,
    factorise,
    factors,
    newton_step,
    step_of,
)
from omnidrive.control.nmpc.holonomic.start import bounds_of, slowed

CONVERGED, CAPPED, STALLED = range(3)

_TO_BOUNDARY = 0.995
"""Part of the way to a limit that a step may go (Nocedal & Wright, 2006, section 19.2)."""
_BARRIER_PER_SLOPE = 1e-3
"""Least barrier per unit of the Lagrangian's gradient, as long as the mean product has it: where
complementarity ran ahead of the gradient, as it may while the Hessian is shifted, iterates would
creep along the limits (Wright, "Primal-Dual Interior-Point Methods", 1997, chapter 6, bounds the
same ratio). Ten times as much makes steps useless, a third of it converges less often."""
_MAX_HALVINGS = 30
_ARMIJO = 1e-4
"""Share of the predicted fall that is enough (Nocedal & Wright, 2006, section 3.1)."""
_ROUNDING = 1e-12
"""Relative difference of the merit that may be rounding."""


class Search(NamedTuple):
    """All that the method keeps from one iteration to the next."""

    at: Iterate
    multipliers: Float[Array, "stages rows 2"]
    """Of the upper and the lower side of every limit, positive."""
    factors: Factors
    step: Step
    changes: Float[Array, "stages rows 2"]
    """Step of the multipliers."""
    products: Float[Array, "stages rows 2"]
    """Room x multiplier that the step aims at."""
    memory: Float[Array, " 3"]
    """Shift of the Hessian, the barrier that is held (0: none), and iterations so far."""


@compiled
def begin(p: HolonomicProblem, unlimited: Float[Array, "stages 3"], least: float) -> Search:
    """Slowed velocities, and multipliers of one barrier, ``least`` or more.

    The first barrier is what the slowed start costs more than if nothing were in the way.
    """
    bounds = bounds_of(p)
    stages, rows = bounds.shape
    velocities = slowed(p, bounds)
    free = roll_out(p, unlimited)
    least_cost = cost(p, free, unlimited) - keep_out_cost(p.keep_outs, free)
    excess = cost(p, roll_out(p, velocities), velocities) - least_cost
    at = iterate(velocities, bounds)
    evaluate(p, at)
    multipliers = max(excess / (2 * stages * rows), least) / at.rooms
    search = Search(
        at,
        multipliers,
        factors(stages, rows),
        step_of(stages, rows),
        np.empty((stages, rows, 2)),
        np.empty((stages, rows, 2)),
        np.zeros(3),
    )
    _fill_pulls(search)
    return search


@compiled
def advance(p: HolonomicProblem, search: Search, tolerance: float, until: int) -> int:
    """Go on until the optimum, or until so many iterations were made in all; returns why it ended.

    A primal-dual interior-point method whose iterates all keep within the limits: the rooms are
    not variables of their own. Mehrotra's predictor and corrector (Nocedal & Wright, "Numerical
    Optimization", 2nd ed. 2006, section 16.6) go on as long as they lower the merit. Where they do
    not, one barrier is held until its minimum is near (the monotone mode of Wachter & Biegler,
    Math. Program. 106, 2006). The Hessian is exact, and changed where it is not positive definite:
    :func:`~omnidrive.control.nmpc.holonomic.riccati.factorise`.
    """
    at, memory = search.at, search.memory
    while True:
        _fill_pulls(search)
        evaluate(p, at)
        slope, product, mean = _residuals(p, search)
        if slope <= tolerance and product <= tolerance:
            return CONVERGED
        if memory[2] >= until:
            return CAPPED
        _fill_weights(search)
        memory[0] = factorise(p, at, search.factors, memory[0])
        if memory[0] >= LARGEST_SHIFT:
            return STALLED
        if memory[1] > 0.0 and max(slope, product) <= 10.0 * memory[1]:
            memory[1] = 0.0
        part = 0.0
        if memory[1] == 0.0:
            least = max(0.1 * tolerance, min(_BARRIER_PER_SLOPE * slope, mean))
            barrier = _predict(p, search, mean, least)
            part = _correct(p, search, barrier, 0.1)
            if part == 0.0:
                memory[1] = max(barrier, 0.5 * mean)
        if part == 0.0:
            search.products[:] = memory[1]
            part = _correct(p, search, memory[1], 0.0)
            if part == 0.0:
                return STALLED
        dual = min(1.0, _TO_BOUNDARY * _room(search.multipliers, search.changes))
        at.velocities[:] += part * search.step.velocities
        search.multipliers[:] += dual * search.changes
        memory[2] += 1


@inlined
def _fill_pulls(search: Search) -> None:
    """How hard each limit pulls, by the multipliers of its two sides."""
    pulls, multipliers = search.at.pulls, search.multipliers
    for k in range(pulls.shape[0]):
        for w in range(pulls.shape[1]):
            pulls[k, w] = multipliers[k, w, 0] - multipliers[k, w, 1]


@inlined
def _fill_weights(search: Search) -> None:
    """What the barrier adds to the Hessian by the values of the limits."""
    weights, multipliers, rooms = search.factors.weights, search.multipliers, search.at.rooms
    for k in range(weights.shape[0]):
        for w in range(weights.shape[1]):
            weights[k, w] = multipliers[k, w, 0] / rooms[k, w, 0]
            weights[k, w] += multipliers[k, w, 1] / rooms[k, w, 1]


@inlined
def _residuals(p: HolonomicProblem, search: Search) -> tuple[float, float, float]:
    """Largest entry of the Lagrangian's gradient; largest and mean room x multiplier."""
    rooms, multipliers = search.at.rooms, search.multipliers
    largest, total = 0.0, 0.0
    for k in range(rooms.shape[0]):
        for w in range(rooms.shape[1]):
            for side in range(2):
                product = rooms[k, w, side] * multipliers[k, w, side]
                largest, total = max(largest, product), total + product
    return largest_slope(p.dt, search.at), largest, total / rooms.size


@compiled
def _step(p: HolonomicProblem, search: Search) -> None:
    """Fill in Newton's step towards room x multiplier = ``products``."""
    rooms, products, multipliers = search.at.rooms, search.products, search.multipliers
    values, changes = search.step.values, search.changes
    pulls = np.empty(values.shape)
    for k in range(values.shape[0]):
        for w in range(values.shape[1]):
            pulls[k, w] = products[k, w, 0] / rooms[k, w, 0] - products[k, w, 1] / rooms[k, w, 1]
    newton_step(p, search.at, search.factors, pulls, search.step)
    for k in range(values.shape[0]):
        for w in range(values.shape[1]):
            for side, room in ((0, -values[k, w]), (1, values[k, w])):
                wanted = products[k, w, side] - multipliers[k, w, side] * room
                changes[k, w, side] = wanted / rooms[k, w, side] - multipliers[k, w, side]


@compiled
def _predict(p: HolonomicProblem, search: Search, mean: float, least: float) -> float:
    """Mehrotra's predictor: sets what the corrector aims at, and returns its barrier."""
    at, step, products = search.at, search.step, search.products
    multipliers, changes = search.multipliers, search.changes
    products[:] = 0.0
    _step(p, search)
    primal = _longest(at, step, 1.0)
    dual, after = _room(multipliers, changes), 0.0
    for k in range(at.rooms.shape[0]):
        for w in range(at.rooms.shape[1]):
            for side, room in ((0, -step.values[k, w]), (1, step.values[k, w])):
                products[k, w, side] = -room * changes[k, w, side]
                after += (at.rooms[k, w, side] + primal * room) * (
                    multipliers[k, w, side] + dual * changes[k, w, side]
                )
    barrier = max(mean * (after / at.rooms.size / mean) ** 3, least)
    products[:] += barrier
    return barrier


@compiled
def _correct(p: HolonomicProblem, search: Search, barrier: float, least: float) -> float:
    """Step towards the products; the part of it to go, 0 if it would be less than ``least``."""
    _step(p, search)
    longest = _longest(search.at, search.step, _TO_BOUNDARY)
    return _search(p, search, barrier, longest, least * longest)


@inlined
def _longest(at: Iterate, step: Step, reach: float) -> float:
    """Largest part of a step, at most 1, that goes ``reach`` of the way to the nearest limit."""
    part = 1.0
    for k in range(at.rooms.shape[0]):
        for w in range(at.rooms.shape[1]):
            room = at.rooms[k, w, 0] if step.values[k, w] > 0.0 else at.rooms[k, w, 1]
            if part * abs(step.values[k, w]) > reach * room:
                part = reach * room / abs(step.values[k, w])
    return part


@inlined
def _room(values: Float[Array, "stages rows 2"], step: Float[Array, "stages rows 2"]) -> float:
    """Largest part of a step, at most 1, that leaves every value positive or zero."""
    part = 1.0
    flat, changes = values.ravel(), step.ravel()
    for i in range(len(flat)):
        if part * changes[i] < -flat[i]:
            part = -flat[i] / changes[i]
    return part


@compiled
def _merit(
    p: HolonomicProblem,
    velocities: Float[Array, "stages 3"],
    bounds: Float[Array, "stages rows"],
    barrier: float,
) -> float:
    """J with a logarithmic barrier before every limit; infinite beyond."""
    total, twists = cost(p, roll_out(p, velocities), velocities), twists_of(p, velocities)
    for k in range(len(velocities)):
        room = 1.0
        for i in range(bounds.shape[1]):
            value = limited(p, i, twists, k) / bounds[k, i]
            if not abs(value) < 1.0:
                return np.inf
            room *= (1.0 - value) * (1.0 + value)
        total -= barrier * log(room)
    return total


@inlined
def _search(
    p: HolonomicProblem, search: Search, barrier: float, longest: float, least: float
) -> float:
    """Part of a step, found by halving, with which the merit falls enough; 0 if there is none."""
    at, step = search.at, search.step
    descent = (at.by_velocity * step.velocities).sum() + (at.by_state * step.poses).sum()
    for k in range(at.rooms.shape[0]):
        for w in range(at.rooms.shape[1]):
            push = barrier / at.rooms[k, w, 0] - barrier / at.rooms[k, w, 1]
            descent += push * step.values[k, w]
    if not descent < 0.0:
        return 0.0
    merit, part = _merit(p, at.velocities, at.bounds, barrier), longest
    for _ in range(_MAX_HALVINGS):
        reached = _merit(p, at.velocities + part * step.velocities, at.bounds, barrier)
        if reached <= merit + _ARMIJO * part * descent + _ROUNDING * abs(merit):
            return part
        part *= 0.5
        if part < least:
            break
    return 0.0
