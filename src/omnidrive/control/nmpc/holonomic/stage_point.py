"""Iterate of the solver: velocities of all stages, multipliers, and the derivatives."""

from __future__ import annotations

from math import cos, isnan, sin
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.cost import tracking_cost
from omnidrive.control.nmpc.holonomic.keep_out_cost import add_keep_out_derivatives, keep_out_cost
from omnidrive.control.nmpc.holonomic.motion import earlier_twist, roll_out, twist_derivatives
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.geometry.arc import arc_factor


class StagePoint(NamedTuple):
    """Velocities and multipliers of all stages and what follows from them.

    A limit has an upper side, value <= bound, and a lower side, value >= -bound. Values are
    divided by their bounds, so that the multipliers have the unit of J.
    """

    velocities: Float[Array, "stages 3"]
    """v_k in W; m/s, m/s, rad/s."""
    multipliers: Float[Array, "stages rows"]
    """Lagrange multipliers of the limits: that of the upper side minus that of the lower side."""
    bounds: Float[Array, "stages rows"]
    """Bounds of the limits: :func:`~.feasible_start.relaxed_bounds`."""
    twists: Float[Array, "stages 3"]
    """b_k; m/s, m/s, rad/s."""
    twist_jacobian: Float[Array, "stages 2 4"]
    """Derivatives of the twists' translations by (yaw_k, v_k)."""
    slacks: Float[Array, "stages rows 2"]
    """Slacks of both sides: 1 - value and 1 + value."""
    jacobian: Float[Array, "stages rows 7"]
    """Derivatives of the limits' values by (yaw_k, v_k, v_{k-1})."""
    hessian: Float[Array, "stages 7 7"]
    """Second derivatives of ``multipliers @ values`` by (yaw_k, v_k, v_{k-1}): lower triangle."""
    gradient_velocity: Float[Array, "stages 3"]
    """Derivatives of J by every velocity, with the states constant."""
    gradient_state: Float[Array, "points 3"]
    """Derivatives of J by every state."""
    hessian_position: Float[Array, "points 2 3"]
    """Second derivatives of the keep-out cost by (x, x), (x, y) and (y, y), in two parts:
    :func:`~.keep_out_cost.add_keep_out_derivatives`."""


@compiled
def allocate_point(
    velocities: Float[Array, "stages 3"], bounds: Float[Array, "stages rows"]
) -> StagePoint:
    """Return a point with multipliers of zero; :func:`evaluate` fills in the other fields."""
    stages, rows = bounds.shape
    return StagePoint(
        velocities,
        np.zeros((stages, rows)),
        bounds,
        np.empty((stages, 3)),
        np.empty((stages, 2, 4)),
        np.empty((stages, rows, 2)),
        np.zeros((stages, rows, 7)),
        np.zeros((stages, 7, 7)),
        np.empty((stages, 3)),
        np.empty((stages + 1, 3)),
        np.empty((stages + 1, 2, 3)),
    )


@compiled
def cost(
    p: HolonomicProblem, states: Float[Array, "points 3"], velocities: Float[Array, "stages 3"]
) -> float:
    """Return J of :class:`HolonomicProblem`."""
    return tracking_cost(
        states, p.targets, p.state_weights, velocities, p.feedforward, p.control_weights
    ) + keep_out_cost(p.keep_outs, states)


@compiled
def lower_bound(p: HolonomicProblem, unconstrained: Float[Array, "stages 3"]) -> float:
    """Return J of the optimum without limits and keep-out zones: no plan costs less."""
    states = roll_out(p, unconstrained)
    return cost(p, states, unconstrained) - keep_out_cost(p.keep_outs, states)


@compiled
def evaluate(p: HolonomicProblem, point: StagePoint) -> None:
    """Fill in all fields that follow from velocities and multipliers."""
    _fill_objective(p, point)
    if point.bounds.size:
        _fill_twists(p, point)
        _fill_limits(p, point)


