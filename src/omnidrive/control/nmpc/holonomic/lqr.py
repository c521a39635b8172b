"""Optimum without limits and keep-out zones: a linear-quadratic regulator for each axis."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem


@compiled
def lqr_policy(p: HolonomicProblem) -> tuple[Float[Array, "stages 3"], Float[Array, "stages 3"]]:
    """Return gains K_k and offsets c_k of the optimal ``v_k = c_k - K_k x_k`` of every axis.

    The axes are x, y and yaw in W. The gains are in 1/s, the offsets in m/s, m/s and rad/s.

    All weights are diagonal and every axis integrates its own velocity. Therefore the Riccati
    recursion splits into three scalar ones: the cost to go is ``P x^2 - 2 b x`` plus a constant,
    with P in ``quadratic`` and b in ``linear``
    (Rawlings, Mayne & Diehl, "Model Predictive Control", 2nd ed. 2017, section 1.3).
    """
    stages, dt = len(p.feedforward), p.dt
    gains, offsets = np.empty((stages, 3)), np.empty((stages, 3))
    for i in range(3):
        r = p.control_weights[i]
        quadratic = p.state_weights[stages, i]
        linear = quadratic * p.targets[stages, i]
        for k in range(stages - 1, -1, -1):
            feedforward, q = p.feedforward[k, i], p.state_weights[k, i]
            total = r + quadratic * dt * dt
            gains[k, i] = quadratic * dt / total
            offsets[k, i] = (r * feedforward + dt * linear) / total
            closed_loop = r / total
            linear = q * p.targets[k, i] + closed_loop * (linear - quadratic * dt * feedforward)
            quadratic = q + closed_loop * quadratic
    return gains, offsets


@compiled
def unconstrained_velocities(p: HolonomicProblem) -> Float[Array, "stages 3"]:
    """Return the velocities v_k in W that minimise J without limits and keep-out zones.

    In m/s, m/s and rad/s; see :class:`HolonomicProblem` for J.
    """
    gains, velocities = lqr_policy(p)  # the offsets become the velocities in place
    for i in range(3):
        state = p.start[i]
        for k in range(len(velocities)):
            velocities[k, i] -= gains[k, i] * state
            state += p.dt * velocities[k, i]
    return velocities
