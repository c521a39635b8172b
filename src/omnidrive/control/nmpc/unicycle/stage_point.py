"""Iterate of the solver: controls of all stages, their states, and the derivatives of the cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.cost import tracking_cost
from omnidrive.control.nmpc.unicycle.motion import clip, fill_states
from omnidrive.control.nmpc.unicycle.problem import UnicycleProblem


class StagePoint(NamedTuple):
    """Controls of all stages and what follows from them; the kernels of this file fill it in."""

    controls: Float[Array, "stages 2"]
    """u_k: speed and yaw rate; m/s, rad/s."""
    states: Float[Array, "points 3"]
    """x_k, the roll-out of ``controls``; m, m, rad."""
    speed_jacobian: Float[Array, "stages 2"]
    """dt (cos yaw_k, sin yaw_k), in s: derivative of the position x_{k+1} by the speed v_k."""
    costates: Float[Array, "points 3"]
    """dJ/dx_k with the controls from stage k on constant."""
    gradient: Float[Array, "stages 2"]
    """dJ/du_k."""
    free: Bool[Array, "stages 2"]
    """False where a control is at a limit and the negative gradient points outward."""


@compiled
def allocate_point(stages: int) -> StagePoint:
    """Return a point with uninitialised arrays."""
    return StagePoint(
        np.empty((stages, 2)),
        np.empty((stages + 1, 3)),
        np.empty((stages, 2)),
        np.empty((stages + 1, 3)),
        np.empty((stages, 2)),
        np.empty((stages, 2), dtype=np.bool_),
    )


@compiled
def cost(
    problem: UnicycleProblem,
    states: Float[Array, "points 3"],
    controls: Float[Array, "stages 2"],
) -> float:
    """Return J of :class:`UnicycleProblem`."""
    p = problem
    return tracking_cost(
        states, p.targets, p.state_weights, controls, p.feedforward, p.control_weights
    )


@compiled
def propagate(problem: UnicycleProblem, point: StagePoint) -> float:
    """Fill in the states and the speed Jacobian of the controls of ``point``; return J."""
    fill_states(problem, point.controls, point.states, point.speed_jacobian)
    return cost(problem, point.states, point.controls)


@compiled
def differentiate(problem: UnicycleProblem, point: StagePoint) -> None:
    """Fill in costates, gradient and free controls of a point whose states are filled in.

    Backward recursion l_k = 2 Q_k (x_k - xref_k) + A_k' l_{k+1}, dJ/du_k = 2 R (u_k - uref_k) +
    B_k' l_{k+1} (Bryson & Ho, "Applied Optimal Control", 1975, section 2.2), where
    A_k = I + v_k [0 0 -b; 0 0 a; 0 0 0] and B_k = [a 0; b 0; 0 dt] with the speed Jacobian (a, b).
    """
    controls, states, jacobian, costates, gradient, _ = point
    dt, targets, weights = problem.dt, problem.targets, problem.state_weights
    feedforward, control_weights = problem.feedforward, problem.control_weights
    x = y = yaw = 0.0
    for k in range(len(controls), -1, -1):
        if k < len(controls):
            a, b = jacobian[k, 0], jacobian[k, 1]
            gradient[k, 0] = a * x + b * y
            gradient[k, 1] = dt * yaw
            for i in range(2):
                gradient[k, i] += 2.0 * control_weights[i] * (controls[k, i] - feedforward[k, i])
            yaw += controls[k, 0] * (a * y - b * x)
        x += 2.0 * weights[k, 0] * (states[k, 0] - targets[k, 0])
        y += 2.0 * weights[k, 1] * (states[k, 1] - targets[k, 1])
        yaw += 2.0 * weights[k, 2] * (states[k, 2] - targets[k, 2])
        costates[k, 0], costates[k, 1], costates[k, 2] = x, y, yaw
    _find_free(problem, point)


@compiled
def _find_free(problem: UnicycleProblem, point: StagePoint) -> None:
    controls, gradient, free, limits = point.controls, point.gradient, point.free, problem.limits
    for k in range(len(controls)):
        for i in range(2):
            outward = gradient[k, i] * controls[k, i] < 0.0
            free[k, i] = abs(controls[k, i]) < limits[i] or not outward


@compiled
def evaluate(
    problem: UnicycleProblem, controls: Float[Array, "stages 2"]
) -> tuple[StagePoint, float]:
    """Return the point of ``controls`` with all fields filled in, and J."""
    point = allocate_point(len(controls))
    for k in range(len(controls)):
        point.controls[k, 0], point.controls[k, 1] = controls[k, 0], controls[k, 1]
    value = propagate(problem, point)
    differentiate(problem, point)
    return point, value


@compiled
def kkt_residual(problem: UnicycleProblem, point: StagePoint) -> float:
    """Return the largest entry of |u - clip(u - dJ/du)|, which is zero exactly at a KKT point.

    The projected gradient step of Nocedal & Wright, "Numerical Optimization", 2006, eq. 16.71.
    A control beyond its limit makes it at least as large as the violation.
    """
    controls, gradient, limits = point.controls, point.gradient, problem.limits
    residual = 0.0
    for k in range(len(controls)):
        for i in range(2):
            projected = clip(controls[k, i] - gradient[k, i], limits[i])
            residual = max(residual, abs(controls[k, i] - projected))
    return residual
