"""Response of a body twist that follows the commanded one with lags."""

from __future__ import annotations

from math import exp
from typing import NamedTuple

from omnidrive.compiled import compiled
from omnidrive.robot.slip import Vector

MIN_LAG = 1e-4
"""In s; a shorter lag is negligible, and would need many integration steps."""


class Sensitivity(NamedTuple):
    """Derivatives of a response, axis by axis; the coupling between the axes is neglected."""

    mean_by_initial: Vector
    """Of the mean twist by the initial one."""
    mean_by_input: Vector
    """Of the mean twist by the commanded one."""
    final_by_initial: Vector
    """Of the final twist by the initial one."""
    final_by_input: Vector
    """Of the final twist by the commanded one."""
    saturation: float
    """Mean share of wheels at the friction limit, 0 to 1."""


@compiled
def lag_response(
    lags: Vector, initial: Vector, commanded: Vector, dt: float
) -> tuple[Vector, Vector, Sensitivity]:
    """Return the motion of ``lag db/dt = c - b`` in ``dt`` seconds for every axis of B.

    Args:
        lags: Time constants of the axes, s; may be 0.
        initial: Body twist b at the start.
        commanded: Commanded twist c, constant.
        dt: In s.

    Returns:
        Mean and final twist, and their derivatives.
    """
    p, m, q = mean_decay(lags[0], dt), mean_decay(lags[1], dt), mean_decay(lags[2], dt)
    by_initial, final_by_initial = (p[0], m[0], q[0]), (p[1], m[1], q[1])
    mean = (
        commanded[0] + p[0] * (initial[0] - commanded[0]),
        commanded[1] + m[0] * (initial[1] - commanded[1]),
        commanded[2] + q[0] * (initial[2] - commanded[2]),
    )
    final = (
        commanded[0] + p[1] * (initial[0] - commanded[0]),
        commanded[1] + m[1] * (initial[1] - commanded[1]),
        commanded[2] + q[1] * (initial[2] - commanded[2]),
    )
    by_input = (1.0 - p[0], 1.0 - m[0], 1.0 - q[0])
    final_by_input = (1.0 - p[1], 1.0 - m[1], 1.0 - q[1])
    return mean, final, Sensitivity(by_initial, by_input, final_by_initial, final_by_input, 0.0)


@compiled
def mean_decay(lag: float, dt: float) -> tuple[float, float]:
    """Return mean and final value of exp(-t / lag) over ``dt`` (s)."""
    if lag < MIN_LAG:
        return 0.0, 0.0
    final = exp(-dt / lag)
    return lag / dt * (1.0 - final), final
