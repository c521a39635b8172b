"""How a bias wanders."""

from __future__ import annotations

from math import cos, exp, sin, sqrt

from omnidrive.compiled import compiled


@compiled
def gauss_markov(dt: float, time: float, damping: float) -> tuple[float, float, float, float]:
    """How a bias and its rate go on in ``dt`` seconds, but for what is random.

    The bias x is a damped oscillator that white noise drives, ``x'' + 2 damping x' / time +
    x / time^2 = noise``: with a damping near 1 it wanders without a period (the Gaussian process
    with Matern covariance of order 3/2), with a small one it goes to and fro with the period
    ``2 pi time``. In the long run x has the variance s^2 and x' the variance s^2 / time^2, whatever
    the damping (Sarkka & Solin, "Applied Stochastic Differential Equations", 2019, section 12.3).

    Args:
        dt: In s.
        time: Size over rate of change, in s.
        damping: Ratio, from 0 to below 1.

    Returns:
        The matrix ((a, b), (c, d)) of ``(x, x') <- (a x + b x', c x + d x')``.
    """
    pull = 1.0 / time
    swing = pull * sqrt(1.0 - damping * damping)
    decay = exp(-damping * pull * dt)
    across, along = sin(swing * dt) / swing, cos(swing * dt)
    drag = damping * pull * across
    return (
        decay * (along + drag),
        decay * across,
        -decay * pull * pull * across,
        decay * (along - drag),
    )
