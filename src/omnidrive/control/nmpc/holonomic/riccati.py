"""Newton's step, by one backward and one forward sweep."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.holonomic.iterate import Iterate
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

_LEAST_CURVATURE = 1e-10
"""A pivot up to this counts as not positive."""
LARGEST_SHIFT = 1e12
"""From here on nothing is left of the Hessian: it is beyond use, or not a number."""


class Factors(NamedTuple):
    """What the backward sweep over the Hessian leaves.

    What a stage needs to know of those before it is its state: the pose and, where a limit binds it
    to the stage before, the velocity of that: 3 or 6 numbers.
    """

    weights: Float[Array, "stages rows"]
    """What half the square of every limit's value is weighed with."""
    widths: Int[Array, " stages"]
    """Numbers in the state of every stage."""
    gains: Float[Array, "stages 3 6"]
    """From the deviation of a state to the step of the velocity, negated."""
    lower: Float[Array, "stages 6"]
    """Cholesky factor of every stage's Hessian by its velocity, row by row, with the inverse of its
    diagonal on its diagonal."""


class Step(NamedTuple):
    """Changes of an :class:`Iterate`; of the values of weighed limits, to first order."""

    velocities: Float[Array, "stages 3"]
    poses: Float[Array, "points 3"]
    values: Float[Array, "stages rows"]


@inlined
def factors(stages: int, rows: int) -> Factors:
    """For :func:`factorise` to fill in; ``weights`` are for the caller."""
    return Factors(
        np.empty((stages, rows)),
        np.empty(stages, dtype=np.int64),
        np.empty((stages, 3, 6)),
        np.empty((stages, 6)),
    )


@inlined
def step_of(stages: int, rows: int) -> Step:
    """For :func:`newton_step` to fill in."""
    return Step(np.empty((stages, 3)), np.empty((stages + 1, 3)), np.empty((stages, rows)))


@inlined
def factorise(p: HolonomicProblem, at: Iterate, f: Factors, last: float) -> float:
    """Factorise the Hessian, changed as little as makes it positive definite; returns its shift.

    From :data:`LARGEST_SHIFT` on it failed.

    First the keep-outs' cost is taken as that of planes (Gauss-Newton), and if that does not do,
    the diagonal is shifted as in IPOPT's inertia correction (Wachter & Biegler, Math. Program. 106,
    2006, algorithm IC).

    Args:
        p: The problem.
        at: Where the Hessian is taken: of J and the limits, with the multipliers.
        f: Has the weights; the rest is filled in.
        last: The shift of the iterate before.
    """
    if is_convex(p, at, f):
        return last / 3.0
    shift = max(last / 3.0, 1e-3)
    while shift < LARGEST_SHIFT and not is_definite(p, at, 0.0, shift, f):
        shift *= 4.0
    return shift


@inlined
def is_convex(p: HolonomicProblem, at: Iterate, f: Factors) -> bool:
    """Factorise the Hessian, or that with keep-outs as planes; False if neither is definite."""
    if is_definite(p, at, 1.0, 0.0, f):
        return True
    return len(p.keep_outs.radii) > 0 and is_definite(p, at, 0.0, 0.0, f)


@compiled
def is_definite(
    p: HolonomicProblem, at: Iterate, roundness: float, shift: float, f: Factors
) -> bool:
    """Backward Riccati sweep; False if the Hessian is not positive definite.

    With V the Hessian of the cost to go by (x_{k+1}, v_k), and x_{k+1} = x_k + dt v_k.

    Args:
        p: The problem.
        at: Where the Hessian is taken.
        roundness: Part of the curvature of keep-outs to count: 1 for the exact Hessian.
        shift: To add to the diagonal.
        f: Has the weights; the rest is filled in.
    """
    stages, dt, wide = len(at.velocities), p.dt, False
    value, cross = np.zeros((6, 6)), np.empty((3, 6))
    uu, h = np.empty((3, 3)), np.empty((7, 7))
    for i in range(3):
        value[i, i] = 2.0 * p.state_weights[stages, i]
    _add_place(at, stages, roundness, value)
    for k in range(stages - 1, -1, -1):
        width = _hessian_of_limits(at, f.weights, k, h)
        f.widths[k] = width
        _fill_blocks(dt, value, wide, h, width, cross, uu)
        for a in range(3):
            uu[a, a] += 2.0 * p.control_weights[a] + shift
        if not _cholesky(uu, f.lower, k):
            return False
        for b in range(width):
            f.gains[k, 0, b], f.gains[k, 1, b], f.gains[k, 2, b] = _solve(
                f.lower, k, (cross[0, b], cross[1, b], cross[2, b])
            )
        value[2, 2] += h[0, 0]
        wide = width > 3
        if wide:
            _widen(h, value)
        for a in range(width):
            for b in range(a + 1):
                for c in range(3):
                    value[a, b] -= cross[c, a] * f.gains[k, c, b]
                value[b, a] = value[a, b]
        for i in range(3):
            value[i, i] += 2.0 * p.state_weights[k, i]
        _add_place(at, k, roundness, value)
    return True


