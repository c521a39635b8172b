"""Recovery of a run after a fault or disturbance."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.measures.metrics import position_error
from omnidrive.simulation import Outcome, Run

TOLERANCE = 0.05
"""Position error, in m, by which a recovered run may exceed the run without the fault."""


class Recovery(NamedTuple):
    """Recovery of one run from a fault."""

    recovered: bool
    """Whether the robot recovered: from some time until the end of the reference, its position
    error exceeds that of the same controller without the fault by at most 0.05 m."""
    time_to_recover: float
    """Time from the start of the fault to recovery, s; 0 if the limit was never exceeded, NaN if
    the robot did not recover."""
    max_error: float
    """Maximum distance to the reference after the start of the fault, m."""
    stopped: bool
    """Whether the watchdog stopped the robot."""


def recovery(run: Run, undisturbed: Run, at: float) -> Recovery:
    """Compare a run with the run of the same controller without the fault.

    Args:
        run: Run with the fault.
        undisturbed: Run without the fault.
        at: Start of the fault, s.
    """
    error = position_error(run.pose, run.target)
    nominal = np.interp(run.t, undisturbed.t, position_error(undisturbed.pose, undisturbed.target))
    later = run.t >= at
    away = np.flatnonzero(later & ~(error - nominal <= TOLERANCE))
    max_error = float(error[later].max()) if later.any() else nan
    stopped = run.outcome is Outcome.STOPPED
    if run.outcome is not Outcome.FINISHED or (len(away) and away[-1] == len(error) - 1):
        return Recovery(False, nan, max_error, stopped)
    time = float(run.t[away[-1] + 1]) - at if len(away) else 0.0
    return Recovery(True, max(time, 0.0), max_error, stopped)
