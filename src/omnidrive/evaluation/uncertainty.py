"""How well a few repetitions tell a mean."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10, nan, sqrt
from typing import NamedTuple

from jaxtyping import Float
from scipy.special import stdtr, stdtrit

from omnidrive.arrays import Array

CONFIDENCE = 0.95
"""Share of intervals that hold the true mean."""


class MeanEstimate(NamedTuple):
    """A mean and its confidence interval, in the unit of the values."""

    mean: float
    low: float
    """Lower end of the interval; NaN with fewer than two values, as ``high``."""
    high: float
    sample_size: int
    """How many values."""

    @property
    def margin(self) -> float:
        """Half the interval's width."""
        return 0.5 * (self.high - self.low)

    def text(self, factor: float = 1.0) -> tuple[str, str, str, str]:
        """Mean with its sign, margin, low and high with theirs, times ``factor``, to be printed.

        Rounded to two digits of the margin, within reason; the minus sign is the printers'.
        """
        margin = factor * self.margin
        usual = 1 - floor(log10(margin)) if margin > 0.0 else 4
        places = min(max(usual, 1), 6)
        mean, low, high = (
            f"{factor * value:+.{places}f}".replace("-", "\u2212")
            for value in (self.mean, self.low, self.high)
        )
        return mean, f"{margin:.{places}f}", low, high


def estimate_mean(values: Float[Array, " repeats"]) -> MeanEstimate:
    """Mean and 95 % interval of independent values: mean +- t s / sqrt(n).

    With Student's t of n - 1 degrees of freedom (Student, "The probable error of a mean",
    Biometrika 6, 1908): exact for normal values, close for the mean of some dozens of others.
    On paired differences this is the interval of ``scipy.stats.ttest_rel``.
    """
    count = len(values)
    mean = float(values.mean()) if count else nan
    if count < 2:
        return MeanEstimate(mean, nan, nan, count)
    margin = float(stdtrit(count - 1, 0.5 + 0.5 * CONFIDENCE)) * _error_of_mean(values)
    return MeanEstimate(mean, mean - margin, mean + margin, count)


def p_value(values: Float[Array, " repeats"]) -> float:
    """Two-sided p of Student's t test that the values' true mean is 0; as ``estimate_mean``.

    Values without any spread have p = 1 if they are 0, else 0. NaN with fewer than two values.
    """
    if len(values) < 2:
        return nan
    mean, error = float(values.mean()), _error_of_mean(values)
    if error == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    return 2.0 * float(stdtr(len(values) - 1, -abs(mean) / error))


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values of one family of tests, adjusted so that one false find among all is unlikely.

    Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6, 1979:
    the k-th smallest of m, counted from 0, times m - k; at least those before it, at most 1.
    """
    adjusted, largest, count = [0.0] * len(p_values), 0.0, len(p_values)
    for rank, i in enumerate(sorted(range(count), key=lambda i: p_values[i])):
        largest = max(largest, min((count - rank) * p_values[i], 1.0))
        adjusted[i] = largest
    return adjusted


def _error_of_mean(values: Float[Array, " repeats"]) -> float:
    return float(values.std(ddof=1)) / sqrt(len(values))
