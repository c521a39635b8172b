"""Second-order Gauss-Markov process: the model of the pose fixes' bias."""

from __future__ import annotations

from math import cos, exp, sin, sqrt

from omnidrive.compiled import compiled


@compiled
def gauss_markov(dt: float, time: float, damping: float) -> tuple[float, float, float, float]:
    """Return the transition matrix of a bias and its rate over ``dt``, without the noise.

    The bias x is a damped oscillator driven by white noise,
    ``x'' + 2 damping x' / time + x / time^2 = noise``. With a damping ratio near 1 it changes
    without a period (the Gaussian process with Matern covariance of order 3/2); with a small one
    it oscillates with the period ``2 pi time``. The stationary variance of x is s^2 and that of x'
    is s^2 / time^2 for every damping ratio (Sarkka & Solin, "Applied Stochastic Differential
    Equations", 2019, section 12.3).

    Args:
        dt: Time step, s.
        time: Standard deviation of the bias over that of its rate, s.
        damping: Damping ratio, at least 0 and below 1.

    Returns:
        a, b, c, d of the transition ``(x, x') <- (a x + b x', c x + d x')``.
    """
    frequency = 1.0 / time
    damped_frequency = frequency * sqrt(1.0 - damping * damping)
    decay = exp(-damping * frequency * dt)
    sine, cosine = sin(damped_frequency * dt) / damped_frequency, cos(damped_frequency * dt)
    damped_sine = damping * frequency * sine
    return (
        decay * (cosine + damped_sine),
        decay * sine,
        -decay * frequency * frequency * sine,
        decay * (cosine - damped_sine),
    )
