"""Progress along a reference within linear limits that is never ahead of its timing.

The path parameter s is the time of the reference. As in
:mod:`~omnidrive.reference.timing.reachability`, the path acceleration u = d2s/dt2 is constant on
each interval, x = (ds/dt)^2 is the squared rate, and all limits are rows ``|a u + b x| <= 1``. The
delay is t - s.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.reference.timing.reachability import acceleration_range, controllable_speeds

_BISECTIONS = 40
_NO_DELAY = 1e-9
"""Delay, as a share of the width of an interval, that counts as none."""


@compiled
def delayed_squared_rates(
    a: Float[Array, "intervals rows"],
    b: Float[Array, "intervals rows"],
    width: float,
    top: float,
) -> tuple[Float[Array, " nodes"], Float[Array, " nodes"]]:
    """Return the squared rates and the delays (s) at all nodes, with the least delay at each.

    Without a delay the rate is at most 1. With one, it is the largest within the limits from which
    the motion can still brake in time so as not to get ahead of the reference.

    Args:
        a: Factor of u in each row, in s.
        b: Factor of x at the start of the interval.
        width: Width of every interval, in s.
        top: Upper bound of x where no row gives one; at least 1.
    """
    count, double = len(a), 2.0 * width
    late_set = controllable_speeds(a, b, width, top, top)
    on_time = controllable_speeds(a, b, width, 1.0, 1.0)  # with rates of at most 1 to the end
    x, delay = np.empty(count + 1), np.zeros(count + 1)
    x[0] = on_time[0]
    for i in range(count):
        low, high, _, _ = acceleration_range(x[i], late_set[i + 1], double, a[i], b[i])
        fastest = min(max(x[i] + double * high, 0.0), late_set[i + 1])
        if delay[i] <= _NO_DELAY * width and x[i] <= on_time[i] * (1.0 + 1e-9):
            delay[i], ahead = 0.0, min(fastest, on_time[i + 1])
        elif _stays_behind(i, x[i], delay[i], fastest, width, a, b, late_set, on_time):
            ahead = fastest
        else:
            ahead = min(max(x[i] + double * low, min(x[i], on_time[i + 1]), 0.0), fastest)
            for _ in range(_BISECTIONS):
                middle = 0.5 * (ahead + fastest)
                if _stays_behind(i, x[i], delay[i], middle, width, a, b, late_set, on_time):
                    ahead = middle
                else:
                    fastest = middle
        x[i + 1] = ahead
        delay[i + 1] = max(_delay_after(delay[i], x[i], ahead, width), 0.0)
    return x, delay


@inlined
def _delay_after(delay: float, x: float, ahead: float, width: float) -> float:
    """Return the delay (s) at the end of an interval with squared rates ``x`` and ``ahead``."""
    rates = sqrt(x) + sqrt(ahead)
    return delay + width * (2.0 / rates - 1.0) if rates > 0.0 else inf


@inlined
def _stays_behind(  # noqa: PLR0917
    i: int,
    x: float,
    delay: float,
    ahead: float,
    width: float,
    a: Float[Array, "intervals rows"],
    b: Float[Array, "intervals rows"],
    late_set: Float[Array, " nodes"],
    on_time: Float[Array, " nodes"],
) -> bool:
    """Return whether the motion can stay behind the reference if interval i ends at ``ahead``.

    It can if hard braking leads into the set ``on_time`` before the delay is negative.
    """
    while True:
        delay = _delay_after(delay, x, ahead, width)
        i, x = i + 1, ahead
        if delay < 0.0 or i == len(a) or x <= on_time[i] * (1.0 + 1e-12):
            return delay >= 0.0
        low, _, _, _ = acceleration_range(x, late_set[i + 1], 2.0 * width, a[i], b[i])
        ahead = min(max(x + 2.0 * width * low, min(x, on_time[i + 1]), 0.0), late_set[i + 1])
