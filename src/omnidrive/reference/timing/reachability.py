"""Largest squared speeds along a path under linear limits, by reachability analysis.

Pham & Pham, "A new approach to time-optimal path parameterization based on reachability analysis",
IEEE Trans. Robotics 34(3), 2018. On each interval the path acceleration u = d2s/dt2 is constant,
so that the squared speed x = (ds/dt)^2 is linear in s: x + 2 u (s - s_i). All limits are rows
``|a u + b x| <= 1``; rest (u = x = 0) satisfies them.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined

_FLAT = 1e-14
"""A row whose ``a`` is below this share of its ``b`` does not limit u."""


@inlined
def acceleration_range(
    x: float, ahead: float, double: float, a: Float[Array, " rows"], b: Float[Array, " rows"]
) -> tuple[float, float, float, float]:
    """Return the least and largest u at ``x`` that lead into [0, ahead], and their derivatives."""
    slope = -1.0 / double
    low, high, low_slope, high_slope = slope * x, (ahead - x) / double, slope, slope
    for r in range(a.size):
        if abs(a[r]) <= _FLAT * abs(b[r]):
            continue
        slope, half = -b[r] / a[r], 1.0 / abs(a[r])
        if slope * x + half < high:
            high, high_slope = slope * x + half, slope
        if slope * x - half > low:
            low, low_slope = slope * x - half, slope
    return low, high, low_slope, high_slope


@inlined
def _max_controllable(
    top: float, ahead: float, double: float, a: Float[Array, " rows"], b: Float[Array, " rows"]
) -> float:
    """Return the largest x up to ``top`` from which some u leads into [0, ahead].

    The difference of the largest and the least u is concave in x and not negative at 0. Newton's
    method from above, on the two lines that bound the difference, ends after finitely many steps.
    """
    x = top
    for r in range(a.size):
        if abs(a[r]) <= _FLAT * abs(b[r]) and abs(b[r]) * x > 1.0:
            x = 1.0 / abs(b[r])
    for _ in range(4 * a.size + 8):
        low, high, low_slope, high_slope = acceleration_range(x, ahead, double, a, b)
        slope = high_slope - low_slope
        if high >= low or slope >= 0.0:  # the latter by rounding: no two lines cross below 0
            break
        x = max(x - (high - low) / slope, 0.0)
    return x


@inlined
def controllable_speeds(
    a: Float[Array, "intervals rows"],
    b: Float[Array, "intervals rows"],
    width: float,
    top: float,
    end: float,
) -> Float[Array, " nodes"]:
    """Return the largest squared speed at each node from which the limits can be kept to the end.

    Args:
        a: As for :func:`max_squared_speeds`.
        b: Likewise.
        width: Likewise.
        top: Upper bound of x everywhere.
        end: Largest x at the end.
    """
    maximum = np.empty(len(a) + 1)
    maximum[-1] = end
    for i in range(len(a) - 1, -1, -1):
        maximum[i] = _max_controllable(top, maximum[i + 1], 2.0 * width, a[i], b[i])
    return maximum


@compiled
def max_squared_speeds(
    a: Float[Array, "intervals rows"],
    b: Float[Array, "intervals rows"],
    width: float,
    top: float,
    ends: tuple[float, float],
) -> Float[Array, " nodes"]:
    """Return the largest feasible squared speeds at the ends of all intervals.

    A backward pass computes the controllable sets, a forward pass the largest speeds in them.

    Args:
        a: Factor of u in each row, in s^2 (the path parameter has no unit).
        b: Factor of x at the start of the interval, in s^2.
        width: Width of every interval in the path parameter.
        top: Upper bound of x, in 1/s^2, where no row gives one.
        ends: Largest x at the start and at the end; 0 for rest.
    """
    count, double = len(a), 2.0 * width
    maximum = controllable_speeds(a, b, width, top, min(ends[1], top))
    x = np.empty(count + 1)
    x[0] = min(ends[0], maximum[0])
    for i in range(count):
        low, high, _, _ = acceleration_range(x[i], maximum[i + 1], double, a[i], b[i])
        u = high if high >= low else 0.5 * (low + high)
        x[i + 1] = min(max(x[i] + double * u, 0.0), maximum[i + 1])
    return x
