"""Newton's step of the interior-point method, by one backward and one forward sweep."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.holonomic.iterate import Iterate
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

Array = np.ndarray

_LEAST_CURVATURE = 1e-10
"""A pivot up to this counts as not positive."""


class Factors(NamedTuple):
    """What the backward sweep over the Hessian leaves.

    What a stage needs to know of those before it is its state: the pose and, where limits bind a
    stage to the next, the velocity of the stage before: ``width`` 3 or 6 numbers.
    """

    gains: Float[Array, "stages 3 width"]
    """From the deviation of a state to the step of the velocity, negated."""
    lower: Float[Array, "stages 6"]
    """Cholesky factor of every stage's Hessian by its velocity, row by row, with the inverse of its
    diagonal on its diagonal."""


class Step(NamedTuple):
    """Changes of an :class:`Iterate`; of the values of its limits, to first order."""

    velocities: Float[Array, "stages 3"]
    poses: Float[Array, "points 3"]
    values: Float[Array, "stages rows"]
    multipliers: Float[Array, "stages rows 2"]


@inlined
def factorise(p: HolonomicProblem, at: Iterate, f: Factors, last: float) -> float:
    """Factorise the Hessian, shifted as little as makes it positive definite; returns the shift.

    IPOPT's inertia correction (Wachter & Biegler, Math. Program. 106, 2006, algorithm IC).

    Args:
        p: The problem.
        at: Where the Hessian is taken: of J and the limits, with the multipliers.
        f: To fill in.
        last: The shift of the iterate before.
    """
    if _sweep(p, at, 0.0, f):
        return last / 3.0
    shift = max(last / 3.0, 1e-3)
    while not _sweep(p, at, shift, f) and shift < 1e12:
        shift *= 4.0
    return shift


@compiled
def _sweep(p: HolonomicProblem, at: Iterate, shift: float, f: Factors) -> bool:
    """Backward Riccati sweep; False if the Hessian, shifted, is not positive definite.

    With V the Hessian of the cost to go by (x_{k+1}, v_k), and x_{k+1} = x_k + dt v_k.
    """
    stages, dt, width = len(at.velocities), p.dt, f.gains.shape[2]
    value, cross = np.zeros((6, 6)), np.empty((3, 6))
    uu, h = np.empty((3, 3)), np.empty((7, 7))
    for i in range(3):
        value[i, i] = 2.0 * p.state_weights[stages, i]
    _add_place(at, stages, value)
    for k in range(stages - 1, -1, -1):
        _hessian_of_limits(at, k, 1 + width, h)
        for a in range(3):
            for b in range(3):
                cross[a, b] = dt * value[a, b] + value[3 + a, b]
            for b in range(a + 1):
                uu[a, b] = h[1 + a, 1 + b] + value[3 + a, 3 + b]
                uu[a, b] += dt * (cross[a, b] + value[a, 3 + b])
            uu[a, a] += 2.0 * p.control_weights[a] + shift
            cross[a, 2] += h[1 + a, 0]
            for b in range(3, width):
                cross[a, b] = h[1 + b, 1 + a]
        if not _cholesky(uu, f.lower, k):
            return False
        for b in range(width):
            f.gains[k, 0, b], f.gains[k, 1, b], f.gains[k, 2, b] = _solve(
                f.lower, k, (cross[0, b], cross[1, b], cross[2, b])
            )
        _fold(h, width, value)
        for a in range(width):
            for b in range(a + 1):
                for c in range(3):
                    value[a, b] -= cross[c, a] * f.gains[k, c, b]
                value[b, a] = value[a, b]
        for i in range(3):
            value[i, i] += 2.0 * p.state_weights[k, i]
        _add_place(at, k, value)
    return True


@inlined
def _add_place(at: Iterate, k: int, value: Float[Array, "6 6"]) -> None:
    """Add the Hessian of the keep-outs at state k."""
    value[0, 0] += at.by_place[k, 0]
    value[1, 0] += at.by_place[k, 1]
    value[0, 1] += at.by_place[k, 1]
    value[1, 1] += at.by_place[k, 2]


@inlined
def _hessian_of_limits(at: Iterate, k: int, size: int, h: Float[Array, "7 7"]) -> None:
    """Lower half of the Hessian of a stage's limits by the first ``size`` of yaw, v_k, v_{k-1}."""
    slopes, multipliers, rooms, bends = at.slopes, at.multipliers, at.rooms, at.bends
    for a in range(size):
        for b in range(a + 1):
            h[a, b] = bends[k, a, b] if a < 4 else 0.0
    for w in range(rooms.shape[1]):
        weight = multipliers[k, w, 0] / rooms[k, w, 0] + multipliers[k, w, 1] / rooms[k, w, 1]
        own = 7 if slopes[k, w, 4] != 0.0 or slopes[k, w, 5] != 0.0 or slopes[k, w, 6] != 0.0 else 4
        for a in range(min(own, size)):
            part = weight * slopes[k, w, a]
            for b in range(a + 1):
                h[a, b] += part * slopes[k, w, b]


