"""The unicycle's motion over the horizon, its cost, and the exact gradient of the cost."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.cost import tracking_cost
from omnidrive.control.nmpc.point import Point, blank_point
from omnidrive.control.nmpc.problem import Problem


@compiled
def roll_out(problem: Problem, controls: Float[Array, "stages 2"]) -> Float[Array, "points 3"]:
    """States that ``controls`` lead through: explicit Euler, as in the paper."""
    states = np.empty((len(controls) + 1, 3))
    _move(problem, controls, states, np.empty((len(controls), 2)))
    return states


@inlined
def _move(
    problem: Problem,
    controls: Float[Array, "stages 2"],
    states: Float[Array, "points 3"],
    courses: Float[Array, "stages 2"],
) -> None:
    """Fill in the states and courses (:class:`Point`) of ``controls``."""
    dt, start, stages = problem.dt, problem.start, len(controls)
    x, y, yaw = start[0], start[1], start[2]
    for k in range(stages):
        states[k, 0], states[k, 1], states[k, 2] = x, y, yaw
        courses[k, 0], courses[k, 1] = dt * cos(yaw), dt * sin(yaw)
        x += controls[k, 0] * courses[k, 0]
        y += controls[k, 0] * courses[k, 1]
        yaw += controls[k, 1] * dt
    states[stages, 0], states[stages, 1], states[stages, 2] = x, y, yaw


@inlined
def cost(
    problem: Problem, states: Float[Array, "points 3"], controls: Float[Array, "stages 2"]
) -> float:
    """J of :class:`Problem`."""
    p = problem
    return tracking_cost(
        states, p.targets, p.state_weights, controls, p.feedforward, p.control_weights
    )


@inlined
def drive(problem: Problem, point: Point) -> float:
    """Fill in where the controls of ``point`` lead, its states and courses; return J."""
    _move(problem, point.controls, point.states, point.courses)
    return cost(problem, point.states, point.controls)


@inlined
def differentiate(problem: Problem, point: Point) -> None:
    """Fill in the derivatives of J where ``point`` was driven.

    Backward recursion l_k = 2 Q_k (x_k - xref_k) + A_k' l_{k+1}, dJ/du_k = 2 R (u_k - uref_k) +
    B_k' l_{k+1} (Bryson & Ho, "Applied Optimal Control", 1975, section 2.2), where
    A_k = I + v_k [0 0 -b; 0 0 a; 0 0 0] and B_k = [a 0; b 0; 0 dt] with the course (a, b).
    """
    controls, states, courses, costates, slope, _ = point
    dt, targets, weights = problem.dt, problem.targets, problem.state_weights
    feedforward, control_weights = problem.feedforward, problem.control_weights
    x = y = yaw = 0.0
    for k in range(len(controls), -1, -1):
        if k < len(controls):
            a, b = courses[k, 0], courses[k, 1]
            slope[k, 0] = a * x + b * y
            slope[k, 1] = dt * yaw
            for i in range(2):
                slope[k, i] += 2.0 * control_weights[i] * (controls[k, i] - feedforward[k, i])
            yaw += controls[k, 0] * (a * y - b * x)
        x += 2.0 * weights[k, 0] * (states[k, 0] - targets[k, 0])
        y += 2.0 * weights[k, 1] * (states[k, 1] - targets[k, 1])
        yaw += 2.0 * weights[k, 2] * (states[k, 2] - targets[k, 2])
        costates[k, 0], costates[k, 1], costates[k, 2] = x, y, yaw
    _find_free(problem, point)


@inlined
def _find_free(problem: Problem, point: Point) -> None:
    controls, slope, free, limits = point.controls, point.gradient, point.free, problem.limits
    for k in range(len(controls)):
        for i in range(2):
            outward = slope[k, i] * controls[k, i] < 0.0
            free[k, i] = abs(controls[k, i]) < limits[i] or not outward


@inlined
def evaluate(problem: Problem, controls: Float[Array, "stages 2"]) -> tuple[Point, float]:
    """All about ``controls``, and J."""
    point = blank_point(len(controls))
    for k in range(len(controls)):
        point.controls[k, 0], point.controls[k, 1] = controls[k, 0], controls[k, 1]
    value = drive(problem, point)
    differentiate(problem, point)
    return point, value


@inlined
def clipped(control: float, limit: float) -> float:
    """Nearest control within the limit."""
    return min(max(control, -limit), limit)


@compiled
def clip(problem: Problem, controls: Float[Array, "stages 2"]) -> Float[Array, "stages 2"]:
    """Nearest controls within the limits."""
    within = np.empty((len(controls), 2))
    for k in range(len(controls)):
        for i in range(2):
            within[k, i] = clipped(controls[k, i], problem.limits[i])
    return within


@inlined
def kkt_residual(problem: Problem, point: Point) -> float:
    """Largest entry of u - clip(u - dJ/du): zero exactly at a KKT point.

    The projected gradient step of Nocedal & Wright, "Numerical Optimization", 2006, eq. 16.71.
    Controls outside the limits raise it by at least what they violate.
    """
    controls, slope, limits = point.controls, point.gradient, problem.limits
    residual = 0.0
    for k in range(len(controls)):
        for i in range(2):
            moved = clipped(controls[k, i] - slope[k, i], limits[i])
            residual = max(residual, abs(controls[k, i] - moved))
    return residual


@compiled
def assess(
    problem: Problem, controls: Float[Array, "stages 2"]
) -> tuple[Float[Array, "points 3"], float, float]:
    """States, cost and KKT residual of ``controls``."""
    point, value = evaluate(problem, controls)
    return point.states, value, kkt_residual(problem, point)
