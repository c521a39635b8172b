"""Reduction of the feedback where the delay of the robot's response is not identified.

Cautious control (Astrom & Wittenmark, "Adaptive Control", 2nd ed. 1995, section 7.3): less feedback
where a parameter is uncertain. The bounds follow from the linear loop of feedback gain, motor lag
and observer, so that it has a delay margin of two sample times (decision 0028).
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from omnidrive.compiled import compiled
from omnidrive.estimation.motion.acceleration_ratio import shows_no_delay

_KNOWN, _UNKNOWN = 0.15, 0.4
"""Standard errors of lag and delay, in sample times, up to which the delay counts as identified,
and from which on as unknown."""
_RISE_TIME = 0.5
"""Time from no to full caution without evidence for or against a delay, s."""
_MAX_GAIN = 0.28
"""Largest feedback gain per sample with an unknown delay, 1."""
_MAX_DRIFT = 1e-3
"""Largest drift of the disturbance, times the sample time, with an unknown delay, m/s^(1/2)."""


@compiled
def unknown_delay(error: float, delay_error: float, period: float) -> float:
    """Return 0 for an identified delay to 1 for an unknown one.

    Args:
        error: Standard error of the sum of lag and delay, s.
        delay_error: Standard error of the delay, s, that of a whole sample time included.
        period: Sample time, s.
    """
    spread = sqrt(max(delay_error * delay_error - period * period / 12.0, 0.0))
    ratio = (max(error, spread) / period - _KNOWN) / (_UNKNOWN - _KNOWN)
    return float(min(max(ratio, 0.0), 1.0))


@compiled
def update_caution(state: Any, unknown: float, dt: float) -> None:
    """Update the caution of an observer.

    It is 0 at the start, so that a robot that accelerates at once does so with the full feedback:
    an instability needs several samples to grow. It rises at once where the response was late.

    Args:
        state: Estimates of the observer; changed in place.
        unknown: 0 for an identified delay to 1 for an unknown one.
        dt: Time since the last sample, s.
    """
    highest = state.caution + max(dt / _RISE_TIME, state.response.delayed)
    state.caution = min(unknown * (1.0 - shows_no_delay(state)), highest)


def max_gain(period: float) -> float:
    """Return the largest feedback gain with an unknown delay, 1/s."""
    return _MAX_GAIN / period


@compiled
def cautious_drift(drift: float, period: float) -> float:
    """Return the drift of the disturbance, m/s in a second, with the same margin."""
    return min(drift, _MAX_DRIFT / period)
