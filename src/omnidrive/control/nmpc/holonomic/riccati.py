"""Newton's step of the interior-point method, by one backward and one forward sweep."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.limits import Iterate
from omnidrive.control.nmpc.holonomic.motion import roll_out
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem

Array = np.ndarray

_LEAST_CURVATURE = 1e-10
"""A pivot up to this counts as not positive."""


class Factors(NamedTuple):
    """What the backward sweep over the Hessian leaves."""

    gains: Float[Array, "stages 3 3"]
    """From the deviation of a state to the step of the velocity, negated."""
    lower: Float[Array, "stages 3 3"]
    """Cholesky factor of every stage's Hessian by its velocity, the inverse of its diagonal on its
    diagonal."""


class Step(NamedTuple):
    """Changes of an :class:`Iterate`; of the rooms, to first order."""

    velocities: Float[Array, "stages 3"]
    rooms: Float[Array, "stages wheels 2"]
    multipliers: Float[Array, "stages wheels 2"]


@compiled
def factorise(p: HolonomicProblem, at: Iterate, f: Factors, last: float) -> float:
    """Factorise the Hessian, shifted as little as makes it positive definite; returns the shift.

    IPOPT's inertia correction (Wachter & Biegler, Math. Program. 106, 2006, algorithm IC).

    Args:
        p: The problem.
        at: Where the Hessian is taken: of J and the limits, with the multipliers.
        f: To fill in.
        last: The shift of the iterate before.
    """
    if _sweep(p, at, 0.0, f):
        return last / 3.0
    shift = max(last / 3.0, 1e-3)
    while not _sweep(p, at, shift, f) and shift < 1e12:
        shift *= 4.0
    return shift


@compiled
def _sweep(p: HolonomicProblem, at: Iterate, shift: float, f: Factors) -> bool:
    """Backward Riccati sweep; False if the Hessian, shifted, is not positive definite."""
    stages, dt = len(at.velocities), p.dt
    value, uu, ux, h = np.zeros((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 4))
    for i in range(3):
        value[i, i] = 2.0 * p.state_weights[stages, i]
    for k in range(stages - 1, -1, -1):
        _add_limits(at, k, h)
        for a in range(3):
            for b in range(3):
                uu[a, b] = (h[1 + a, 1 + b] if a >= b else h[1 + b, 1 + a]) + dt * dt * value[a, b]
                ux[a, b] = dt * value[a, b]
            uu[a, a] += 2.0 * p.control_weights[a] + shift
            ux[a, 2] += h[1 + a, 0]
        if not _cholesky(uu, f.lower[k]):
            return False
        for b in range(3):
            _solve(f.lower[k], ux[:, b], f.gains[k, :, b])
        for a in range(3):
            for b in range(a + 1):
                rest = value[a, b]
                for c in range(3):
                    rest -= ux[c, a] * f.gains[k, c, b]
                value[a, b] = value[b, a] = rest
            value[a, a] += 2.0 * p.state_weights[k, a]
        value[2, 2] += h[0, 0]
    return True


@compiled
def _add_limits(at: Iterate, k: int, h: Float[Array, "4 4"]) -> None:
    """Lower half of the Hessian of a stage's limits by (yaw, vx, vy, yaw rate)."""
    for a in range(4):
        for b in range(a + 1):
            h[a, b] = at.bends[k, a, b]
    for w in range(at.rooms.shape[1]):
        up, down = (
            at.multipliers[k, w, 0] / at.rooms[k, w, 0],
            (at.multipliers[k, w, 1] / at.rooms[k, w, 1]),
        )
        for a in range(4):
            for b in range(a + 1):
                h[a, b] += (up + down) * at.slopes[k, w, a] * at.slopes[k, w, b]


@compiled
def _cholesky(matrix: Float[Array, "3 3"], lower: Float[Array, "3 3"]) -> bool:
    """Factor, with the inverse of its diagonal on its diagonal; False if not positive definite."""
    for a in range(3):
        for b in range(a + 1):
            rest: float = matrix[a, b]
            for c in range(b):
                rest -= lower[a, c] * lower[b, c]
            if a > b:
                lower[a, b] = rest * lower[b, b]
            elif rest > _LEAST_CURVATURE:
                lower[a, a] = 1.0 / sqrt(rest)
            else:
                return False
    return True


@compiled
def _solve(
    lower: Float[Array, "3 3"], right: Float[Array, " 3"], found: Float[Array, " 3"]
) -> None:
    """Solve with a factor of :func:`_cholesky`."""
    y0 = right[0] * lower[0, 0]
    y1 = (right[1] - lower[1, 0] * y0) * lower[1, 1]
    y2 = (right[2] - lower[2, 0] * y0 - lower[2, 1] * y1) * lower[2, 2]
    found[2] = y2 * lower[2, 2]
    found[1] = (y1 - lower[2, 1] * found[2]) * lower[1, 1]
    found[0] = (y0 - lower[1, 0] * found[1] - lower[2, 0] * found[2]) * lower[0, 0]


@compiled
def newton_step(
    p: HolonomicProblem,
    at: Iterate,
    f: Factors,
    products: Float[Array, "stages wheels 2"],
    step: Step,
) -> None:
    """Fill in Newton's step towards room x multiplier = ``products``."""
    offsets = _offsets(p, at, f, products)
    moved = np.zeros(3)
    for k in range(len(at.velocities)):
        yaw = moved[2]
        for i in range(3):
            change = -offsets[k, i]
            for j in range(3):
                change -= f.gains[k, i, j] * moved[j]
            step.velocities[k, i] = change
        for i in range(3):
            moved[i] += p.dt * step.velocities[k, i]
        for w in range(at.rooms.shape[1]):
            speed = at.slopes[k, w, 0] * yaw
            for i in range(3):
                speed += at.slopes[k, w, 1 + i] * step.velocities[k, i]
            for side in range(2):
                room = -speed if side == 0 else speed
                step.rooms[k, w, side] = room
                step.multipliers[k, w, side] = (
                    products[k, w, side] - at.multipliers[k, w, side] * room
                ) / at.rooms[k, w, side] - at.multipliers[k, w, side]


@compiled
def _offsets(
    p: HolonomicProblem, at: Iterate, f: Factors, products: Float[Array, "stages wheels 2"]
) -> Float[Array, "stages 3"]:
    """Part of every velocity's step that depends on no state's, negated: the backward sweep."""
    stages, dt = len(at.velocities), p.dt
    states = roll_out(p, at.velocities)
    offsets, right, costate = np.empty((stages, 3)), np.empty(3), np.empty(3)
    for i in range(3):
        error = states[stages, i] - p.targets[stages, i]
        costate[i] = 2.0 * p.state_weights[stages, i] * error
    for k in range(stages - 1, -1, -1):
        for i in range(3):
            deviation = at.velocities[k, i] - p.feedforward[k, i]
            right[i] = 2.0 * p.control_weights[i] * deviation + dt * costate[i]
        by_yaw = 0.0
        for w in range(at.rooms.shape[1]):
            up, down = products[k, w, 0] / at.rooms[k, w, 0], products[k, w, 1] / at.rooms[k, w, 1]
            for i in range(3):
                right[i] += (up - down) * at.slopes[k, w, 1 + i]
            by_yaw += (up - down) * at.slopes[k, w, 0]
        _solve(f.lower[k], right, offsets[k])
        for i in range(3):
            costate[i] += 2.0 * p.state_weights[k, i] * (states[k, i] - p.targets[k, i])
            for j in range(3):
                costate[i] -= f.gains[k, j, i] * right[j]
        costate[2] += by_yaw
    return offsets
