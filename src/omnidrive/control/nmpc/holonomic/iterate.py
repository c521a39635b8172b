"""Velocities on the way to the optimum, and all that Newton's method asks of them."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.cost import tracking_cost
from omnidrive.control.nmpc.holonomic.distance import add_keep_outs, keep_out_cost
from omnidrive.control.nmpc.holonomic.motion import roll_out, twist_derivatives
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem


class Iterate(NamedTuple):
    """Velocities, multipliers, and what follows of them.

    A limit has two sides: values up to its bound, and down to minus it. Values are taken over
    their bounds, so that the multipliers have the unit of J.
    """

    velocities: Float[Array, "stages 3"]
    pulls: Float[Array, "stages rows"]
    """Multiplier of every limit's upper side minus that of its lower one."""
    bounds: Float[Array, "stages rows"]
    """Of every limit at every stage: :func:`~omnidrive.control.nmpc.holonomic.start.bounds_of`."""
    twists: Float[Array, "stages 3"]
    """b_k."""
    twist_slopes: Float[Array, "stages 2 4"]
    """Derivatives of their translations by (yaw, vx, vy, yaw rate) of the stage."""
    rooms: Float[Array, "stages rows 2"]
    """1 - value and 1 + value: what is left up to each limit."""
    slopes: Float[Array, "stages rows 7"]
    """Derivatives of the values by (yaw_k, v_k, v_{k-1})."""
    bends: Float[Array, "stages 4 4"]
    """Second derivatives by (yaw_k, v_k), added up with the multipliers: the lower half."""
    by_velocity: Float[Array, "stages 3"]
    """Derivatives of J by every velocity, the states held."""
    by_state: Float[Array, "points 3"]
    """Derivatives of J by every state."""
    by_place: Float[Array, "points 2 3"]
    """Second derivatives of the keep-outs' cost by (x, x), (x, y) and (y, y), in two parts:
    :func:`~omnidrive.control.nmpc.holonomic.distance.add_keep_outs`."""


@inlined
def iterate(velocities: Float[Array, "stages 3"], bounds: Float[Array, "stages rows"]) -> Iterate:
    """An iterate with multipliers of zero; the rest is for :func:`evaluate` to fill in."""
    stages, rows = bounds.shape
    return Iterate(
        velocities,
        np.zeros((stages, rows)),
        bounds,
        np.empty((stages, 3)),
        np.empty((stages, 2, 4)),
        np.empty((stages, rows, 2)),
        np.zeros((stages, rows, 7)),
        np.empty((stages, 4, 4)),
        np.empty((stages, 3)),
        np.empty((stages + 1, 3)),
        np.empty((stages + 1, 2, 3)),
    )


@inlined
def cost(
    p: HolonomicProblem, states: Float[Array, "points 3"], velocities: Float[Array, "stages 3"]
) -> float:
    """J of :class:`HolonomicProblem`."""
    return tracking_cost(
        states, p.targets, p.state_weights, velocities, p.feedforward, p.control_weights
    ) + keep_out_cost(p.keep_outs, states)


@compiled
def evaluate(p: HolonomicProblem, at: Iterate) -> None:
    """Fill in what follows of velocities and multipliers."""
    _fill_objective(p, at)
    if at.bounds.size:
        _fill_twists(p, at)
        _fill_limits(p, at)


@inlined
def _fill_objective(p: HolonomicProblem, at: Iterate) -> None:
    states = roll_out(p, at.velocities)
    for k in range(len(states)):
        for i in range(3):
            at.by_state[k, i] = 2.0 * p.state_weights[k, i] * (states[k, i] - p.targets[k, i])
            at.by_place[k, 0, i], at.by_place[k, 1, i] = 0.0, 0.0
    for k in range(len(at.velocities)):
        for i in range(3):
            deviation = at.velocities[k, i] - p.feedforward[k, i]
            at.by_velocity[k, i] = 2.0 * p.control_weights[i] * deviation
    add_keep_outs(p.keep_outs, states, at.by_state, at.by_place)


