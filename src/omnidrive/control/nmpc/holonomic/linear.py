"""The optimum where nothing is in the way: a linear-quadratic problem, axis by axis."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem


@inlined
def policy(p: HolonomicProblem) -> tuple[Float[Array, "stages 3"], Float[Array, "stages 3"]]:
    """Gains K_k and offsets c_k of the optimal ``v_k = c_k - K_k x_k``, axis by axis.

    All weights are diagonal and every axis integrates its own velocity, so three scalar Riccati
    recursions do: the cost to go is ``P x^2 - 2 b x`` plus a constant (Rawlings, Mayne & Diehl,
    "Model Predictive Control", 2nd ed. 2017, section 1.3).
    """
    stages, dt = len(p.feedforward), p.dt
    gains, offsets = np.empty((stages, 3)), np.empty((stages, 3))
    for i in range(3):
        r = p.control_weights[i]
        curvature = p.state_weights[stages, i]
        pull = curvature * p.targets[stages, i]
        for k in range(stages - 1, -1, -1):
            aim, q = p.feedforward[k, i], p.state_weights[k, i]
            total = r + curvature * dt * dt
            gains[k, i], offsets[k, i] = curvature * dt / total, (r * aim + dt * pull) / total
            kept = r / total
            pull = q * p.targets[k, i] + kept * (pull - curvature * dt * aim)
            curvature = q + kept * curvature
    return gains, offsets


@inlined
def unlimited(p: HolonomicProblem) -> Float[Array, "stages 3"]:
    """Velocities that minimise J without regard to limits and keep-outs."""
    gains, velocities = policy(p)
    for i in range(3):
        state = p.start[i]
        for k in range(len(velocities)):
            velocities[k, i] -= gains[k, i] * state
            state += p.dt * velocities[k, i]
    return velocities
