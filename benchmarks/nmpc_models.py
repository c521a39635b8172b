"""The robots of the NMPC benchmark in CasADi, for the solvers that ours are compared with.

It imports nothing else, because it is also read in the environment of the peers. A statement is
what all problems of a stream have in common, in plain numbers and lists:

    model, stages, dt, stage_weights, terminal_weights, control_weights
    unicycle:  limits
    holonomic: now, before, bounds of its limits; radii, weights of its keep-outs

A problem has its own start, targets and feedforward; that of the holonomic robot also the twist
``previous`` before it and ``centres``: of every state a row, x and y of all keep-outs, all discs.

The holonomic robot's controls are here the body twists: then its limits are linear, and IPOPT is
2 to 10 % faster than with velocities in W. Being too near stands in the cost, which for IPOPT is
faster than a slack s with ``distance + s >= radius`` and cost ``weight s^2``: of the steps among
obstacles the median takes 4.0 ms against 4.7 ms with N = 15, 8.3 ms against 9.0 ms with N = 30,
and over 10 ms and 15 ms if also ``s >= 0`` is asked, which holds anyway.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca


class Ahead(NamedTuple):
    """What a stage is given."""

    target: ca.SX
    feedforward: ca.SX
    centres: ca.SX


def bounds(s: dict) -> list[float] | None:
    """Largest absolute value of every control, where these are boxes."""
    return s["limits"] if s["model"] == "unicycle" else None


def controls(s: dict) -> int:
    return len(s["control_weights"])


def places(s: dict) -> int:
    return len(s.get("radii", []))


def has_rates(s: dict) -> bool:
    """Whether the controls before the first matter."""
    return any(map(any, s.get("before", [])))


def next_state(s: dict, x: ca.SX, u: ca.SX) -> ca.SX:
    if s["model"] == "unicycle":
        return x + s["dt"] * ca.vertcat(u[0] * ca.cos(x[2]), u[0] * ca.sin(x[2]), u[1])
    return x + s["dt"] * velocity(s, x, u)


def velocity(s: dict, x: ca.SX, twist: ca.SX) -> ca.SX:
    """Mean velocity in W while a twist is held: along an arc."""
    half = 0.5 * s["dt"] * twist[2]
    heading = x[2] + half
    # chord over arc: sin(h) / h, which is 0 / 0 if the robot does not turn
    shrink = ca.if_else(ca.fabs(half) < 1e-4, 1.0 - half**2 / 6.0, ca.sin(half) / half)
    along_x = ca.cos(heading) * twist[0] - ca.sin(heading) * twist[1]
    along_y = ca.sin(heading) * twist[0] + ca.cos(heading) * twist[1]
    return ca.vertcat(shrink * along_x, shrink * along_y, twist[2])


def limited(s: dict, u: ca.SX, before: ca.SX) -> ca.SX:
    """What may not exceed 1 or fall below -1, of the controls and those of the stage before."""
    if s["model"] == "unicycle":
        return ca.SX(0, 1)
    return (ca.DM(s["now"]) @ u - ca.DM(s["before"]) @ before) / ca.DM(s["bounds"])


def stage_cost(s: dict, x: ca.SX, u: ca.SX, ahead: Ahead) -> ca.SX:
    moves = u if s["model"] == "unicycle" else velocity(s, x, u)
    return (
        squares(s["stage_weights"], x - ahead.target)
        + squares(s["control_weights"], moves - ahead.feedforward)
        + nearness_cost(s, x, ahead.centres)
    )


def terminal_cost(s: dict, x: ca.SX, target: ca.SX, centres: ca.SX) -> ca.SX:
    return squares(s["terminal_weights"], x - target) + nearness_cost(s, x, centres)


def nearness_cost(s: dict, x: ca.SX, centres: ca.SX) -> ca.SX:
    cost = ca.SX(0)
    for j in range(places(s)):
        distance = ca.norm_2(x[:2] - centres[2 * j : 2 * j + 2])
        cost += s["weights"][j] * ca.fmax(s["radii"][j] - distance, 0.0) ** 2
    return cost


def squares(weights: list[float], errors: ca.SX) -> ca.SX:
    return ca.sum1(ca.DM(weights) * errors**2)