@compiled
def _fill_objective(p: HolonomicProblem, point: StagePoint) -> None:
    """Fill in the derivatives of J."""
    gradient, hessian, states = (
        point.gradient_state,
        point.hessian_position,
        roll_out(p, point.velocities),
    )
    for k in range(len(states)):
        for i in range(3):
            gradient[k, i] = 2.0 * p.state_weights[k, i] * (states[k, i] - p.targets[k, i])
            hessian[k, 0, i], hessian[k, 1, i] = 0.0, 0.0
    for k in range(len(point.velocities)):
        for i in range(3):
            deviation = point.velocities[k, i] - p.feedforward[k, i]
            point.gradient_velocity[k, i] = 2.0 * p.control_weights[i] * deviation
    add_keep_out_derivatives(p.keep_outs, states, gradient, hessian)


@compiled
def _fill_twists(p: HolonomicProblem, point: StagePoint) -> None:
    """Fill in twists, their Jacobian, and the Hessian weighted by the multipliers."""
    limits, yaw, stages = p.limits, p.start[2], len(point.velocities)
    for k in range(stages):
        mx, my = 0.0, 0.0
        for i in range(point.bounds.shape[1]):
            multiplier = point.multipliers[k, i] / point.bounds[k, i]
            mx += multiplier * limits.now[i, 0]
            my += multiplier * limits.now[i, 1]
            if k + 1 < stages and not limits.inertial:
                multiplier = point.multipliers[k + 1, i] / point.bounds[k + 1, i]
                mx -= multiplier * limits.before[i, 0]
                my -= multiplier * limits.before[i, 1]
        rate = point.velocities[k, 2]
        stage = (yaw, point.velocities[k, 0], point.velocities[k, 1], rate)
        point.twists[k, 0], point.twists[k, 1] = twist_derivatives(
            p.dt, stage, (mx, my), point.twist_jacobian, point.hessian, k
        )
        point.twists[k, 2] = rate
        if limits.inertial:
            _add_inertial_hessian(p, point, k, yaw)
        yaw += p.dt * rate


@compiled
def _add_inertial_hessian(p: HolonomicProblem, point: StagePoint, k: int, yaw: float) -> None:
    """Add the part of the turned twist before stage k to its Hessian; ``yaw`` is that of k."""
    mx, my = 0.0, 0.0
    for i in range(point.bounds.shape[1]):
        multiplier = point.multipliers[k, i] / point.bounds[k, i]
        mx -= multiplier * p.limits.before[i, 0]
        my -= multiplier * p.limits.before[i, 1]
    h, d = point.hessian, 0.5 * p.dt
    x, y, _ = earlier_twist(p, point.twists, k)
    along, across = mx * x + my * y, mx * y - my * x
    h[k, 3, 3] -= d * d * along
    if k == 0:
        return
    h[k, 0, 0] -= along
    h[k, 3, 0] -= d * along
    psi = yaw + d * point.velocities[k, 2]
    c, s = cos(psi), sin(psi)
    f, df, ddf = arc_factor(d * point.velocities[k - 1, 2])
    h[k, 4, 0], h[k, 5, 0] = -f * (mx * s + my * c), f * (mx * c - my * s)
    h[k, 6, 0] = d * df / f * across
    for a in range(4, 7):
        h[k, a, 3] = d * h[k, a, 0]
    h[k, 6, 4], h[k, 6, 5] = d * df * (mx * c - my * s), d * df * (mx * s + my * c)
    h[k, 6, 6] = d * d * ddf / f * along


