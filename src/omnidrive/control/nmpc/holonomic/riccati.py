"""Newton step by a backward and a forward Riccati sweep."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.stage_point import StagePoint

_MIN_CURVATURE = 1e-10
"""Pivot up to which a matrix counts as not positive definite."""
MAX_SHIFT = 1e12
"""Shift from which the factorisation counts as failed: the Hessian is negligible, or NaN."""


class Factors(NamedTuple):
    """Result of the backward sweep over the Hessian.

    The state of a stage in the sweep is the pose and, if a limit couples the stage to the one
    before, the velocity of that: 3 or 6 numbers.
    """

    weights: Float[Array, "stages rows"]
    """Weights of half the squares of the limits' values; input of the sweep."""
    widths: Int[Array, " stages"]
    """Number of entries of every stage's state."""
    gains: Float[Array, "stages 3 6"]
    """Negative feedback gains of the velocity's step on the deviation of the state."""
    lower: Float[Array, "stages 6"]
    """Cholesky factor of every stage's Hessian by its velocity, row by row, with the inverse of its
    diagonal on its diagonal."""


class Step(NamedTuple):
    """Changes of a :class:`StagePoint`."""

    velocities: Float[Array, "stages 3"]
    poses: Float[Array, "points 3"]
    values: Float[Array, "stages rows"]
    """First-order changes of the values of limits with a weight."""


@compiled
def allocate_factors(stages: int, rows: int) -> Factors:
    """Return uninitialised factors; the caller fills in ``weights``, :func:`factorise` the rest."""
    return Factors(
        np.empty((stages, rows)),
        np.empty(stages, dtype=np.int64),
        np.empty((stages, 3, 6)),
        np.empty((stages, 6)),
    )


@compiled
def allocate_step(stages: int, rows: int) -> Step:
    """Return an uninitialised step; :func:`newton_step` fills it in."""
    return Step(np.empty((stages, 3)), np.empty((stages + 1, 3)), np.empty((stages, rows)))


@compiled
def factorise_shifted(p: HolonomicProblem, point: StagePoint, f: Factors, last: float) -> float:
    """Factorise the Hessian, modified until it is positive definite; return its shift.

    First the curvature of keep-out zones is omitted (Gauss-Newton), and if that is not enough,
    the diagonal is shifted as in IPOPT's inertia correction (Wachter & Biegler, Math. Program. 106,
    2006, algorithm IC). A result of :data:`MAX_SHIFT` or more is a failure.

    Args:
        p: The problem.
        point: Point of the Hessian of the Lagrangian.
        f: Input: the weights; output: the rest.
        last: Shift of the previous iteration.
    """
    if factorise_convex(p, point, f):
        return last / 3.0
    shift = max(last / 3.0, 1e-3)
    while shift < MAX_SHIFT and not factorise(p, point, 0.0, shift, f):
        shift *= 4.0
    return shift


@compiled
def factorise_convex(p: HolonomicProblem, point: StagePoint, f: Factors) -> bool:
    """Factorise the Hessian, exact or without the curvature of keep-out zones.

    Return False if neither is positive definite.
    """
    if factorise(p, point, 1.0, 0.0, f):
        return True
    return len(p.keep_outs.radii) > 0 and factorise(p, point, 0.0, 0.0, f)


@compiled
def factorise(
    p: HolonomicProblem, point: StagePoint, curvature: float, shift: float, f: Factors
) -> bool:
    """Factorise the Hessian by a backward Riccati sweep; False if it is not positive definite.

    ``value`` is the Hessian of the cost to go by (x_{k+1}, v_k), where x_{k+1} = x_k + dt v_k.

    Args:
        p: The problem.
        point: Point of the Hessian.
        curvature: Factor of the curvature of keep-out zones: 1 is the exact Hessian.
        shift: Added to the diagonal.
        f: Input: the weights; output: the rest.
    """
    stages, dt, wide = len(point.velocities), p.dt, False
    value, cross = np.zeros((6, 6)), np.empty((3, 6))
    uu, h = np.empty((3, 3)), np.empty((7, 7))
    for i in range(3):
        value[i, i] = 2.0 * p.state_weights[stages, i]
    _add_keep_out_hessian(point, stages, curvature, value)
    for k in range(stages - 1, -1, -1):
        width = _hessian_of_limits(point, f.weights, k, h)
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
        _add_keep_out_hessian(point, k, curvature, value)
    return True


