"""Gain of tuning on the held-out runs, with its interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, isfinite, nan
from statistics import fmean
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.evaluation.measures.quantities import QUANTITIES
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.evaluation.statistics.mean_test import (
    MIN_DIFFERENCES,
    difference_tests,
    mean_intervals,
)
from omnidrive.evaluation.statistics.uncertainty import MeanEstimate
from omnidrive.tuning.balanced import motion_of
from omnidrive.tuning.objective import Objective
from omnidrive.tuning.task_metrics import compared_value, metric_value

BETTER, WORSE = "better", "worse"

METRICS = tuple(name for name in QUANTITIES if name != "finished")
"""Metrics whose change on the held-out set is reported, besides the objectives, where runs have
them; `finished` is reported as the number of runs that ended early."""

_MEASURED = {"me_measured": "me", "mae_measured": "mae"}  # equal without noise: reported once

_NEGLIGIBLE = 5e-4  # relative change that tables show as 0

Records = Sequence[RunRecord]
_Pair = tuple[RunRecord, RunRecord]
_Values = Float[Array, "clusters 2"]


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
    lower_is_better: bool = True

    @property
    def relative(self) -> tuple[float, float, float]:
        """Difference and its interval over the mean before tuning; NaN if that is 0."""
        d, base = self.difference, abs(self.before)
        return tuple(each / base if base else nan for each in (d.mean, d.low, d.high))  # type: ignore[return-value]

    @property
    def change(self) -> str:
        """Relative change as text; of a quantity that was 0 before, the value after tuning."""
        mean = self.relative[0]
        return _percent(mean) if isfinite(mean) else f"from 0 to {self.after:.4g}"

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
    def is_worse(self) -> bool:
        """Whether the quantity is worse after tuning by more than its interval."""
        return self.verdict == WORSE

    @property
    def verdict(self) -> str:
        """Whether the interval excludes zero: better, worse or no difference shown.

        A single pair of runs has no interval: the sign of its difference decides.
        """
        mean, low, high = self.relative if self.before else self.difference[:3]
        if self.difference.sample_size == 1:
            low = high = mean
        if not self.lower_is_better:
            low, high = -high, -low
        if high < 0.0 and low < -_NEGLIGIBLE:
            return BETTER
        return WORSE if low > 0.0 and high > _NEGLIGIBLE else "no difference shown"


class MotionGains(NamedTuple):
    """Changes on one held-out motion: a reference, or a step."""

    motion: str
    """Values of the axes of the held-out set; without axes the task."""
    gains: tuple[Gain, ...]
    """As :attr:`HeldOut.gains`, with intervals over the repetitions."""


class HeldOut(NamedTuple):
    """Held-out runs before and after tuning."""

    gains: tuple[Gain, ...]
    """Gain of every objective, then of :data:`METRICS`, over all motions."""
    motions: tuple[MotionGains, ...]
    """The same on each motion."""
    runs: int
    """Number of runs of each."""
    failed_before: int
    """Runs that did not finish before tuning."""
    failed_after: int
    """Likewise after tuning."""

    @property
    def worse(self) -> tuple[tuple[str, Gain], ...]:
        """Quantities that are worse after tuning, over all motions ("") and on each of them."""
        parts = (("", self.gains), *self.motions)
        return tuple((name, each) for name, gains in parts for each in gains if each.is_worse)

    def gain(self, label: str) -> Gain:
        """Return the gain of a quantity by the beginning of its label."""
        return next(each for each in self.gains if each.label.startswith(label))


def held_out_gain(
    before: Records,
    after: Records,
    objectives: Sequence[Objective],
    axes: Sequence[str] = (),
) -> HeldOut:
    """Return the gain of the objectives and of all metrics, over all motions and on each.

    Runs are compared in pairs with the same motion, robot and random numbers. Pairs of which one
    run did not finish are left out, and counted; a time that is not reached, such as a settling
    time, counts as the duration of the run.

    Over all motions, an interval holds for other robots and random numbers and, from 6 motions with
    the quantity on, for other motions: its half width is the root of the sum of the squares of that
    over the repetitions (each the mean over the motions) and of that over the motions (each the
    mean over the repetitions). Both contain the variance within, so that the sum is at least that
    of the mean over crossed random motions and repetitions (Zou & Donner, "Construction of
    confidence limits about effect measures", Stat. Med. 27, 2008). On one motion it holds for
    robots and random numbers. Without repetitions the motions or, of fewer than two, the pairs
    count.

    Args:
        before: Held-out runs before tuning.
        after: Those after tuning.
        objectives: The objectives.
        axes: Names of the axes of the held-out study.
    """
    pairs = _finished_pairs(before, after)
    relative = [each.relative_to(before, axes) for each in objectives]
    groups: dict[str, list[_Pair]] = {}
    for pair in pairs:
        groups.setdefault(motion_of(pair[1], axes), []).append(pair)
    return HeldOut(
        _gains(pairs, relative, axes),
        tuple(MotionGains(name, _gains(each, relative, axes)) for name, each in groups.items()),
        len(after),
        sum(not each.finished for each in before),
        sum(not each.finished for each in after),
    )


def _gains(
    pairs: Sequence[_Pair], objectives: Sequence[Objective], axes: Sequence[str]
) -> tuple[Gain, ...]:
    """Return the gains of objectives and metrics on pairs of runs that have them."""
    gains = []
    for each in objectives:
        counted = [pair for pair in pairs if each.counts(pair[1])]
        if counted:
            gains.append(_gain(Gain(str(each), *_NOTHING), counted, each.value, axes))
    plain = {
        term.metric.name
        for each in objectives
        for term in each.terms
        if len(each.terms) == 1 and term.weight == 1.0 and term.statistic == "mean"
    }
    for name in METRICS:
        quantity = QUANTITIES[name]
        mean = _mean_of(name, quantity.factor)
        counted = [p for p in pairs if all(isfinite(compared_value(each, name)) for each in p)]
        twin = _MEASURED.get(name)
        if twin is not None and all(_is_equal(each, name, twin) for p in counted for each in p):
            continue
        if counted and name not in plain:
            empty = Gain(quantity.heading, *_NOTHING, quantity.lower_is_better)
            gains.append(_gain(empty, counted, mean, axes))
    return tuple(each for each in gains if isfinite(each.after))


_NOTHING = (nan, nan, MeanEstimate(nan, nan, nan, 0))


def _is_equal(record: RunRecord, first: str, second: str) -> bool:
    return metric_value(record, first) == metric_value(record, second)


def _mean_of(name: str, factor: float) -> Callable[[Records], float]:
    """Return the function that gives the mean of a metric in its displayed unit."""
    return lambda records: factor * fmean(compared_value(each, name) for each in records)


def validation_gain(before: Records, after: Records, objective: Objective) -> Gain:
    """Return the gain of an objective on validation runs, for a choice and not for a claim.

    Its interval is that of the mean, see
    :func:`~omnidrive.evaluation.statistics.mean_test.mean_intervals`, which also exists for the few
    repetitions of a validation.
    """
    pairs = [each for each in _finished_pairs(before, after) if objective.counts(each[1])]
    values = _values(_by_repetition(pairs), objective.value)
    (interval,) = mean_intervals((values[:, 1] - values[:, 0])[:, None])
    return Gain(str(objective), *_means(values), interval)


def _finished_pairs(before: Records, after: Records) -> list[_Pair]:
    """Return the pairs of runs of which both finished."""
    earlier = {each.pairing: each for each in before}
    return [
        (earlier[each.pairing], each)
        for each in after
        if each.finished and each.pairing in earlier and earlier[each.pairing].finished
    ]


def _gain(
    empty: Gain, pairs: Sequence[_Pair], value: Callable[[Records], float], axes: Sequence[str]
) -> Gain:
    """Return a gain with the means and the interval of pairs of runs; see held_out_gain."""
    motions: dict[object, list[_Pair]] = {}
    for pair in pairs:
        motions.setdefault((motion_of(pair[1], axes), pair[1].task), []).append(pair)
    is_repeated = len({after.repetition for _, after in pairs}) > 1
    over_motions = list(motions.values())
    clusters = over_motions if len(motions) > 1 and not is_repeated else _by_repetition(pairs)
    values = _values(clusters, value)
    estimate = _tested(values)
    if is_repeated and len(motions) >= MIN_DIFFERENCES:
        other = _tested(_values(over_motions, value))
        low = hypot(estimate.mean - estimate.low, other.mean - other.low)
        high = hypot(estimate.high - estimate.mean, other.high - other.mean)
        mean = estimate.mean
        estimate = estimate._replace(low=mean - low, high=mean + high)
    before, after = _means(values)
    return empty._replace(before=before, after=after, difference=estimate)


def _tested(values: _Values) -> MeanEstimate:
    """Return the mean difference of independent values before and after."""
    (tested,) = difference_tests((values[:, 1] - values[:, 0])[:, None])
    return tested.estimate


def _by_repetition(pairs: Sequence[_Pair]) -> list[list[_Pair]]:
    """Return the pairs of each repetition; of a single one every pair for itself."""
    groups: dict[int, list[_Pair]] = {}
    single = len({after.repetition for _, after in pairs}) == 1
    for k, pair in enumerate(pairs):
        groups.setdefault(k if single else pair[1].repetition, []).append(pair)
    return list(groups.values())


def _values(clusters: Sequence[Sequence[_Pair]], value: Callable[[Records], float]) -> _Values:
    """Return the value of each cluster before and after."""
    values: _Values = np.array(
        [[value([pair[side] for pair in chosen]) for side in (0, 1)] for chosen in clusters]
    ).reshape(-1, 2)
    return values


def _means(values: _Values) -> tuple[float, float]:
    before, after = values.mean(axis=0).tolist() if len(values) else (nan, nan)
    return before, after


def _percent(share: float) -> str:
    return f"{100.0 * share:+z.1f} %".replace("-", "\u2212")
