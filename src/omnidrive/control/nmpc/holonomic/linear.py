"""The optimum where no wheel is at its limit: a linear-quadratic problem, axis by axis."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

Array = np.ndarray


@compiled
def unlimited(p: HolonomicProblem) -> Float[Array, "stages 3"]:
    """Velocities that minimise J without regard to the wheels.

    All weights are diagonal and every axis integrates its own velocity, so three scalar Riccati
    recursions do: the cost to go is ``P x^2 - 2 b x`` plus a constant (Rawlings, Mayne & Diehl,
    "Model Predictive Control", 2nd ed. 2017, section 1.3).
    """
    stages, dt = len(p.feedforward), p.dt
    velocities = np.empty((stages, 3))
    gains, offsets = np.empty(stages), np.empty(stages)
    for i in range(3):
        r = p.control_weights[i]
        curvature = p.state_weights[stages, i]
        pull = curvature * p.targets[stages, i]
        for k in range(stages - 1, -1, -1):
            aim, q = p.feedforward[k, i], p.state_weights[k, i]
            total = r + curvature * dt * dt
            gains[k], offsets[k] = curvature * dt / total, (r * aim + dt * pull) / total
            kept = r / total
            pull = q * p.targets[k, i] + kept * (pull - curvature * dt * aim)
            curvature = q + kept * curvature
        state = p.start[i]
        for k in range(stages):
            velocities[k, i] = offsets[k] - gains[k] * state
            state += dt * velocities[k, i]
    return velocities
