"""CasADi models of the robots of the NMPC benchmark, for the solvers in the comparison.

It imports nothing else, because it is also imported in the environment of the peers. A statement
holds the data that all problems of a stream have in common, as plain numbers and lists:

    model, stages, dt, stage_weights, terminal_weights, control_weights
    unicycle:  limits
    holonomic: now, before, bounds of its limits; radii, weights of its keep-out zones

Each problem has its own start, targets and feedforward; that of the holonomic robot also the twist
``previous`` before the first stage and ``centres``: for every state a row with x and y of all
keep-out zones, which are discs.

The holonomic robot's controls are the body twists here: then its limits are linear, and IPOPT is
2 to 10 % faster than with velocities in W. The violation of a zone is part of the cost, which is
faster for IPOPT than a slack s with ``distance + s >= radius`` and cost ``weight s^2``: among
obstacles the median step takes 4.0 ms instead of 4.7 ms with N = 15, and 8.3 ms instead of 9.0 ms
with N = 30; with the redundant constraint ``s >= 0`` it takes over 10 ms and 15 ms.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca


class StageData(NamedTuple):
    """Reference and zones of a stage."""

    target: ca.SX
    feedforward: ca.SX
    centres: ca.SX


def bounds(s: dict) -> list[float] | None:
    """Return the largest absolute value of every control; None if the limits are not boxes."""
    return s["limits"] if s["model"] == "unicycle" else None


def controls(s: dict) -> int:
    return len(s["control_weights"])


def zones(s: dict) -> int:
    return len(s.get("radii", []))


def has_rates(s: dict) -> bool:
    """Return whether the limits depend on the controls of the previous stage."""
    return any(map(any, s.get("before", [])))


def next_state(s: dict, x: ca.SX, u: ca.SX) -> ca.SX:
    if s["model"] == "unicycle":
        return x + s["dt"] * ca.vertcat(u[0] * ca.cos(x[2]), u[0] * ca.sin(x[2]), u[1])
    return x + s["dt"] * velocity(s, x, u)


def velocity(s: dict, x: ca.SX, twist: ca.SX) -> ca.SX:
    """Return the mean velocity in W of a constant twist: along an arc."""
    half = 0.5 * s["dt"] * twist[2]
    heading = x[2] + half
    # chord over arc: sin(h) / h, which is 0 / 0 without rotation
    factor = ca.if_else(ca.fabs(half) < 1e-4, 1.0 - half**2 / 6.0, ca.sin(half) / half)
    along_x = ca.cos(heading) * twist[0] - ca.sin(heading) * twist[1]
    along_y = ca.sin(heading) * twist[0] + ca.cos(heading) * twist[1]
    return ca.vertcat(factor * along_x, factor * along_y, twist[2])


def limit_values(s: dict, u: ca.SX, before: ca.SX) -> ca.SX:
    """Return the values that the limits bound to [-1, 1]."""
    if s["model"] == "unicycle":
        return ca.SX(0, 1)
    return (ca.DM(s["now"]) @ u - ca.DM(s["before"]) @ before) / ca.DM(s["bounds"])


def stage_cost(s: dict, x: ca.SX, u: ca.SX, stage: StageData) -> ca.SX:
    rates = u if s["model"] == "unicycle" else velocity(s, x, u)
    return (
        squares(s["stage_weights"], x - stage.target)
        + squares(s["control_weights"], rates - stage.feedforward)
        + keep_out_cost(s, x, stage.centres)
    )


def terminal_cost(s: dict, x: ca.SX, target: ca.SX, centres: ca.SX) -> ca.SX:
    return squares(s["terminal_weights"], x - target) + keep_out_cost(s, x, centres)


def keep_out_cost(s: dict, x: ca.SX, centres: ca.SX) -> ca.SX:
    cost = ca.SX(0)
    for j in range(zones(s)):
        distance = ca.norm_2(x[:2] - centres[2 * j : 2 * j + 2])
        cost += s["weights"][j] * ca.fmax(s["radii"][j] - distance, 0.0) ** 2
    return cost


def squares(weights: list[float], errors: ca.SX) -> ca.SX:
    return ca.sum1(ca.DM(weights) * errors**2)
