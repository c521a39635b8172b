"""The optimal control problem of one step of a holonomic robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

Array = np.ndarray


class HolonomicProblem(NamedTuple):
    """Track a reference over N stages of ``dt`` seconds within what the wheels can do.

    Minimise, over the mean velocities in W of every stage, v_k = (vx, vy, yaw rate)::

        J(v) = sum_{k=0}^{N} |x_k - xref_k|^2_{Q_k} + sum_{k=0}^{N-1} |v_k - vref_k|^2_R

        x_0 = start,   x_{k+1} = x_k + dt v_k
        |wheels @ twist(yaw_k, v_k)| <= limits

    with states x_k = (x, y, yaw) in W. Here ``twist(yaw, v)`` is the one body twist that, held for
    ``dt`` from the heading ``yaw``, moves the robot by ``dt v`` along an arc: so the motion is
    linear in v and yet exact, and all that is not linear stands in the wheels' limits. Where these
    do not bind, the optimum is that of a linear-quadratic problem.

    The compiled kernels read this tuple directly: contiguous arrays of floats.
    """

    dt: float
    """Length of a stage, in s."""
    start: Float[Array, " 3"]
    """x_0: the measured pose; m, m, rad."""
    targets: Float[Array, "points 3"]
    """xref_k; m, m, rad. The yaw is on the branch nearest to that of ``start``."""
    feedforward: Float[Array, "stages 3"]
    """vref_k in W; m/s, m/s, rad/s."""
    state_weights: Float[Array, "points 3"]
    """Diagonal of Q_k; 1/m^2, 1/m^2, 1/rad^2. The last row weighs the terminal state."""
    control_weights: Float[Array, " 3"]
    """Diagonal of R, positive; s^2/m^2, s^2/m^2, s^2/rad^2."""
    wheels: Float[Array, "wheels 3"]
    """Wheel speed per unit of body twist, in rad/m, rad/m and rad/rad."""
    limits: Float[Array, " wheels"]
    """Largest speed of each wheel, in rad/s."""
