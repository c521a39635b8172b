"""The unicycle's motion over the horizon, its cost, and the exact gradient of the cost."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.cost import tracking_cost
from omnidrive.control.nmpc.problem import Problem

Array = np.ndarray


@compiled
def roll_out(problem: Problem, controls: Float[Array, "stages 2"]) -> Float[Array, "points 3"]:
    """States that ``controls`` lead through: explicit Euler, as in the paper."""
    states = np.empty((len(controls) + 1, 3))
    for i in range(3):
        states[0, i] = problem.start[i]
    for k in range(len(controls)):
        travel, yaw = problem.dt * controls[k, 0], states[k, 2]
        states[k + 1, 0] = states[k, 0] + travel * cos(yaw)
        states[k + 1, 1] = states[k, 1] + travel * sin(yaw)
        states[k + 1, 2] = yaw + problem.dt * controls[k, 1]
    return states


@compiled
def linearise(
    problem: Problem, state: Float[Array, " 3"], control: Float[Array, " 2"]
) -> tuple[Float[Array, "3 3"], Float[Array, "3 2"]]:
    """Derivatives A, B of the next state by this state and control."""
    c, s = problem.dt * cos(state[2]), problem.dt * sin(state[2])
    by_state, by_control = np.zeros((3, 3)), np.zeros((3, 2))
    by_state[0, 0] = by_state[1, 1] = by_state[2, 2] = 1.0
    by_state[0, 2], by_state[1, 2] = -control[0] * s, control[0] * c
    by_control[0, 0], by_control[1, 0], by_control[2, 1] = c, s, problem.dt
    return by_state, by_control


@compiled
def cost(
    problem: Problem, states: Float[Array, "points 3"], controls: Float[Array, "stages 2"]
) -> float:
    """J of :class:`Problem`."""
    p = problem
    return tracking_cost(
        states, p.targets, p.state_weights, controls, p.feedforward, p.control_weights
    )


@compiled
def costates(
    problem: Problem, states: Float[Array, "points 3"], controls: Float[Array, "stages 2"]
) -> Float[Array, "points 3"]:
    """dJ/dx_k with the later controls held: the adjoint of :func:`roll_out`.

    Backward recursion l_k = 2 Q_k (x_k - xref_k) + A_k' l_{k+1} (Bryson & Ho, "Applied Optimal
    Control", 1975, section 2.2), where A_k = I + [0 0 a; 0 0 b; 0 0 0].
    """
    stages = len(controls)
    adjoint = np.zeros((stages + 1, 3))
    for k in range(stages, -1, -1):
        for i in range(3):
            error = states[k, i] - problem.targets[k, i]
            adjoint[k, i] = 2.0 * problem.state_weights[k, i] * error
            if k < stages:
                adjoint[k, i] += adjoint[k + 1, i]
        if k < stages:
            travel, yaw = problem.dt * controls[k, 0], states[k, 2]
            turned = cos(yaw) * adjoint[k + 1, 1] - sin(yaw) * adjoint[k + 1, 0]
            adjoint[k, 2] += travel * turned
    return adjoint


@compiled
def gradient(
    problem: Problem,
    states: Float[Array, "points 3"],
    controls: Float[Array, "stages 2"],
    adjoint: Float[Array, "points 3"],
) -> Float[Array, "stages 2"]:
    """dJ/du_k = 2 R (u_k - uref_k) + B_k' l_{k+1}, with ``adjoint`` from :func:`costates`."""
    slope = np.empty((len(controls), 2))
    for k in range(len(controls)):
        for i in range(2):
            deviation = controls[k, i] - problem.feedforward[k, i]
            slope[k, i] = 2.0 * problem.control_weights[i] * deviation
        yaw = states[k, 2]
        slope[k, 0] += problem.dt * (cos(yaw) * adjoint[k + 1, 0] + sin(yaw) * adjoint[k + 1, 1])
        slope[k, 1] += problem.dt * adjoint[k + 1, 2]
    return slope


@compiled
def clip(problem: Problem, controls: Float[Array, "stages 2"]) -> Float[Array, "stages 2"]:
    """Nearest controls within the limits."""
    clipped = np.empty((len(controls), 2))
    for k in range(len(controls)):
        for i in range(2):
            clipped[k, i] = min(max(controls[k, i], -problem.limits[i]), problem.limits[i])
    return clipped


@compiled
def kkt_residual(
    problem: Problem, controls: Float[Array, "stages 2"], slope: Float[Array, "stages 2"]
) -> float:
    """Largest entry of u - clip(u - dJ/du): zero exactly at a KKT point.

    The projected gradient step of Nocedal & Wright, "Numerical Optimization", 2006, eq. 16.71.
    ``controls`` outside the limits raise it by at least what they violate.
    """
    residual = 0.0
    for k in range(len(controls)):
        for i in range(2):
            limit = problem.limits[i]
            moved = min(max(controls[k, i] - slope[k, i], -limit), limit)
            residual = max(residual, abs(controls[k, i] - moved))
    return residual


@compiled
def assess(
    problem: Problem, controls: Float[Array, "stages 2"]
) -> tuple[Float[Array, "points 3"], float, float]:
    """States, cost and KKT residual of ``controls``."""
    states = roll_out(problem, controls)
    slope = gradient(problem, states, controls, costates(problem, states, controls))
    return states, cost(problem, states, controls), kkt_residual(problem, controls, slope)
