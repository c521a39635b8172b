"""Optimal control problem of one step of the unicycle."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array


class Control(NamedTuple):
    """A control of the unicycle, or a number for each component of one."""

    speed: float
    """Along the heading, m/s."""
    yaw_rate: float
    """In rad/s."""


class UnicycleProblem(NamedTuple):
    """Tracking of a reference with a unicycle over N stages of ``dt`` seconds.

    Minimise, over the controls u_k = (speed, yaw rate), k = 0..N-1::

        J(u) = sum_{k=0}^{N} |x_k - xref_k|^2_{Q_k} + sum_{k=0}^{N-1} |u_k - uref_k|^2_R

        x_0 = start,   x_{k+1} = x_k + dt (v_k cos yaw_k, v_k sin yaw_k, yaw_rate_k)
        |u_k| <= limits

    with states x_k = (x, y, yaw) in W: the paper's section "Non-linear MPC"; the standard form
    is Rawlings, Mayne & Diehl, "Model Predictive Control", 2nd ed. 2017, section 1.3 and ch. 8.
    All weights are diagonal. The compiled kernels read this tuple directly: its arrays are
    contiguous and of floats, because every other type needs another compilation.
    """

    dt: float
    """Length of a stage, in s."""
    start: Float[Array, " 3"]
    """x_0: the measured pose; m, m, rad."""
    targets: Float[Array, "points 3"]
    """xref_k; m, m, rad. The yaw is unwrapped and starts within half a turn of ``start``."""
    feedforward: Float[Array, "stages 2"]
    """uref_k; m/s, rad/s."""
    state_weights: Float[Array, "points 3"]
    """Diagonal of Q_k; 1/m^2, 1/m^2, 1/rad^2. The last row is the terminal weight."""
    control_weights: Control
    """Diagonal of R, positive; s^2/m^2, s^2/rad^2."""
    limits: Control
    """Largest |speed| in m/s and |yaw rate| in rad/s."""
