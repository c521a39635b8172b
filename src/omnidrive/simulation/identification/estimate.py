"""Estimate of one parameter, and the conditions under which it is identifiable."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, isfinite, log10, nan

MIN_SEGMENTS = 8
"""Least number of segments of a log that determine a parameter."""

_MAX_RELATIVE = {"wheel radius": 0.05, "effective radius": 0.05, "friction": 0.2}
_MAX_TIME_ERROR = 0.01  # s


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimate of one parameter.

    Attributes:
        name: Name of the parameter.
        unit: Unit; "1" for a ratio.
        value: Estimated value; NaN if not identifiable.
        sigma: Standard error; NaN if not identifiable.
        reason: Why it is not identifiable; empty if it is.
    """

    name: str
    unit: str
    value: float
    sigma: float
    reason: str = ""

    def __str__(self) -> str:
        """Format value and standard error, or the reason."""
        if self.reason:
            return f"not identifiable: {self.reason}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        digits = min(max(1 - floor(log10(max(self.sigma, 1e-12))), 0), 12)  # two of the error
        return f"{self.value:.{digits}f} +- {self.sigma:.{digits}f}{unit}"


def missing(name: str, unit: str, reason: str) -> Estimate:
    """Return the estimate of a parameter that is not identifiable for a reason."""
    return Estimate(name, unit, nan, nan, reason)


def checked(estimate: Estimate, segments: int, length: float, reason: str) -> Estimate:
    """Return the estimate, or one with a reason if its standard error is too large.

    Args:
        estimate: Estimate of a radius or of the friction.
        segments: Number of segments of the log with poses.
        length: Least length of a segment, s.
        reason: Why the standard error can be too large.
    """
    if segments < MIN_SEGMENTS:
        reason = (
            f"the log has poses in {segments * length:.3g} s, need {MIN_SEGMENTS * length:.3g} s"
        )
        return missing(estimate.name, estimate.unit, reason)
    relative = estimate.sigma / abs(estimate.value) if estimate.value else inf
    if not relative <= _MAX_RELATIVE[estimate.name] or not estimate.value > 0.0:
        return missing(estimate.name, estimate.unit, reason)
    return estimate


def checked_time(estimate: Estimate, reason: str) -> Estimate:
    """Return the estimate of a time, or one with a reason if its standard error is too large."""
    if not isfinite(estimate.sigma) or estimate.sigma > _MAX_TIME_ERROR:
        return missing(estimate.name, estimate.unit, reason)
    return estimate
