"""Why a solver stopped."""

from __future__ import annotations

from enum import Enum


class Exit(Enum):
    """Why the solver stopped; the value is the message."""

    CONVERGED = "the KKT residual is below the tolerance"
    CAPPED = "the maximum number of iterations was reached first"
    LATE = "the deadline was reached first"
    STALLED = "no step lowers the cost any further, but the KKT residual is above the tolerance"
    UNUSABLE = "the problem or its solution is not finite"


CONVERGED, CAPPED, STALLED = range(3)
"""Exit codes of compiled solvers; indices of :data:`EXITS`."""
EXITS = (Exit.CONVERGED, Exit.CAPPED, Exit.STALLED)
