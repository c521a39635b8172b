"""The robots of the NMPC benchmark in CasADi, for the solvers that ours are compared with.

It imports nothing else, because it is also read in the environment of the peers. A statement is
what all problems of a stream have in common, in plain numbers and lists:

    model, stages, dt, stage_weights, terminal_weights, control_weights, limits; holonomic: wheels
"""

from __future__ import annotations

import casadi as ca


def bounds(s: dict) -> list[float] | None:
    """Largest absolute value of every control, where these are boxes."""
    return s["limits"] if s["model"] == "unicycle" else None


def controls(s: dict) -> int:
    return len(s["control_weights"])


def next_state(s: dict, x: ca.SX, u: ca.SX) -> ca.SX:
    if s["model"] == "unicycle":
        return x + s["dt"] * ca.vertcat(u[0] * ca.cos(x[2]), u[0] * ca.sin(x[2]), u[1])
    return x + s["dt"] * u


def limited(s: dict, x: ca.SX, u: ca.SX) -> ca.SX:
    """What may not exceed 1 or fall below -1: every wheel's speed over its limit."""
    if s["model"] == "unicycle":
        return ca.SX(0, 1)
    half = 0.5 * s["dt"] * u[2]
    heading = x[2] + half
    # arc over chord: h / sin(h), which is 0 / 0 at rest
    stretch = ca.if_else(ca.fabs(half) < 1e-4, 1.0 + half**2 / 6.0, half / ca.sin(half))
    ahead = stretch * (ca.cos(heading) * u[0] + ca.sin(heading) * u[1])
    left = stretch * (ca.cos(heading) * u[1] - ca.sin(heading) * u[0])
    return ca.DM(s["wheels"]) @ ca.vertcat(ahead, left, u[2]) / ca.DM(s["limits"])


def stage_cost(s: dict, x: ca.SX, u: ca.SX, target: ca.SX, feedforward: ca.SX) -> ca.SX:
    return squares(s["stage_weights"], x - target) + squares(s["control_weights"], u - feedforward)


def terminal_cost(s: dict, x: ca.SX, target: ca.SX) -> ca.SX:
    return squares(s["terminal_weights"], x - target)


def squares(weights: list[float], errors: ca.SX) -> ca.SX:
    return ca.sum1(ca.DM(weights) * errors**2)
