"""Step-response figures, by the conventions of python-control's ``step_info``."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

STEP_AXES = ("x", "y", "heading")
"""Coordinates of a step response."""

_FINE = 1e-3  # s; step of the linear interpolation between samples


class StepResponse(NamedTuple):
    """Step-response figures of one coordinate."""

    overshoot: float
    """Maximum overshoot of the commanded value, in % of the step."""
    rise_time: float
    """Time from 10 % to 90 % of the step, s; NaN if 90 % is never reached."""
    settling_time: float
    """Time after which the response stays within +-10 % of the step, s; NaN if it never does."""


def step_response(
    t: Float[Array, " rows"], response: Float[Array, " rows"], start: float, goal: float
) -> StepResponse:
    """Compute overshoot, rise time and settling time of one coordinate.

    The definitions are those of ``control.step_info(y, T=t, yfinal=goal, SettlingTimeThreshold=0.1,
    RiseTimeLimits=(0.1, 0.9))`` of python-control, after linear
    interpolation to 1 ms.

    Args:
        t: Times since the step, s.
        response: Values of the coordinate, in any unit; a heading is unwrapped.
        start: Value before the step.
        goal: Commanded value after the step; if equal to ``start``, every figure is NaN.
    """
    if goal == start:
        return StepResponse(nan, nan, nan)
    fine = np.arange(0.0, t[-1] + 0.5 * _FINE, _FINE)
    done = (np.interp(fine, t, response) - start) / (goal - start)
    overshoot = max(100.0 * (float(done.max()) - 1.0), 0.0)
    rise = float(fine[done >= 0.9][0] - fine[done >= 0.1][0]) if (done >= 0.9).any() else nan
    outside = np.flatnonzero(np.abs(done - 1.0) >= 0.1)
    settled = int(outside[-1]) + 1 if len(outside) else 0
    settling = float(fine[settled]) if settled < len(fine) else nan
    return StepResponse(overshoot, rise, settling)
