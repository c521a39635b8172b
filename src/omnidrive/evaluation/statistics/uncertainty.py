"""Confidence intervals and significance tests of means."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, isfinite, log10, nan, sqrt
from typing import NamedTuple

from jaxtyping import Float
from scipy.special import stdtr, stdtrit

from omnidrive.arrays import Array
from omnidrive.evaluation.tables.table import NO_VALUE, RESOLUTION, number_text

CONFIDENCE = 0.95
"""Confidence level of the intervals."""
_MAX_DECIMALS = 6


class MeanEstimate(NamedTuple):
    """A mean with its confidence interval, in the unit of the values."""

    mean: float
    low: float
    """Lower bound of the interval; NaN for fewer than two values, as is ``high``."""
    high: float
    sample_size: int
    """Number of values."""

    @property
    def margin(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.high - self.low)

    def text(self, factor: float = 1.0) -> tuple[str, str, str, str]:
        """Format mean, margin, low and high times ``factor``; all but the margin have a sign.

        Values are rounded to two digits of the margin, with 1 to 6 decimals; smaller margins are in
        scientific notation. All are 0 if the interval is within the resolution of tables. Without a
        bounded interval, all but the mean are dashes. The minus sign is U+2212.
        """
        if not isfinite(self.margin):
            return number_text(factor * self.mean), NO_VALUE, NO_VALUE, NO_VALUE
        if max(abs(factor * self.low), abs(factor * self.high)) < RESOLUTION:
            return "0", "0", "0", "0"
        margin = factor * self.margin
        digits = 1 - floor(log10(margin)) if margin > 0.0 else 4
        places = max(digits, 1)
        form = f".{places}f" if places <= _MAX_DECIMALS else ".1e"
        mean, low, high = (
            f"{factor * value:+z{form}}".replace("-", "\u2212")
            for value in (self.mean, self.low, self.high)
        )
        return mean, f"{margin:{form}}", low, high


def estimate_mean(values: Float[Array, " repeats"]) -> MeanEstimate:
    """Compute mean and 95 % confidence interval of independent values: mean +- t s / sqrt(n).

    t is the quantile of Student's distribution with n - 1 degrees of freedom (Student, "The
    probable error of a mean", Biometrika 6, 1908). The interval is exact for normally distributed
    values and approximate for others. For paired differences it equals that of
    ``scipy.stats.ttest_rel``.
    """
    count = len(values)
    mean = float(values.mean()) if count else nan
    if count < 2:
        return MeanEstimate(mean, nan, nan, count)
    margin = float(stdtrit(count - 1, 0.5 + 0.5 * CONFIDENCE)) * _standard_error(values)
    return MeanEstimate(mean, mean - margin, mean + margin, count)


def p_value(values: Float[Array, " repeats"]) -> float:
    """Return the two-sided p-value of Student's t-test that the true mean is 0.

    If all values are equal, p is 1 if they are 0, else 0. NaN for fewer than two values.
    """
    if len(values) < 2:
        return nan
    mean, error = float(values.mean()), _standard_error(values)
    if error == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    return 2.0 * float(stdtr(len(values) - 1, -abs(mean) / error))


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjust the p-values of a family of tests, to control the family-wise error rate.

    Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6, 1979:
    the k-th smallest of m values, counted from 0, is multiplied by m - k, then raised to the
    largest adjusted value before it and limited to 1.
    """
    adjusted, largest, count = [0.0] * len(p_values), 0.0, len(p_values)
    for rank, i in enumerate(sorted(range(count), key=lambda i: p_values[i])):
        largest = max(largest, min((count - rank) * p_values[i], 1.0))
        adjusted[i] = largest
    return adjusted


def p_text(p: float) -> str:
    """Format a p-value with its relation, such as ``= 0.021`` or ``< 0.001``."""
    return f"= {p:.3f}" if p >= 1e-3 else "< 0.001"


def _standard_error(values: Float[Array, " repeats"]) -> float:
    return float(values.std(ddof=1)) / sqrt(len(values))
