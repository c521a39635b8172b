"""Wheel speeds of a stage as a function of its heading and velocity, with derivatives."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.cost import tracking_cost
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

Array = np.ndarray

_SMALL = 0.02
"""Half turn below which the arc's factor is taken from its series, to rounding."""
_LARGEST = 1.5
"""Half turn of one stage, in rad, beyond which the factor is continued by a parabola."""


@compiled
def roll_out(p: HolonomicProblem, velocities: Float[Array, "stages 3"]) -> Float[Array, "points 3"]:
    """States that ``velocities`` lead through."""
    states = np.empty((len(velocities) + 1, 3))
    for i in range(3):
        states[0, i] = p.start[i]
        for k in range(len(velocities)):
            states[k + 1, i] = states[k, i] + p.dt * velocities[k, i]
    return states


@compiled
def cost(
    p: HolonomicProblem,
    states: Float[Array, "points 3"],
    velocities: Float[Array, "stages 3"],
) -> float:
    """J of :class:`HolonomicProblem`."""
    return tracking_cost(
        states, p.targets, p.state_weights, velocities, p.feedforward, p.control_weights
    )


@compiled
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


@compiled
def wheel_speed(  # noqa: PLR0917
    p: HolonomicProblem, wheel: int, yaw: float, vx: float, vy: float, rate: float
) -> float:
    """Speed of one wheel, in rad/s, while a stage is driven."""
    half = 0.5 * p.dt * rate
    factor, _, _ = arc(half)
    c, s = cos(yaw + half), sin(yaw + half)
    ahead, left = c * vx + s * vy, c * vy - s * vx
    jx, jy = p.wheels[wheel, 0], p.wheels[wheel, 1]
    speed: float = factor * (jx * ahead + jy * left) + p.wheels[wheel, 2] * rate
    return speed


@compiled
def wheel_speed_slopes(
    p: HolonomicProblem,
    wheel: int,
    stage: tuple[float, float, float, float],
    slopes: Float[Array, " 4"],
    bends: Float[Array, "4 4"],
) -> float:
    """Speed of one wheel; fills in its derivatives by (yaw, vx, vy, yaw rate), first and second.

    With h half the turn of the stage, psi = yaw + h, and f the factor of :func:`arc`, the twist's
    translation is ``f(h) R(-psi) (vx, vy)``.

    Args:
        p: The problem.
        wheel: Which one.
        stage: yaw (rad), vx, vy (m/s) in W, yaw rate (rad/s).
        slopes: To fill in.
        bends: To fill in, symmetric.
    """
    yaw, vx, vy, rate = stage
    half = 0.5 * p.dt * rate
    f, df, ddf = arc(half)
    c, s = cos(yaw + half), sin(yaw + half)
    jx, jy, jr = p.wheels[wheel, 0], p.wheels[wheel, 1], p.wheels[wheel, 2]
    by_x, by_y = jx * c - jy * s, jx * s + jy * c  # of the unstretched translation, by vx and vy
    push, turn = by_x * vx + by_y * vy, by_y * vx - by_x * vy  # it, and its derivative by -psi
    d = 0.5 * p.dt
    slopes[0] = -f * turn
    slopes[1], slopes[2] = f * by_x, f * by_y
    slopes[3] = jr + d * (df * push - f * turn)
    # d(by_x)/dpsi = -by_y, d(by_y)/dpsi = by_x, d(push)/dpsi = -turn, d(turn)/dpsi = push
    bends[0, 0] = -f * push
    bends[0, 1] = bends[1, 0] = -f * by_y
    bends[0, 2] = bends[2, 0] = f * by_x
    bends[0, 3] = bends[3, 0] = -d * (df * turn + f * push)
    bends[1, 1] = bends[1, 2] = bends[2, 1] = bends[2, 2] = 0.0
    bends[1, 3] = bends[3, 1] = d * (df * by_x - f * by_y)
    bends[2, 3] = bends[3, 2] = d * (df * by_y + f * by_x)
    bends[3, 3] = d * d * (ddf * push - 2.0 * df * turn - f * push)
    speed: float = f * push + jr * rate
    return speed
