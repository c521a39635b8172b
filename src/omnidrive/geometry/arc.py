"""Arcs of constant body twist."""

from __future__ import annotations

from math import cos, sin

from omnidrive.compiled import compiled

_SERIES_LIMIT = 0.02
"""Half turn, in rad, below which the arc factor is evaluated by its series, exact to rounding."""
_MAX_HALF_TURN = 1.5
"""Half turn of one stage, in rad, above which the arc factor is extrapolated by a parabola."""


@compiled
def arc_factor(half: float) -> tuple[float, float, float]:
    """Return arc over chord, ``h / sin(h)`` for half the turn h in rad, and two derivatives."""
    square = half * half
    if square < _SERIES_LIMIT * _SERIES_LIMIT:
        value = 1.0 + square * (1.0 / 6.0 + square * (7.0 / 360.0 + square * 31.0 / 15120.0))
        first = half * (1.0 / 3.0 + square * (7.0 / 90.0 + square * 31.0 / 2520.0))
        second = 1.0 / 3.0 + square * (7.0 / 30.0 + square * 31.0 / 504.0)
        return value, first, second
    h = min(max(half, -_MAX_HALF_TURN), _MAX_HALF_TURN)
    s, c = sin(h), cos(h)
    value, first = h / s, (s - h * c) / (s * s)
    second = h / s - 2.0 * c * first / s
    excess = half - h  # nonzero only in intermediate iterates: no robot turns so fast
    return value + excess * (first + 0.5 * excess * second), first + excess * second, second


@compiled
def arc_twist(dt: float, yaw: float, vx: float, vy: float, rate: float) -> tuple[float, float]:
    """Return the translation of a constant body twist, in m/s, from its mean velocity in W.

    With h half the turn, and f the factor of :func:`arc_factor`, it is
    ``f(h) R(-yaw - h) (vx, vy)``; the yaw rate of the twist is ``rate``.
    """
    half = 0.5 * dt * rate
    factor, _, _ = arc_factor(half)
    c, s = cos(yaw + half), sin(yaw + half)
    return factor * (c * vx + s * vy), factor * (c * vy - s * vx)


@compiled
def arc_velocity(
    dt: float, yaw: float, ahead: float, left: float, rate: float
) -> tuple[float, float]:
    """Return the mean velocity in W, in m/s, of a body twist: the inverse of :func:`arc_twist`."""
    half = 0.5 * dt * rate
    factor, _, _ = arc_factor(half)
    c, s = cos(yaw + half), sin(yaw + half)
    return (c * ahead - s * left) / factor, (s * ahead + c * left) / factor
