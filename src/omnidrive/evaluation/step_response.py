"""Figures of a step response, by the conventions of python-control's ``step_info``."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

_FINE = 1e-3  # s; rows are a sample apart, so figures are read off straight lines between them


class StepResponse(NamedTuple):
    """How one coordinate answered a step."""

    overshoot: float
    """Largest excess over the commanded value, in % of the step."""
    rise_time: float
    """From 10 % to 90 % of the step, in s; NaN if 90 % is never reached."""
    settling_time: float
    """When the response enters +-10 % of the step for good, in s; NaN if it never does."""


def step_response(
    t: Float[Array, " rows"], response: Float[Array, " rows"], start: float, goal: float
) -> StepResponse:
    """Overshoot, rise time and settling time of one coordinate.

    As ``control.step_info(y, T=t, yfinal=goal, SettlingTimeThreshold=0.1,
    RiseTimeLimits=(0.1, 0.9))`` of python-control, after linear interpolation to 1 ms.

    Args:
        t: Times in s, from the step on.
        response: The coordinate, in any unit; headings unwrapped.
        start: Its value before the step.
        goal: Its commanded value; if that is ``start``, there is no step and every figure is NaN.
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
