"""A kernel of known work: rates in its units can be compared between machines."""

from __future__ import annotations

from math import cos, sin
from statistics import median
from time import process_time

from omnidrive.compiled import compiled

STEPS = 200_000
"""Integration steps of a unit of work; a few milliseconds."""


@compiled
def integrate(steps: int) -> float:
    """Return x after explicit Euler steps of a unicycle whose yaw rate depends on its place."""
    x = y = yaw = 0.0
    for _ in range(steps):
        x += 0.01 * cos(yaw)
        y += 0.01 * sin(yaw)
        yaw += 0.01 * (1.0 - x * x - y * y)
    return x


def unit_time() -> float:
    """Return the processor time of a unit of work, s: the median of several, after a first one."""
    times = []
    for _ in range(6):
        began = process_time()
        integrate(STEPS)
        times.append(process_time() - began)
    return median(times[1:])