@inlined
def _fold(h: Float[Array, "7 7"], width: int, value: Float[Array, "6 6"]) -> None:
    """Hessian of the cost to go by (x_k, v_{k-1}) with v_k held, of that by (x_{k+1}, v_k)."""
    value[2, 2] += h[0, 0]
    for a in range(3, width):
        for b in range(3):
            value[a, b] = h[1 + a, 0] if b == 2 else 0.0
            value[b, a] = value[a, b]
        for b in range(3, a + 1):
            value[a, b] = value[b, a] = h[1 + a, 1 + b]


@inlined
def _cholesky(matrix: Float[Array, "3 3"], lower: Float[Array, "stages 6"], k: int) -> bool:
    """Factor of the lower half into row k; False if not positive definite."""
    if not matrix[0, 0] > _LEAST_CURVATURE:
        return False
    d0 = 1.0 / sqrt(matrix[0, 0])
    l10, l20 = matrix[1, 0] * d0, matrix[2, 0] * d0
    rest = matrix[1, 1] - l10 * l10
    if not rest > _LEAST_CURVATURE:
        return False
    d1 = 1.0 / sqrt(rest)
    l21 = (matrix[2, 1] - l20 * l10) * d1
    rest = matrix[2, 2] - l20 * l20 - l21 * l21
    if not rest > _LEAST_CURVATURE:
        return False
    lower[k, 0], lower[k, 1], lower[k, 2] = d0, l10, d1
    lower[k, 3], lower[k, 4], lower[k, 5] = l20, l21, 1.0 / sqrt(rest)
    return True


@inlined
def _solve(
    lower: Float[Array, "stages 6"], k: int, right: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Solve with a factor of :func:`_cholesky`."""
    d0, l10, d1 = lower[k, 0], lower[k, 1], lower[k, 2]
    l20, l21, d2 = lower[k, 3], lower[k, 4], lower[k, 5]
    y0 = right[0] * d0
    y1 = (right[1] - l10 * y0) * d1
    z2 = (right[2] - l20 * y0 - l21 * y1) * d2 * d2
    z1 = (y1 - l21 * z2) * d1
    return (y0 - l10 * z1 - l20 * z2) * d0, z1, z2


@compiled
def newton_step(
    p: HolonomicProblem,
    at: Iterate,
    f: Factors,
    products: Float[Array, "stages rows 2"],
    step: Step,
) -> None:
    """Fill in Newton's step towards room x multiplier = ``products``."""
    _fill_offsets(p, at, f, products, step.velocities)
    width, moved = f.gains.shape[2], np.zeros(6)
    step.poses[0] = 0.0
    for k in range(len(at.velocities)):
        yaw = moved[2]
        for w in range(at.rooms.shape[1]):
            step.values[k, w] = at.slopes[k, w, 0] * yaw
            for i in range(3, width):
                step.values[k, w] += at.slopes[k, w, 1 + i] * moved[i]
        for i in range(3):
            for j in range(width):
                step.velocities[k, i] -= f.gains[k, i, j] * moved[j]
        for i in range(3):
            moved[3 + i] = step.velocities[k, i]
            moved[i] += p.dt * step.velocities[k, i]
            step.poses[k + 1, i] = moved[i]
        for w in range(at.rooms.shape[1]):
            for i in range(3):
                step.values[k, w] += at.slopes[k, w, 1 + i] * step.velocities[k, i]
            for side, room in ((0, -step.values[k, w]), (1, step.values[k, w])):
                wanted = products[k, w, side] - at.multipliers[k, w, side] * room
                step.multipliers[k, w, side] = (
                    wanted / at.rooms[k, w, side] - at.multipliers[k, w, side]
                )


@inlined
def _fill_offsets(
    p: HolonomicProblem,
    at: Iterate,
    f: Factors,
    products: Float[Array, "stages rows 2"],
    offsets: Float[Array, "stages 3"],
) -> None:
    """Part of every velocity's step that depends on no state's: the backward sweep."""
    stages, width, slope = len(at.velocities), f.gains.shape[2], np.zeros(6)
    for i in range(3):
        slope[i] = at.by_state[stages, i]
    for k in range(stages - 1, -1, -1):
        r0 = at.by_velocity[k, 0] + p.dt * slope[0] + slope[3]
        r1 = at.by_velocity[k, 1] + p.dt * slope[1] + slope[4]
        r2 = at.by_velocity[k, 2] + p.dt * slope[2] + slope[5]
        slope[3:] = 0.0
        for w in range(at.rooms.shape[1]):
            pull = products[k, w, 0] / at.rooms[k, w, 0] - products[k, w, 1] / at.rooms[k, w, 1]
            r0 += pull * at.slopes[k, w, 1]
            r1 += pull * at.slopes[k, w, 2]
            r2 += pull * at.slopes[k, w, 3]
            slope[2] += pull * at.slopes[k, w, 0]
            for i in range(3, width):
                slope[i] += pull * at.slopes[k, w, 1 + i]
        s0, s1, s2 = _solve(f.lower, k, (r0, r1, r2))
        offsets[k, 0], offsets[k, 1], offsets[k, 2] = -s0, -s1, -s2
        for i in range(width):
            for j, right in enumerate((r0, r1, r2)):
                slope[i] -= f.gains[k, j, i] * right
        for i in range(3):
            slope[i] += at.by_state[k, i]
