"""The optimal control problem of one step of a holonomic robot."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float, Int

from omnidrive.arrays import Array


class Limits(NamedTuple):
    """Bounds of what is linear in the body twist b_k of a stage and that of the stage before.

    ::

        |now_i @ b_k - before_i @ b_{k-1}| <= bounds_i     for every row i and stage k

    For speeds ``before`` is zero, for rates both are alike: see
    :mod:`~omnidrive.control.nmpc.holonomic.limits`. Going on with the same twist must keep every
    limit sooner or later: nothing is asked that only a change would fulfil.
    """

    now: Float[Array, "rows 3"]
    """Of what is limited, per unit of body twist; for wheels in rad/m, rad/m and rad/rad."""
    before: Float[Array, "rows 3"]
    bounds: Float[Array, " rows"]
    """Positive; in the unit of the row, such as rad/s or rad/s^2."""


class KeepOuts(NamedTuple):
    """Places to stay out of: convex polygons with rounded corners, still or moving.

    Keep-out j costs ``weights_j max(0, radii_j - d)^2`` at every stage, where d is the distance
    from the robot's position to the polygon, negative inside. A polygon of one corner is a disc.
    """

    corners: Float[Array, "corners 2"]
    """Corners of all polygons one after another, counter-clockwise, in m from their centre."""
    first: Int[Array, " starts"]
    """Number of the first corner of every polygon, and then the number of all corners."""
    radii: Float[Array, " places"]
    """Distance to keep, in m: the robot's own radius and a margin."""
    weights: Float[Array, " places"]
    """In 1/m^2."""
    centres: Float[Array, "places points 2"]
    """Where every polygon is at every stage, in m in W."""


class HolonomicProblem(NamedTuple):
    """Track a reference over N stages of ``dt`` seconds within what the robot can do.

    Minimise, over the mean velocities in W of every stage, v_k = (vx, vy, yaw rate)::

        J(v) = sum_{k=0}^{N} |x_k - xref_k|^2_{Q_k} + sum_{k=0}^{N-1} |v_k - vref_k|^2_R
               + sum_{k=0}^{N} keep-outs(x_k)

        x_0 = start,   x_{k+1} = x_k + dt v_k
        |now_i @ b_k - before_i @ b_{k-1}| <= bounds_i,   b_k = twist(yaw_k, v_k)

    with states x_k = (x, y, yaw) in W. Here ``twist(yaw, v)`` is the one body twist that, held for
    ``dt`` from the heading ``yaw``, moves the robot by ``dt v`` along an arc: so the motion is
    linear in v and yet exact, and all that is not linear stands in the limits. Where these do not
    bind and no keep-out is near, the optimum is that of a linear-quadratic problem.

    The compiled kernels read this tuple directly: contiguous arrays of floats.
    """

    dt: float
    """Length of a stage, in s."""
    start: Float[Array, " 3"]
    """x_0: the measured pose; m, m, rad."""
    previous: Float[Array, " 3"]
    """b_{-1}: the body twist until now; m/s, m/s, rad/s. Without ``before`` it does not matter."""
    targets: Float[Array, "points 3"]
    """xref_k; m, m, rad. The yaw is on the branch nearest to that of ``start``."""
    feedforward: Float[Array, "stages 3"]
    """vref_k in W; m/s, m/s, rad/s."""
    state_weights: Float[Array, "points 3"]
    """Diagonal of Q_k; 1/m^2, 1/m^2, 1/rad^2. The last row weighs the terminal state."""
    control_weights: Float[Array, " 3"]
    """Diagonal of R, positive; s^2/m^2, s^2/m^2, s^2/rad^2."""
    limits: Limits
    keep_outs: KeepOuts