@inlined
def _fill_blocks(  # noqa: PLR0917
    dt: float,
    value: Float[Array, "6 6"],
    wide: bool,
    h: Float[Array, "7 7"],
    width: int,
    cross: Float[Array, "3 6"],
    uu: Float[Array, "3 3"],
) -> None:
    """Hessian by v_k and the state, and by v_k twice (its lower half), of all that comes after.

    Args:
        dt: Length of a stage, in s.
        value: V, by (x_{k+1}, v_k).
        wide: Whether it depends on v_k.
        h: That of the stage's limits, by yaw, v_k and v_{k-1}.
        width: Numbers in the state of the stage.
        cross: To fill in.
        uu: To fill in.
    """
    for a in range(3):
        for b in range(3):
            cross[a, b] = dt * value[a, b]
        for b in range(a + 1):
            uu[a, b] = h[1 + a, 1 + b] + dt * cross[a, b]
        cross[a, 2] += h[1 + a, 0]
        for b in range(3, width):
            cross[a, b] = h[1 + b, 1 + a]
    if wide:
        for a in range(3):
            for b in range(3):
                cross[a, b] += value[3 + a, b]
            for b in range(a + 1):
                uu[a, b] += dt * (value[3 + a, b] + value[a, 3 + b]) + value[3 + a, 3 + b]


@inlined
def _add_place(at: Iterate, k: int, roundness: float, value: Float[Array, "6 6"]) -> None:
    """Add the Hessian of the keep-outs at state k."""
    cross = at.by_place[k, 0, 1] + roundness * at.by_place[k, 1, 1]
    value[0, 0] += at.by_place[k, 0, 0] + roundness * at.by_place[k, 1, 0]
    value[1, 0] += cross
    value[0, 1] += cross
    value[1, 1] += at.by_place[k, 0, 2] + roundness * at.by_place[k, 1, 2]


@inlined
def _hessian_of_limits(
    at: Iterate, weights: Float[Array, "stages rows"], k: int, h: Float[Array, "7 7"]
) -> int:
    """Lower half of the Hessian of a stage's limits by yaw, v_k, v_{k-1}; width of its state."""
    slopes, bends, width = at.slopes, at.bends, 3
    for a in range(7):
        for b in range(a + 1):
            h[a, b] = bends[k, a, b] if a < 4 else 0.0
    for w in range(weights.shape[1]):
        weight = weights[k, w]
        if weight != 0.0:
            own = 4
            if slopes[k, w, 4] != 0.0 or slopes[k, w, 5] != 0.0 or slopes[k, w, 6] != 0.0:
                own, width = 7, 6
            for a in range(own):
                part = weight * slopes[k, w, a]
                for b in range(a + 1):
                    h[a, b] += part * slopes[k, w, b]
    return width


@inlined
def _widen(h: Float[Array, "7 7"], value: Float[Array, "6 6"]) -> None:
    """Put in what the Hessian of the cost to go by (x_k, v_{k-1}) has from the stage's limits."""
    for a in range(3, 6):
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
    p: HolonomicProblem, at: Iterate, f: Factors, pulls: Float[Array, "stages rows"], step: Step
) -> None:
    """Fill in the minimum of the quadratic model, in which the limits' values are also pulled at.

    Of J, the bends of the limits, ``weights / 2 values^2`` and ``pulls values``.
    """
    _fill_offsets(p, at, f, pulls, step.velocities)
    moved = np.zeros(6)
    for i in range(3):
        step.poses[0, i] = 0.0
    for k in range(len(at.velocities)):
        for w in range(pulls.shape[1]):
            step.values[k, w] = 0.0
            if f.weights[k, w] != 0.0:
                step.values[k, w] = at.slopes[k, w, 0] * moved[2]
                for i in range(3):
                    step.values[k, w] += at.slopes[k, w, 4 + i] * moved[3 + i]
        for i in range(3):
            for j in range(f.widths[k]):
                step.velocities[k, i] -= f.gains[k, i, j] * moved[j]
        for i in range(3):
            moved[3 + i] = step.velocities[k, i]
            moved[i] += p.dt * step.velocities[k, i]
            step.poses[k + 1, i] = moved[i]
        for w in range(pulls.shape[1]):
            if f.weights[k, w] != 0.0:
                for i in range(3):
                    step.values[k, w] += at.slopes[k, w, 1 + i] * step.velocities[k, i]


@inlined
def _fill_offsets(
    p: HolonomicProblem,
    at: Iterate,
    f: Factors,
    pulls: Float[Array, "stages rows"],
    offsets: Float[Array, "stages 3"],
) -> None:
    """Part of every velocity's step that depends on no state's: the backward sweep."""
    stages, slope = len(at.velocities), np.zeros(6)
    for i in range(3):
        slope[i] = at.by_state[stages, i]
    for k in range(stages - 1, -1, -1):
        r0 = at.by_velocity[k, 0] + p.dt * slope[0] + slope[3]
        r1 = at.by_velocity[k, 1] + p.dt * slope[1] + slope[4]
        r2 = at.by_velocity[k, 2] + p.dt * slope[2] + slope[5]
        slope[3:] = 0.0
        for w in range(pulls.shape[1]):
            pull = pulls[k, w]
            if pull != 0.0:
                r0 += pull * at.slopes[k, w, 1]
                r1 += pull * at.slopes[k, w, 2]
                r2 += pull * at.slopes[k, w, 3]
                slope[2] += pull * at.slopes[k, w, 0]
                for i in range(3):
                    slope[3 + i] += pull * at.slopes[k, w, 4 + i]
        s0, s1, s2 = _solve(f.lower, k, (r0, r1, r2))
        offsets[k, 0], offsets[k, 1], offsets[k, 2] = -s0, -s1, -s2
        for i in range(f.widths[k]):
            for j, right in enumerate((r0, r1, r2)):
                slope[i] -= f.gains[k, j, i] * right
        for i in range(3):
            slope[i] += at.by_state[k, i]
