"""The wheels' limits along a plan, and the gradient of what is minimised under them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.motion import roll_out, wheel_speed, wheel_speed_slopes
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

Array = np.ndarray

_INSIDE = 0.9
"""Part of its limit that the fastest wheel of a stage needs to begin with."""


class Iterate(NamedTuple):
    """Velocities within all limits, and the limits there.

    A limit has two sides: speeds up to it, and down to minus it. Speeds are taken over their
    limits, so that the multipliers have the unit of J.
    """

    velocities: Float[Array, "stages 3"]
    multipliers: Float[Array, "stages wheels 2"]
    rooms: Float[Array, "stages wheels 2"]
    """1 - speed and 1 + speed: what is left up to each limit, positive."""
    slopes: Float[Array, "stages wheels 4"]
    """Derivatives of the speeds by (yaw, vx, vy, yaw rate)."""
    bends: Float[Array, "stages 4 4"]
    """Second derivatives, added up with the multipliers."""


@compiled
def within_limits(p: HolonomicProblem, velocities: Float[Array, "stages 3"]) -> float:
    """Largest part of its limit that any wheel needs, over all stages."""
    yaw, worst = p.start[2], 0.0
    for k in range(len(velocities)):
        worst = max(worst, _peak(p, yaw, velocities[k]))
        yaw += p.dt * velocities[k, 2]
    return worst


@compiled
def _peak(p: HolonomicProblem, yaw: float, velocity: Float[Array, " 3"]) -> float:
    """Largest part of its limit that any wheel needs in one stage."""
    worst = 0.0
    for i in range(len(p.limits)):
        speed = wheel_speed(p, i, yaw, velocity[0], velocity[1], velocity[2])
        worst = max(worst, abs(speed) / p.limits[i])
    return worst


@compiled
def slowed(p: HolonomicProblem, velocities: Float[Array, "stages 3"]) -> Float[Array, "stages 3"]:
    """Velocities, scaled down stage by stage until every wheel has room."""
    slower, yaw = velocities.copy(), p.start[2]
    for k in range(len(slower)):
        peak = _peak(p, yaw, slower[k])
        while peak > 1.01 * _INSIDE:
            for i in range(3):
                slower[k, i] *= _INSIDE / peak
            peak = _peak(p, yaw, slower[k])
        yaw += p.dt * slower[k, 2]
    return slower


@compiled
def evaluate(p: HolonomicProblem, at: Iterate) -> None:
    """Fill in rooms and derivatives."""
    slopes, bends, yaw = np.empty(4), np.empty((4, 4)), p.start[2]
    at.bends[:] = 0.0
    for k in range(len(at.velocities)):
        stage = (yaw, at.velocities[k, 0], at.velocities[k, 1], at.velocities[k, 2])
        for i in range(len(p.limits)):
            scale = 1.0 / p.limits[i]
            speed = scale * wheel_speed_slopes(p, i, stage, slopes, bends)
            at.rooms[k, i, 0], at.rooms[k, i, 1] = 1.0 - speed, 1.0 + speed
            pull = scale * (at.multipliers[k, i, 0] - at.multipliers[k, i, 1])
            for a in range(4):
                at.slopes[k, i, a] = scale * slopes[a]
                for b in range(a + 1):
                    at.bends[k, a, b] += pull * bends[a, b]
        yaw += p.dt * at.velocities[k, 2]


@compiled
def reduced_gradient(
    p: HolonomicProblem,
    velocities: Float[Array, "stages 3"],
    slopes: Float[Array, "stages wheels 4"],
    pulls: Float[Array, "stages wheels"],
) -> Float[Array, "stages 3"]:
    """Derivative of J + sum(pulls x speeds) by every velocity, states following: the adjoint."""
    stages, wheels = len(velocities), len(p.limits)
    states, gradient, costate = roll_out(p, velocities), np.empty((stages, 3)), np.empty(3)
    for i in range(3):
        error = states[stages, i] - p.targets[stages, i]
        costate[i] = 2.0 * p.state_weights[stages, i] * error
    for k in range(stages - 1, -1, -1):
        for i in range(3):
            deviation = velocities[k, i] - p.feedforward[k, i]
            gradient[k, i] = 2.0 * p.control_weights[i] * deviation + p.dt * costate[i]
            costate[i] += 2.0 * p.state_weights[k, i] * (states[k, i] - p.targets[k, i])
        for w in range(wheels):
            for i in range(3):
                gradient[k, i] += pulls[k, w] * slopes[k, w, 1 + i]
            costate[2] += pulls[k, w] * slopes[k, w, 0]
    return gradient
