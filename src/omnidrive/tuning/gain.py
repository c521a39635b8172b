"""Gain of tuning on the held-out runs, with its interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.evaluation.measures.quantities import QUANTITIES
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.evaluation.statistics.mean_test import difference_tests, mean_intervals
from omnidrive.evaluation.statistics.uncertainty import MeanEstimate
from omnidrive.tuning.objective import Objective, metric_value

BETTER, WORSE = "better", "worse"

METRICS = ("me", "mae", "max_error", "wheel_acceleration", "step_time_median")
"""Metrics whose change on the held-out set is reported, besides the objectives."""

_NEGLIGIBLE = 5e-4  # relative change that tables show as 0

Records = Sequence[RunRecord]


class Gain(NamedTuple):
    """Change of a quantity by tuning on the held-out runs that finish before and after it."""

    label: str
    """Name with its unit."""
    before: float
    """Mean before tuning."""
    after: float
    """Mean after tuning."""
    difference: MeanEstimate
    """Mean of after minus before, with its 95 % confidence interval."""
    p: float
    """p-value of no difference."""

    @property
    def relative(self) -> tuple[float, float, float]:
        """Difference and its interval over the mean before tuning; NaN if that is 0."""
        d, base = self.difference, abs(self.before)
        return tuple(each / base if base else nan for each in (d.mean, d.low, d.high))  # type: ignore[return-value]

    @property
    def text(self) -> str:
        """Means and relative change as one line."""
        mean, low, high = self.relative
        values = f"{self.label}: {self.before:.4g} before, {self.after:.4g} after tuning"
        if not isfinite(mean):
            return values
        if not isfinite(low):
            return f"{values}, {_percent(mean)}"
        return f"{values}, {_percent(mean)} [{_percent(low)}, {_percent(high)}]"

    @property
    def verdict(self) -> str:
        """Whether the interval excludes zero: better, worse or no difference shown."""
        _, low, high = self.relative
        if high < 0.0 and low < -_NEGLIGIBLE:
            return BETTER
        return WORSE if low > 0.0 and high > _NEGLIGIBLE else "no difference shown"


class HeldOut(NamedTuple):
    """Held-out runs before and after tuning."""

    gains: tuple[Gain, ...]
    """Gain of every objective, then of :data:`METRICS`."""
    runs: int
    """Number of runs of each."""
    failed_before: int
    """Runs that did not finish before tuning."""
    failed_after: int
    """Likewise after tuning."""

    def gain(self, label: str) -> Gain:
        """Return the gain of a quantity by the beginning of its label."""
        return next(each for each in self.gains if each.label.startswith(label))


def held_out_gain(before: Records, after: Records, objectives: Sequence[Objective]) -> HeldOut:
    """Return the gain of the objectives and of the usual metrics.

    Runs are compared in pairs with the same reference, robot and random numbers; the independent
    values are the means of the repetitions or, of a single repetition, the pairs. Pairs of which
    one run did not finish are left out, and counted.

    Args:
        before: Held-out runs before tuning.
        after: Those after tuning.
        objectives: The objectives.
    """
    pairs = _finished_pairs(before, after)
    gains = [_gain(str(each), pairs, each.value) for each in objectives]
    plain = {
        term.metric.name
        for each in objectives
        for term in each.terms
        if len(each.terms) == 1 and term.weight == 1.0 and term.statistic == "mean"
    }
    for name in METRICS:
        quantity = QUANTITIES[name]
        if name not in plain:
            gains.append(_gain(quantity.heading, pairs, _mean_of(name, quantity.factor)))
    return HeldOut(
        tuple(each for each in gains if isfinite(each.after)),
        len(after),
        sum(not each.finished for each in before),
        sum(not each.finished for each in after),
    )


def _mean_of(name: str, factor: float) -> Callable[[Records], float]:
    """Return the function that gives the mean of a metric in its displayed unit."""
    return lambda records: factor * float(np.mean([metric_value(each, name) for each in records]))


def validation_gain(before: Records, after: Records, objective: Objective) -> Gain:
    """Return the gain of an objective on validation runs, for a choice and not for a claim.

    Its interval is that of the mean, see
    :func:`~omnidrive.evaluation.statistics.mean_test.mean_intervals`, which also exists for the few
    repetitions of a validation.
    """
    means, differences = _paired_values(_finished_pairs(before, after), objective.value)
    (interval,) = mean_intervals(differences[:, None])
    return Gain(str(objective), *means, interval, nan)


def _finished_pairs(before: Records, after: Records) -> list[tuple[RunRecord, RunRecord]]:
    """Return the pairs of runs of which both finished."""
    earlier = {each.pairing: each for each in before}
    return [
        (earlier[each.pairing], each)
        for each in after
        if each.finished and each.pairing in earlier and earlier[each.pairing].finished
    ]


def _gain(
    label: str, pairs: Sequence[tuple[RunRecord, RunRecord]], value: Callable[[Records], float]
) -> Gain:
    if not pairs:
        return Gain(label, nan, nan, MeanEstimate(nan, nan, nan, 0), nan)
    means, differences = _paired_values(pairs, value)
    (tested,) = difference_tests(differences[:, None])
    return Gain(label, *means, tested.estimate, tested.p)


def _paired_values(
    pairs: Sequence[tuple[RunRecord, RunRecord]], value: Callable[[Records], float]
) -> tuple[tuple[float, float], Float[Array, " values"]]:
    """Return the means before and after, and the independent differences."""
    groups: dict[int, list[tuple[RunRecord, RunRecord]]] = {}
    single = len({after.repetition for _, after in pairs}) == 1
    for k, pair in enumerate(pairs):
        groups.setdefault(k if single else pair[1].repetition, []).append(pair)
    values = np.array(
        [[value([pair[side] for pair in chosen]) for side in (0, 1)] for chosen in groups.values()]
    ).reshape(-1, 2)
    before, after = values.mean(axis=0).tolist() if len(values) else (nan, nan)
    return (before, after), values[:, 1] - values[:, 0]


def _percent(share: float) -> str:
    return f"{100.0 * share:+z.1f} %".replace("-", "\u2212")
