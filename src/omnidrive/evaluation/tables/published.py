"""Results published in the paper, for comparison.

The paper: L. Panta, "Comparative Analysis of NMPC and Fuzzy PID Controllers for Trajectory Tracking
in Omni-Drive Robots: Design, Simulation, and Performance Evaluation".
"""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.evaluation.measures.step_response import StepResponse


class PublishedErrors(NamedTuple):
    """Tracking errors of one row of the paper's tables."""

    me: float
    """Mean error, m."""
    mae: float
    """Mean absolute heading error, rad."""


PUBLISHED_ERRORS = {
    ("track", 20.0, "fuzzy_t1"): PublishedErrors(0.0874, 0.0888),
    ("track", 20.0, "fuzzy_t2"): PublishedErrors(0.0855, 0.0849),
    ("track", 20.0, "unicycle-nmpc"): PublishedErrors(0.0722, 0.0625),
    ("track", 30.0, "fuzzy_t1"): PublishedErrors(0.0521, 0.05349),
    ("track", 30.0, "fuzzy_t2"): PublishedErrors(0.0501, 0.0535),
    ("track", 30.0, "unicycle-nmpc"): PublishedErrors(0.0439, 0.0385),
    ("noise", 30.0, "fuzzy_t1"): PublishedErrors(0.0657, 0.0608),
    ("noise", 30.0, "fuzzy_t2"): PublishedErrors(0.0647, 0.0588),
    ("noise", 30.0, "unicycle-nmpc"): PublishedErrors(0.0566, 0.0586),
}
"""Tables 2 and 3 of the paper, by task, duration (s) and controller."""

PUBLISHED_STEPS = {
    "fuzzy_t1": (
        StepResponse(10.800, 0.991, 1.610),
        StepResponse(9.448, 1.186, 1.186),
        StepResponse(78.904, 0.215, 2.282),
    ),
    "fuzzy_t2": (
        StepResponse(10.611, 0.949, 1.522),
        StepResponse(9.692, 1.133, 1.133),
        StepResponse(77.887, 0.242, 2.160),
    ),
    "unicycle-nmpc": (
        StepResponse(5.083, 2.252, 0.921),
        StepResponse(3.480, 0.914, 0.914),
        StepResponse(95.766, 0.175, 1.514),
    ),
}
"""Table 4 of the paper: responses in x, y and heading, by controller."""
