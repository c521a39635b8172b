"""Optimal control problem of one step of a holonomic robot."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float, Int

from omnidrive.arrays import Array


class Limits(NamedTuple):
    """Bounds on linear functions of the body twists b_k and b_{k-1} of consecutive stages.

    ::

        |now_i @ b_k - before_i @ b_{k-1}| <= bounds_i     for every row i and stage k

    ``before`` is zero for limits of speeds without lag, and equals ``now`` for limits of rates: see
    :mod:`~omnidrive.control.nmpc.holonomic.limits`. Braking, which multiplies the twist by a factor
    of at most 1 in every stage, must reach a twist that satisfies all limits. Bounds that it
    violates until then are relaxed:
    :func:`~omnidrive.control.nmpc.holonomic.feasible_start.relaxed_bounds`.
    """

    now: Float[Array, "rows 3"]
    """Coefficients of b_k = (vx, vy, yaw rate) in B; for wheel speeds in rad/m, rad/m, rad/rad."""
    before: Float[Array, "rows 3"]
    """Coefficients of b_{k-1}, in the same units."""
    bounds: Float[Array, " rows"]
    """Positive; in the unit of the row, such as rad/s or rad/s^2."""
    inertial: bool = False
    """Whether b_{k-1} is turned into B of b_k, at the middles of both stages, or at the start of
    the first one: limits of forces, which change the velocity in W. A twist that is constant in B
    needs them where the robot turns."""


class KeepOutArrays(NamedTuple):
    """Keep-out zones as arrays: convex polygons with rounded corners, fixed or moving.

    Zone j adds ``weights_j max(0, radii_j - d)^2`` to the cost of every state, where d is the
    signed distance from the robot's position to the polygon, negative inside. With a single corner,
    the zone is a disc.
    """

    corners: Float[Array, "corners 2"]
    """Corners of all polygons in sequence, counter-clockwise, in m along the axes of W relative to
    the centre."""
    first: Int[Array, " starts"]
    """Index of the first corner of every polygon, followed by the number of all corners."""
    radii: Float[Array, " zones"]
    """Distance to keep, in m: the sum of the robot's radius, a disc's own radius, and a margin."""
    weights: Float[Array, " zones"]
    """Weights of the squared violations, in 1/m^2."""
    centres: Float[Array, "zones points 2"]
    """Centre of every polygon at every state, in m in W."""


class HolonomicProblem(NamedTuple):
    """Tracking of a reference over N stages of ``dt`` seconds within the limits of the robot.

    Minimise J over the mean velocities v_k = (vx, vy, yaw rate) of every stage, in W::

        J(v) = sum_{k=0}^{N} |x_k - xref_k|^2_{Q_k} + sum_{k=0}^{N-1} |v_k - vref_k|^2_R
               + keep_out_cost(x_0, ..., x_N)

        x_0 = start,   x_{k+1} = x_k + dt v_k
        |now_i @ b_k - before_i @ b_{k-1}| <= bounds_i,   b_k = twist(yaw_k, v_k)

    with states x_k = (x, y, yaw) in W. Here ``twist(yaw, v)`` is the constant body twist that
    moves the robot within ``dt``, from the heading ``yaw``, by ``dt v`` along an arc. Therefore
    the motion is linear in v and exact, and all nonlinearity is in the limits. If no limit is
    active and every keep-out distance is kept, the optimum is that of a linear-quadratic problem.

    The compiled kernels read this tuple directly: its arrays are contiguous and of floats.
    """

    dt: float
    """Length of a stage, in s."""
    start: Float[Array, " 3"]
    """x_0: the pose at the start of the first stage; m, m, rad."""
    previous: Float[Array, " 3"]
    """b_{-1}: the body twist before the first stage; m/s, m/s, rad/s. Unused if ``before`` is 0."""
    targets: Float[Array, "points 3"]
    """xref_k; m, m, rad. The yaw is unwrapped and starts within half a turn of ``start``."""
    feedforward: Float[Array, "stages 3"]
    """vref_k in W; m/s, m/s, rad/s."""
    state_weights: Float[Array, "points 3"]
    """Diagonal of Q_k; 1/m^2, 1/m^2, 1/rad^2. The last row is the terminal weight."""
    control_weights: Float[Array, " 3"]
    """Diagonal of R, positive; s^2/m^2, s^2/m^2, s^2/rad^2."""
    limits: Limits
    """Limits of the twists b_k."""
    keep_outs: KeepOutArrays
    """Zones of ``keep_out_cost``."""
