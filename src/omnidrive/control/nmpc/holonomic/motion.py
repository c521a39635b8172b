"""Motion of a holonomic robot: body twists of the stages, their derivatives, and limit values."""

from __future__ import annotations

from math import cos, isnan, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.geometry.arc import arc_factor, arc_twist
from omnidrive.robot.slip import Vector


@compiled
def roll_out(p: HolonomicProblem, velocities: Float[Array, "stages 3"]) -> Float[Array, "points 3"]:
    """Return the states that follow from ``velocities``."""
    states = np.empty((len(velocities) + 1, 3))
    for i in range(3):
        states[0, i] = p.start[i]
        for k in range(len(velocities)):
            states[k + 1, i] = states[k, i] + p.dt * velocities[k, i]
    return states


@compiled
def twist_derivatives(  # noqa: PLR0917
    dt: float,
    stage: tuple[float, float, float, float],
    multipliers: tuple[float, float],
    jacobian: Float[Array, "stages 2 4"],
    hessian: Float[Array, "stages 7 7"],
    k: int,
) -> tuple[float, float]:
    """Return :func:`arc_twist` of stage k; fill in its derivatives by (yaw, vx, vy, yaw rate).

    Args:
        dt: Length of the stage, in s.
        stage: yaw (rad), vx, vy (m/s) in W, yaw rate (rad/s).
        multipliers: Factors of the two components in the sum of their second derivatives.
        jacobian: Output: first derivatives of both components.
        hessian: Output: weighted sum of the second derivatives, lower triangle.
        k: Stage; index into the outputs.
    """
    yaw, vx, vy, rate = stage
    d = 0.5 * dt
    f, df, ddf = arc_factor(d * rate)
    c, s = cos(yaw + d * rate), sin(yaw + d * rate)
    ahead, left = c * vx + s * vy, c * vy - s * vx
    jacobian[k, 0, 0], jacobian[k, 1, 0] = f * left, -f * ahead
    jacobian[k, 0, 1], jacobian[k, 1, 1] = f * c, -f * s
    jacobian[k, 0, 2], jacobian[k, 1, 2] = f * s, f * c
    jacobian[k, 0, 3], jacobian[k, 1, 3] = d * (df * ahead + f * left), d * (df * left - f * ahead)
    # multipliers in W, their products with (vx, vy), along and across
    mx = multipliers[0] * c - multipliers[1] * s
    my = multipliers[0] * s + multipliers[1] * c
    along, across = mx * vx + my * vy, my * vx - mx * vy
    # with psi = yaw + h: d(mx)/dpsi = -my, d(my)/dpsi = mx,
    # d(along)/dpsi = -across, d(across)/dpsi = along
    hessian[k, 0, 0] = -f * along
    hessian[k, 1, 0] = -f * my
    hessian[k, 2, 0] = f * mx
    hessian[k, 3, 0] = -d * (df * across + f * along)
    hessian[k, 3, 1] = d * (df * mx - f * my)
    hessian[k, 3, 2] = d * (df * my + f * mx)
    hessian[k, 3, 3] = d * d * (ddf * along - 2.0 * df * across - f * along)
    hessian[k, 1, 1] = hessian[k, 2, 1] = hessian[k, 2, 2] = 0.0
    return f * ahead, f * left


@compiled
def stage_twists(
    p: HolonomicProblem, velocities: Float[Array, "stages 3"]
) -> Float[Array, "stages 3"]:
    """Return the body twist of every stage."""
    twists, yaw = np.empty((len(velocities), 3)), p.start[2]
    for k in range(len(velocities)):
        vx, vy, rate = velocities[k, 0], velocities[k, 1], velocities[k, 2]
        twists[k, 0], twists[k, 1] = arc_twist(p.dt, yaw, vx, vy, rate)
        twists[k, 2] = rate
        yaw += p.dt * rate
    return twists


@compiled
def earlier_twist(p: HolonomicProblem, twists: Float[Array, "stages 3"], k: int) -> Vector:
    """Return the twist before stage k as :class:`~.problem.Limits` compare it with that of k."""
    before = twists[k - 1] if k > 0 else p.previous
    x, y, rate = before[0], before[1], before[2]
    if not p.limits.inertial:
        return x, y, rate
    turn = 0.5 * p.dt * (twists[k, 2] + (rate if k > 0 else 0.0))
    c, s = cos(turn), sin(turn)
    return c * x + s * y, c * y - s * x, rate


@compiled
def limit_value(
    p: HolonomicProblem, i: int, twists: Float[Array, "stages 3"], k: int, earlier: Vector
) -> float:
    """Return the value of a limit of :class:`~.problem.Limits`, with :func:`earlier_twist`."""
    total = 0.0
    for a in range(3):
        total += p.limits.now[i, a] * twists[k, a] - p.limits.before[i, a] * earlier[a]
    return total


@compiled
def max_limit_ratio(p: HolonomicProblem, twists: Float[Array, "stages 3"]) -> float:
    """Return the largest ratio of a limit's absolute value to its bound; NaN if any is NaN."""
    largest = 0.0
    for k in range(len(twists)):
        earlier = earlier_twist(p, twists, k)
        for i in range(len(p.limits.bounds)):
            ratio = abs(limit_value(p, i, twists, k, earlier)) / p.limits.bounds[i]
            if ratio > largest or isnan(ratio):  # a NaN is never replaced
                largest = ratio
    return largest