@compiled
def _fill_limits(p: HolonomicProblem, point: StagePoint) -> None:
    """Fill in slacks and Jacobian of the limits."""
    now, before, twists, slacks = p.limits.now, p.limits.before, point.twists, point.slacks
    jacobian, turns, yaw = point.jacobian, point.twist_jacobian, p.start[2]
    for k in range(len(twists)):
        past = earlier_twist(p, twists, k)
        psi, d = yaw + 0.5 * p.dt * twists[k, 2], 0.5 * p.dt
        c, s = cos(psi), sin(psi)
        f, df, _ = arc_factor(d * twists[k - 1, 2] if k > 0 else 0.0)
        yaw += p.dt * twists[k, 2]
        for i in range(len(now)):
            scale = 1.0 / point.bounds[k, i]
            x, y, r = scale * now[i, 0], scale * now[i, 1], scale * now[i, 2]
            value = x * twists[k, 0] + y * twists[k, 1] + r * twists[k, 2]
            for a in range(4):
                jacobian[k, i, a] = x * turns[k, 0, a] + y * turns[k, 1, a]
            jacobian[k, i, 3] += r
            x, y, r = scale * before[i, 0], scale * before[i, 1], scale * before[i, 2]
            if p.limits.inertial:
                value -= x * past[0] + y * past[1] + r * past[2]
                jacobian[k, i, 3] -= d * (x * past[1] - y * past[0])
                if k > 0:
                    jacobian[k, i, 0] -= x * past[1] - y * past[0]
                    jacobian[k, i, 4] = -f * (x * c - y * s)
                    jacobian[k, i, 5] = -f * (x * s + y * c)
                    jacobian[k, i, 6] = -d * df / f * (x * past[0] + y * past[1]) - r
            elif x != 0.0 or y != 0.0 or r != 0.0:
                value -= x * past[0] + y * past[1] + r * past[2]
                if k > 0:
                    by_yaw = x * turns[k - 1, 0, 0] + y * turns[k - 1, 1, 0]
                    jacobian[k, i, 0] -= by_yaw
                    for a in range(1, 4):
                        jacobian[k, i, 3 + a] = -(x * turns[k - 1, 0, a] + y * turns[k - 1, 1, a])
                    # yaw_{k-1} is replaced by yaw_k - dt rate_{k-1}
                    jacobian[k, i, 6] += p.dt * by_yaw - r
            slacks[k, i, 0], slacks[k, i, 1] = 1.0 - value, 1.0 + value


@compiled
def reduced_gradient(dt: float, point: StagePoint) -> Float[Array, "stages 3"]:
    """Return the total derivative of the Lagrangian by every velocity, by the adjoint method."""
    stages, rows, jacobian = point.bounds.shape[0], point.bounds.shape[1], point.jacobian
    gradient, costate, earlier = np.empty((stages, 3)), np.zeros(3), np.zeros(3)
    for i in range(3):
        costate[i] = point.gradient_state[stages, i]
    for k in range(stages - 1, -1, -1):
        for i in range(3):
            gradient[k, i] = point.gradient_velocity[k, i] + dt * costate[i] + earlier[i]
            costate[i] += point.gradient_state[k, i]
            earlier[i] = 0.0
        for w in range(rows):
            multiplier = point.multipliers[k, w]
            if multiplier != 0.0:
                costate[2] += multiplier * jacobian[k, w, 0]
                for i in range(3):
                    gradient[k, i] += multiplier * jacobian[k, w, 1 + i]
                    earlier[i] += multiplier * jacobian[k, w, 4 + i]
    return gradient


@compiled
def gradient_norm(dt: float, point: StagePoint) -> float:
    """Return the maximum norm of :func:`reduced_gradient`; NaN if any entry is NaN."""
    gradient, largest = reduced_gradient(dt, point), 0.0
    for entry in gradient.flat:
        if abs(entry) > largest or isnan(entry):
            largest = abs(entry)
    return largest


@compiled
def add_scaled(total: Array, factor: float, term: Array) -> None:
    """Add ``factor * term`` to ``total`` in place; contiguous arrays of the same shape.

    A loop compiles in a tenth of the time of ``total[:] += factor * term``, whose check of the
    shapes formats a message.
    """
    into, values = total.ravel(), term.ravel()
    for i in range(len(into)):
        into[i] += factor * values[i]


@compiled
def overwrite(target: Array, values: Array) -> None:
    """Copy ``values`` to ``target``: contiguous arrays of equal shape. See :func:`add_scaled`."""
    into, source = target.ravel(), values.ravel()
    for i in range(len(into)):
        into[i] = source[i]
