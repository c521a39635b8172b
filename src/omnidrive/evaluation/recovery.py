"""How a run goes on after something went wrong in it."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.metrics import position_error
from omnidrive.simulation import Outcome, Run

TOLERANCE = 0.05
"""Distance in m by which a run may err more than without the fault, once it has recovered."""


class Recovery(NamedTuple):
    """How a run went on."""

    recovered: bool
    """Whether the robot came back: from some time to the end of the reference it errs at most 0.05
    m more than the same controller does at that time without the fault."""
    time_to_recover: float
    """From the fault's beginning until it was back for good, in s; 0 if it never was away, NaN if
    it did not come back."""
    max_error: float
    """Largest distance to the reference from the fault on, in m."""
    stopped: bool
    """Whether the watchdog stopped the robot."""


def recovery(run: Run, undisturbed: Run, at: float) -> Recovery:
    """Compare a run with the same controller's without the fault.

    Args:
        run: With the fault.
        undisturbed: Without.
        at: When the fault began, in s.
    """
    error = position_error(run.pose, run.target)
    usual = np.interp(run.t, undisturbed.t, position_error(undisturbed.pose, undisturbed.target))
    later = run.t >= at
    away = np.flatnonzero(later & ~(error - usual <= TOLERANCE))
    max_error = float(error[later].max()) if later.any() else nan
    stopped = run.outcome is Outcome.STOPPED
    if run.outcome is not Outcome.FINISHED or (len(away) and away[-1] == len(error) - 1):
        return Recovery(False, nan, max_error, stopped)
    time = float(run.t[away[-1] + 1]) - at if len(away) else 0.0
    return Recovery(True, max(time, 0.0), max_error, stopped)
