"""Newton's step in the controls that are free to move, by one Riccati sweep."""

from __future__ import annotations

from math import cos, hypot, sin
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.problem import Problem
from omnidrive.control.nmpc.unicycle import linearise

Array = np.ndarray

_LEAST_CURVATURE = 1e-8
"""A control Hessian with an eigenvalue below this counts as not positive definite."""


class Point(NamedTuple):
    """Controls and what they lead to."""

    controls: Float[Array, "stages 2"]
    """Within the limits."""
    states: Float[Array, "points 3"]
    """Their roll-out."""
    costates: Float[Array, "points 3"]
    """dJ/dx_k."""
    gradient: Float[Array, "stages 2"]
    """dJ/du_k."""
    free: Bool[Array, "stages 2"]
    """False where a control stands at a limit and the gradient pushes it outward."""


@compiled
def newton_step(
    problem: Problem, point: Point, curvature: float
) -> tuple[bool, Float[Array, "stages 2"]]:
    """Minimiser of a quadratic model of J over the free controls, the others held.

    One backward and one forward sweep, linear in the number of stages: Dunn & Bertsekas,
    "Efficient dynamic programming implementations of Newton's method for unconstrained optimal
    control problems", JOTA 63, 1989; Rawlings, Mayne & Diehl, 2017, section 8.8.

    Args:
        problem: What is minimised.
        point: Where the model is taken.
        curvature: Weight of the curvature of the motion in the Hessian: 1 makes it exact, 0
            Gauss-Newton's, which is always positive definite.

    Returns:
        Whether the Hessian is positive definite in the free controls, and the step. If it is not,
        the step is a direction of negative curvature: a unit vector at the last stage that shows
        it, zero before, optimal feedback after.
    """
    stages = len(point.controls)
    gains, offsets = np.zeros((stages, 2, 3)), np.zeros((stages, 2, 1))
    value_x, value_xx = np.zeros((3, 1)), np.zeros((3, 3))
    for i in range(3):
        value_xx[i, i] = 2.0 * problem.state_weights[stages, i]
    for k in range(stages - 1, -1, -1):
        a, b = linearise(problem, point.states[k], point.controls[k])
        value_a, value_b = _product(value_xx, a), _product(value_xx, b)
        xx, ux, uu = _against(a, value_a), _against(b, value_a), _against(b, value_b)
        _add_stage(problem, point, k, curvature, (xx, ux, uu))
        definite, inverse, worst = _inverse_on(uu, point.free[k])
        if not definite:
            offsets = np.zeros((stages, 2, 1))
            offsets[k, 0, 0], offsets[k, 1, 0] = worst[0, 0], worst[1, 0]
            return False, _follow(problem, point, gains, offsets)
        u = _against(b, value_x)
        for i in range(2):
            u[i, 0] += point.gradient[k, i]
        gain, offset = _product(inverse, ux), _product(inverse, u)
        for i in range(2):
            offsets[k, i, 0] = -offset[i, 0]
            for j in range(3):
                gains[k, i, j] = -gain[i, j]
        value_x = _against(a, value_x) - _against(ux, offset)
        value_xx = xx - _against(ux, gain)
    return True, _follow(problem, point, gains, offsets)


@compiled
def _add_stage(
    problem: Problem,
    point: Point,
    k: int,
    curvature: float,
    hessians: tuple[Float[Array, "3 3"], Float[Array, "2 3"], Float[Array, "2 2"]],
) -> None:
    """Add the Hessian of stage k's cost and motion: sum_i l_i d2f_i, costate l of stage k + 1.

    ``hessians`` are those by (state, state), (control, state) and (control, control).
    """
    xx, ux, uu = hessians
    for i in range(3):
        xx[i, i] += 2.0 * problem.state_weights[k, i]
    for i in range(2):
        uu[i, i] += 2.0 * problem.control_weights[i]
    scale, yaw = curvature * problem.dt, point.states[k, 2]
    along_x, along_y = scale * point.costates[k + 1, 0], scale * point.costates[k + 1, 1]
    xx[2, 2] -= point.controls[k, 0] * (cos(yaw) * along_x + sin(yaw) * along_y)
    ux[0, 2] += cos(yaw) * along_y - sin(yaw) * along_x


@compiled
def _inverse_on(
    hessian: Float[Array, "2 2"], free: Bool[Array, " 2"]
) -> tuple[bool, Float[Array, "2 2"], Float[Array, "2 1"]]:
    """Inverse of ``hessian`` in the free controls, zero elsewhere.

    Returns:
        Whether it is positive definite there; the inverse; if it is not, a unit eigenvector of
        its least eigenvalue instead.
    """
    inverse, worst = np.zeros((2, 2)), np.zeros((2, 1))
    first, mixed, second = hessian[0, 0], hessian[0, 1], hessian[1, 1]
    if free[0] and free[1]:
        least = 0.5 * (first + second) - hypot(0.5 * (first - second), mixed)
        if least < _LEAST_CURVATURE:
            if first > second:  # of the two formulas, the one that does not cancel
                worst[0, 0], worst[1, 0] = -mixed, first - least
            else:
                worst[0, 0], worst[1, 0] = second - least, -mixed
            worst *= 1.0 / max(hypot(worst[0, 0], worst[1, 0]), 1e-300)
            return False, inverse, worst
        determinant = first * second - mixed * mixed
        inverse[0, 0], inverse[1, 1] = second / determinant, first / determinant
        inverse[0, 1] = inverse[1, 0] = -mixed / determinant
        return True, inverse, worst
    for i in range(2):
        if free[i]:
            if hessian[i, i] < _LEAST_CURVATURE:
                worst[i, 0] = 1.0
                return False, inverse, worst
            inverse[i, i] = 1.0 / hessian[i, i]
    return True, inverse, worst


@compiled
def _follow(
    problem: Problem,
    point: Point,
    gains: Float[Array, "stages 2 3"],
    offsets: Float[Array, "stages 2 1"],
) -> Float[Array, "stages 2"]:
    """Roll the feedback law ``gains @ dx + offsets`` out through the linearised motion."""
    stages = len(offsets)
    steps, deviation = np.empty((stages, 2)), np.zeros((3, 1))
    for k in range(stages):
        step = offsets[k] + _product(gains[k], deviation)
        steps[k, 0], steps[k, 1] = step[0, 0], step[1, 0]
        a, b = linearise(problem, point.states[k], point.controls[k])
        deviation = _product(a, deviation) + _product(b, step)
    return steps


@compiled
def _product(a: Float[Array, "n m"], b: Float[Array, "m p"]) -> Float[Array, "n p"]:
    """Matrix product; at this size, faster than a call of BLAS."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            for k in range(a.shape[1]):
                out[i, j] += a[i, k] * b[k, j]
    return out


@compiled
def _against(a: Float[Array, "m n"], b: Float[Array, "m p"]) -> Float[Array, "n p"]:
    """Product of the transpose of ``a`` with ``b``."""
    out = np.zeros((a.shape[1], b.shape[1]))
    for i in range(a.shape[1]):
        for j in range(b.shape[1]):
            for k in range(a.shape[0]):
                out[i, j] += a[k, i] * b[k, j]
    return out
