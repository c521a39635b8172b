"""Motion of the unicycle over the horizon, and its control limits."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.unicycle.problem import UnicycleProblem


@compiled
def roll_out(
    problem: UnicycleProblem, controls: Float[Array, "stages 2"]
) -> Float[Array, "points 3"]:
    """Return the states that follow from ``controls`` by explicit Euler, as in the paper."""
    states = np.empty((len(controls) + 1, 3))
    fill_states(problem, controls, states, np.empty((len(controls), 2)))
    return states


@compiled
def fill_states(
    problem: UnicycleProblem,
    controls: Float[Array, "stages 2"],
    states: Float[Array, "points 3"],
    speed_jacobian: Float[Array, "stages 2"],
) -> None:
    """Fill in the states of ``controls`` and :attr:`~.stage_point.StagePoint.speed_jacobian`."""
    dt, start, stages = problem.dt, problem.start, len(controls)
    x, y, yaw = start[0], start[1], start[2]
    for k in range(stages):
        states[k, 0], states[k, 1], states[k, 2] = x, y, yaw
        speed_jacobian[k, 0], speed_jacobian[k, 1] = dt * cos(yaw), dt * sin(yaw)
        x += controls[k, 0] * speed_jacobian[k, 0]
        y += controls[k, 0] * speed_jacobian[k, 1]
        yaw += controls[k, 1] * dt
    states[stages, 0], states[stages, 1], states[stages, 2] = x, y, yaw


@compiled
def clip(control: float, limit: float) -> float:
    """Return the control nearest to ``control`` with an absolute value of at most ``limit``."""
    return min(max(control, -limit), limit)


@compiled
def clip_controls(
    problem: UnicycleProblem, controls: Float[Array, "stages 2"]
) -> Float[Array, "stages 2"]:
    """Return the controls nearest to ``controls`` that are within the limits."""
    clipped = np.empty((len(controls), 2))
    for k in range(len(controls)):
        for i in range(2):
            clipped[k, i] = clip(controls[k, i], problem.limits[i])
    return clipped
