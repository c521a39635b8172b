"""The body twist of a stage as a function of its heading and velocity, with derivatives."""

from __future__ import annotations

from math import cos, isnan, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

_SMALL = 0.02
"""Half turn below which the arc's factor is taken from its series, to rounding."""
_LARGEST = 1.5
"""Half turn of one stage, in rad, beyond which the factor is continued by a parabola."""


@inlined
def roll_out(p: HolonomicProblem, velocities: Float[Array, "stages 3"]) -> Float[Array, "points 3"]:
    """States that ``velocities`` lead through."""
    states = np.empty((len(velocities) + 1, 3))
    for i in range(3):
        states[0, i] = p.start[i]
        for k in range(len(velocities)):
            states[k + 1, i] = states[k, i] + p.dt * velocities[k, i]
    return states


@inlined
def arc(half: float) -> tuple[float, float, float]:
    """Arc over chord, ``h / sin(h)`` for half the turn h in rad, with two derivatives."""
    square = half * half
    if square < _SMALL * _SMALL:
        value = 1.0 + square * (1.0 / 6.0 + square * (7.0 / 360.0 + square * 31.0 / 15120.0))
        slope = half * (1.0 / 3.0 + square * (7.0 / 90.0 + square * 31.0 / 2520.0))
        bend = 1.0 / 3.0 + square * (7.0 / 30.0 + square * 31.0 / 504.0)
        return value, slope, bend
    at = min(max(half, -_LARGEST), _LARGEST)
    s, c = sin(at), cos(at)
    value, slope = at / s, (s - at * c) / (s * s)
    bend = at / s - 2.0 * c * slope / s
    beyond = half - at  # only on the way to a solution: no wheel turns a robot so fast
    return value + beyond * (slope + 0.5 * beyond * bend), slope + beyond * bend, bend


@inlined
def twist(dt: float, yaw: float, vx: float, vy: float, rate: float) -> tuple[float, float]:
    """Translation of the body twist, in m/s, of a stage with this velocity in W.

    With h half the turn of the stage, and f the factor of :func:`arc`, it is
    ``f(h) R(-yaw - h) (vx, vy)``; its yaw rate is that of the stage.
    """
    half = 0.5 * dt * rate
    factor, _, _ = arc(half)
    c, s = cos(yaw + half), sin(yaw + half)
    return factor * (c * vx + s * vy), factor * (c * vy - s * vx)


@inlined
def velocity(dt: float, yaw: float, ahead: float, left: float, rate: float) -> tuple[float, float]:
    """Inverse of :func:`twist`: mean velocity in W, in m/s."""
    half = 0.5 * dt * rate
    factor, _, _ = arc(half)
    c, s = cos(yaw + half), sin(yaw + half)
    return (c * ahead - s * left) / factor, (s * ahead + c * left) / factor


@inlined
def twist_derivatives(  # noqa: PLR0917
    dt: float,
    stage: tuple[float, float, float, float],
    pull: tuple[float, float],
    slopes: Float[Array, "stages 2 4"],
    bends: Float[Array, "stages 4 4"],
    k: int,
) -> tuple[float, float]:
    """:func:`twist` of stage k; fills in its derivatives by (yaw, vx, vy, yaw rate).

    Args:
        dt: Length of the stage, in s.
        stage: yaw (rad), vx, vy (m/s) in W, yaw rate (rad/s).
        pull: What the second derivatives of the two components are multiplied with and added.
        slopes: To fill in: first derivatives of both.
        bends: To fill in: second derivatives, the lower half.
        k: Where to fill in.
    """
    yaw, vx, vy, rate = stage
    d = 0.5 * dt
    f, df, ddf = arc(d * rate)
    c, s = cos(yaw + d * rate), sin(yaw + d * rate)
    ahead, left = c * vx + s * vy, c * vy - s * vx
    slopes[k, 0, 0], slopes[k, 1, 0] = f * left, -f * ahead
    slopes[k, 0, 1], slopes[k, 1, 1] = f * c, -f * s
    slopes[k, 0, 2], slopes[k, 1, 2] = f * s, f * c
    slopes[k, 0, 3], slopes[k, 1, 3] = d * (df * ahead + f * left), d * (df * left - f * ahead)
    by_x, by_y = pull[0] * c - pull[1] * s, pull[0] * s + pull[1] * c
    push, turn = by_x * vx + by_y * vy, by_y * vx - by_x * vy
    # with psi = yaw + h: d(by_x)/dpsi = -by_y, d(by_y)/dpsi = by_x,
    # d(push)/dpsi = -turn, d(turn)/dpsi = push
    bends[k, 0, 0] = -f * push
    bends[k, 1, 0] = -f * by_y
    bends[k, 2, 0] = f * by_x
    bends[k, 3, 0] = -d * (df * turn + f * push)
    bends[k, 3, 1] = d * (df * by_x - f * by_y)
    bends[k, 3, 2] = d * (df * by_y + f * by_x)
    bends[k, 3, 3] = d * d * (ddf * push - 2.0 * df * turn - f * push)
    bends[k, 1, 1] = bends[k, 2, 1] = bends[k, 2, 2] = 0.0
    return f * ahead, f * left


@inlined
def twists_of(
    p: HolonomicProblem, velocities: Float[Array, "stages 3"]
) -> Float[Array, "stages 3"]:
    """Body twist of every stage."""
    twists, yaw = np.empty((len(velocities), 3)), p.start[2]
    for k in range(len(velocities)):
        vx, vy, rate = velocities[k, 0], velocities[k, 1], velocities[k, 2]
        twists[k, 0], twists[k, 1] = twist(p.dt, yaw, vx, vy, rate)
        twists[k, 2] = rate
        yaw += p.dt * rate
    return twists


@inlined
def limited(p: HolonomicProblem, i: int, twists: Float[Array, "stages 3"], k: int) -> float:
    """What limit i bounds at stage k: see :class:`~.problem.Limits`."""
    total = 0.0
    for a in range(3):
        past = twists[k - 1, a] if k > 0 else p.previous[a]
        total += p.limits.now[i, a] * twists[k, a] - p.limits.before[i, a] * past
    return total


@inlined
def largest_part(p: HolonomicProblem, twists: Float[Array, "stages 3"]) -> float:
    """Largest part of its bound that any limit needs, over all stages."""
    worst = 0.0
    for k in range(len(twists)):
        for i in range(len(p.limits.bounds)):
            part = abs(limited(p, i, twists, k)) / p.limits.bounds[i]
            if part > worst or isnan(part):  # which stays
                worst = part
    return worst