@inlined
def _fill_twists(p: HolonomicProblem, at: Iterate) -> None:
    """Twists, their slopes, and their bends times what all multipliers pull at them."""
    limits, yaw, stages = p.limits, p.start[2], len(at.velocities)
    for k in range(stages):
        pull_x, pull_y = 0.0, 0.0
        for i in range(at.bounds.shape[1]):
            pull = at.pulls[k, i] / at.bounds[k, i]
            pull_x += pull * limits.now[i, 0]
            pull_y += pull * limits.now[i, 1]
            if k + 1 < stages:
                pull = at.pulls[k + 1, i] / at.bounds[k + 1, i]
                pull_x -= pull * limits.before[i, 0]
                pull_y -= pull * limits.before[i, 1]
        rate = at.velocities[k, 2]
        stage = (yaw, at.velocities[k, 0], at.velocities[k, 1], rate)
        at.twists[k, 0], at.twists[k, 1] = twist_derivatives(
            p.dt, stage, (pull_x, pull_y), at.twist_slopes, at.bends, k
        )
        at.twists[k, 2] = rate
        yaw += p.dt * rate


@inlined
def _fill_limits(p: HolonomicProblem, at: Iterate) -> None:
    now, before = p.limits.now, p.limits.before
    twists, turns, slopes, rooms = at.twists, at.twist_slopes, at.slopes, at.rooms
    for k in range(len(twists)):
        for i in range(len(now)):
            scale = 1.0 / at.bounds[k, i]
            x, y, r = scale * now[i, 0], scale * now[i, 1], scale * now[i, 2]
            value = x * twists[k, 0] + y * twists[k, 1] + r * twists[k, 2]
            for a in range(4):
                slopes[k, i, a] = x * turns[k, 0, a] + y * turns[k, 1, a]
            slopes[k, i, 3] += r
            x, y, r = scale * before[i, 0], scale * before[i, 1], scale * before[i, 2]
            if x != 0.0 or y != 0.0 or r != 0.0:
                past = twists[k - 1] if k > 0 else p.previous
                value -= x * past[0] + y * past[1] + r * past[2]
                if k > 0:
                    turn = x * turns[k - 1, 0, 0] + y * turns[k - 1, 1, 0]
                    slopes[k, i, 0] -= turn
                    for a in range(1, 4):
                        slopes[k, i, 3 + a] = -(x * turns[k - 1, 0, a] + y * turns[k - 1, 1, a])
                    # with yaw_k instead of yaw_{k-1} = yaw_k - dt rate_{k-1}
                    slopes[k, i, 6] += p.dt * turn - r
            rooms[k, i, 0], rooms[k, i, 1] = 1.0 - value, 1.0 + value


@compiled
def reduced_gradient(dt: float, at: Iterate) -> Float[Array, "stages 3"]:
    """Derivative of the Lagrangian by every velocity, states following: the adjoint."""
    stages, rows, slopes = at.bounds.shape[0], at.bounds.shape[1], at.slopes
    gradient, costate, earlier = np.empty((stages, 3)), np.zeros(3), np.zeros(3)
    for i in range(3):
        costate[i] = at.by_state[stages, i]
    for k in range(stages - 1, -1, -1):
        for i in range(3):
            gradient[k, i] = at.by_velocity[k, i] + dt * costate[i] + earlier[i]
            costate[i] += at.by_state[k, i]
            earlier[i] = 0.0
        for w in range(rows):
            pull = at.pulls[k, w]
            if pull != 0.0:
                costate[2] += pull * slopes[k, w, 0]
                for i in range(3):
                    gradient[k, i] += pull * slopes[k, w, 1 + i]
                    earlier[i] += pull * slopes[k, w, 4 + i]
    return gradient


@inlined
def largest_slope(dt: float, at: Iterate) -> float:
    """Largest entry of :func:`reduced_gradient`; not a number if one of them is none."""
    gradient, largest = reduced_gradient(dt, at), 0.0
    for slope in gradient.flat:
        if abs(slope) > largest or isnan(slope):
            largest = abs(slope)
    return largest