@compiled
def _fill_blocks(  # noqa: PLR0917
    dt: float,
    value: Float[Array, "6 6"],
    wide: bool,
    h: Float[Array, "7 7"],
    width: int,
    cross: Float[Array, "3 6"],
    uu: Float[Array, "3 3"],
) -> None:
    """Fill in the Hessian of the cost to go by v_k and the state, and by v_k twice.

    Args:
        dt: Length of a stage, in s.
        value: Hessian of the later cost by (x_{k+1}, v_k).
        wide: Whether ``value`` depends on v_k.
        h: Hessian of the stage's limits by yaw, v_k and v_{k-1}.
        width: Number of entries of the stage's state.
        cross: Output: by v_k and the state.
        uu: Output: by v_k twice, lower triangle.
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


@compiled
def _add_keep_out_hessian(
    point: StagePoint, k: int, curvature: float, value: Float[Array, "6 6"]
) -> None:
    """Add the Hessian of the keep-out cost of state k."""
    cross = point.hessian_position[k, 0, 1] + curvature * point.hessian_position[k, 1, 1]
    value[0, 0] += point.hessian_position[k, 0, 0] + curvature * point.hessian_position[k, 1, 0]
    value[1, 0] += cross
    value[0, 1] += cross
    value[1, 1] += point.hessian_position[k, 0, 2] + curvature * point.hessian_position[k, 1, 2]


@compiled
def _hessian_of_limits(
    point: StagePoint, weights: Float[Array, "stages rows"], k: int, h: Float[Array, "7 7"]
) -> int:
    """Fill in the Hessian of a stage's limits by yaw, v_k, v_{k-1}: lower triangle.

    Return the number of entries of the stage's state.
    """
    jacobian, hessian, width = point.jacobian, point.hessian, 3
    for a in range(7):
        for b in range(a + 1):
            h[a, b] = hessian[k, a, b]
            if a > 3 and h[a, b] != 0.0:
                width = 6
    for w in range(weights.shape[1]):
        weight = weights[k, w]
        if weight != 0.0:
            own = 4
            if jacobian[k, w, 4] != 0.0 or jacobian[k, w, 5] != 0.0 or jacobian[k, w, 6] != 0.0:
                own, width = 7, 6
            for a in range(own):
                part = weight * jacobian[k, w, a]
                for b in range(a + 1):
                    h[a, b] += part * jacobian[k, w, b]
    return width


@compiled
def _widen(h: Float[Array, "7 7"], value: Float[Array, "6 6"]) -> None:
    """Fill in the part of the stage's limits in the Hessian by v_{k-1} and (x_k, v_{k-1})."""
    for a in range(3, 6):
        for b in range(3):
            value[a, b] = h[1 + a, 0] if b == 2 else 0.0
            value[b, a] = value[a, b]
        for b in range(3, a + 1):
            value[a, b] = value[b, a] = h[1 + a, 1 + b]


@compiled
def _cholesky(matrix: Float[Array, "3 3"], lower: Float[Array, "stages 6"], k: int) -> bool:
    """Factorise a symmetric matrix into row k; False if it is not positive definite."""
    if not matrix[0, 0] > _MIN_CURVATURE:
        return False
    d0 = 1.0 / sqrt(matrix[0, 0])
    l10, l20 = matrix[1, 0] * d0, matrix[2, 0] * d0
    rest = matrix[1, 1] - l10 * l10
    if not rest > _MIN_CURVATURE:
        return False
    d1 = 1.0 / sqrt(rest)
    l21 = (matrix[2, 1] - l20 * l10) * d1
    rest = matrix[2, 2] - l20 * l20 - l21 * l21
    if not rest > _MIN_CURVATURE:
        return False
    lower[k, 0], lower[k, 1], lower[k, 2] = d0, l10, d1
    lower[k, 3], lower[k, 4], lower[k, 5] = l20, l21, 1.0 / sqrt(rest)
    return True


@compiled
def _solve(
    lower: Float[Array, "stages 6"], k: int, right: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Solve a linear system with row k of the factors of :func:`_cholesky`."""
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
    point: StagePoint,
    f: Factors,
    multipliers: Float[Array, "stages rows"],
    step: Step,
) -> None:
    """Minimise the quadratic model of the Lagrangian with a penalty.

    The model is J + ``multipliers @ values + weights / 2 @ values^2``, with first derivatives of
    the limits' values and the second derivatives in ``point.hessian``.

    Args:
        p: The problem.
        point: Point of the model.
        f: Factors of the model's Hessian, from :func:`factorise`.
        multipliers: Linear coefficients of the changes of the limits' values.
        step: Output: the minimum.
    """
    _fill_offsets(p, point, f, multipliers, step.velocities)
    deviation = np.zeros(6)
    for i in range(3):
        step.poses[0, i] = 0.0
    for k in range(len(point.velocities)):
        for w in range(multipliers.shape[1]):
            step.values[k, w] = 0.0
            if f.weights[k, w] != 0.0:
                step.values[k, w] = point.jacobian[k, w, 0] * deviation[2]
                for i in range(3):
                    step.values[k, w] += point.jacobian[k, w, 4 + i] * deviation[3 + i]
        for i in range(3):
            for j in range(f.widths[k]):
                step.velocities[k, i] -= f.gains[k, i, j] * deviation[j]
        for i in range(3):
            deviation[3 + i] = step.velocities[k, i]
            deviation[i] += p.dt * step.velocities[k, i]
            step.poses[k + 1, i] = deviation[i]
        for w in range(multipliers.shape[1]):
            if f.weights[k, w] != 0.0:
                for i in range(3):
                    step.values[k, w] += point.jacobian[k, w, 1 + i] * step.velocities[k, i]


@compiled
def _fill_offsets(
    p: HolonomicProblem,
    point: StagePoint,
    f: Factors,
    multipliers: Float[Array, "stages rows"],
    offsets: Float[Array, "stages 3"],
) -> None:
    """Fill in the constant part of every velocity's step by a backward sweep."""
    stages, gradient = len(point.velocities), np.zeros(6)
    for i in range(3):
        gradient[i] = point.gradient_state[stages, i]
    for k in range(stages - 1, -1, -1):
        r0 = point.gradient_velocity[k, 0] + p.dt * gradient[0] + gradient[3]
        r1 = point.gradient_velocity[k, 1] + p.dt * gradient[1] + gradient[4]
        r2 = point.gradient_velocity[k, 2] + p.dt * gradient[2] + gradient[5]
        gradient[3:] = 0.0
        for w in range(multipliers.shape[1]):
            multiplier = multipliers[k, w]
            if multiplier != 0.0:
                r0 += multiplier * point.jacobian[k, w, 1]
                r1 += multiplier * point.jacobian[k, w, 2]
                r2 += multiplier * point.jacobian[k, w, 3]
                gradient[2] += multiplier * point.jacobian[k, w, 0]
                for i in range(3):
                    gradient[3 + i] += multiplier * point.jacobian[k, w, 4 + i]
        s0, s1, s2 = _solve(f.lower, k, (r0, r1, r2))
        offsets[k, 0], offsets[k, 1], offsets[k, 2] = -s0, -s1, -s2
        for i in range(f.widths[k]):
            for j, right in enumerate((r0, r1, r2)):
                gradient[i] -= f.gains[k, j, i] * right
        for i in range(3):
            gradient[i] += point.gradient_state[k, i]
