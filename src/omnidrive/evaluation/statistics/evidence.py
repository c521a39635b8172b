"""Evidence of a study: distributions of every controller, and tested differences of all pairs."""

from __future__ import annotations

from itertools import combinations
from math import floor, isfinite, log10, nan
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.evaluation.measures.quantities import Quantity, quantity
from omnidrive.evaluation.statistics.confidence_sequence import always_valid_mean, always_valid_p
from omnidrive.evaluation.statistics.mean_test import TestedMean, difference_tests, mean_intervals
from omnidrive.evaluation.statistics.repetition_means import RepetitionMeans, repetition_means
from omnidrive.evaluation.statistics.run_table import RunTable, Task
from omnidrive.evaluation.statistics.uncertainty import CONFIDENCE, MeanEstimate, holm, p_text
from omnidrive.evaluation.tables.table import NO_VALUE, RESOLUTION, number_text

BETTER, WORSE, NO_DIFFERENCE = "better", "worse", "no difference shown"
"""Verdicts of a comparison."""


class Summary(NamedTuple):
    """Distribution of a quantity over the runs of one controller in one task."""

    task: Task
    controller: str
    measure: Quantity
    runs: int
    """Number of runs."""
    finished: int
    """Number of runs that reached the end of their reference."""
    mean: MeanEstimate
    """Mean over the repetitions, with its interval, in the stored unit."""
    median: float
    p95: float
    """Value that 95 % of the valid runs do not exceed in the direction of worse values."""
    worst: float
    """Worst value of a valid run."""

    @property
    def success_rate(self) -> float:
        """Share of the runs that reached the end of their reference."""
        return self.finished / self.runs if self.runs else nan


class PairEvidence(NamedTuple):
    """Tested difference of a quantity between two controllers under the same random numbers."""

    task: Task
    first: str
    second: str
    measure: Quantity
    difference: MeanEstimate
    """Mean over the repetitions of ``first`` minus ``second``, in the stored unit."""
    p: float
    """p-value of zero difference, Holm-adjusted over its family; NaN for one repetition."""
    effect: float
    """Standardised difference: mean over standard deviation of the differences (Cohen's d_z)."""
    share_better: float
    """Share of the pairs of runs in which ``first`` is better; equal values count half."""
    relative: float
    """Difference over the mean of ``second`` in the same runs; NaN if that is 0."""
    left_out: int
    """Number of pairs of runs in which only one is valid, or none."""

    @property
    def verdict(self) -> str:
        """Result for ``first``: better, worse or no difference shown."""
        low, high = (self.measure.factor * v for v in (self.difference.low, self.difference.high))
        negligible = max(abs(low), abs(high)) < RESOLUTION
        if not self.p < 1.0 - CONFIDENCE or negligible:
            return NO_DIFFERENCE
        return BETTER if (self.difference.mean < 0.0) == self.measure.lower_is_better else WORSE

    @property
    def is_shown_alone(self) -> bool:
        """Whether the interval excludes 0, but Holm's correction leaves no difference shown."""
        without = self.difference.low > 0.0 or self.difference.high < 0.0
        return without and not self.p < 1.0 - CONFIDENCE

    @property
    def reversed(self) -> PairEvidence:
        """The same comparison with the controllers exchanged."""
        d, ratio = self.difference, 1.0 + self.relative
        return self._replace(
            first=self.second, second=self.first,
            difference=MeanEstimate(-d.mean, -d.high, -d.low, d.sample_size),
            effect=-self.effect, share_better=1.0 - self.share_better,
            relative=1.0 / ratio - 1.0 if ratio else nan,
        )  # fmt: skip

    @property
    def sentence(self) -> str:
        """Result as a sentence without a full stop, such as ``a is better than b by 0.15 mm``."""
        if self.verdict == WORSE:
            return self.reversed.sentence
        measure, d = self.measure, self.difference
        unit = f" {measure.shown_unit}" if measure.shown_unit else ""
        if not isfinite(d.margin):
            return self._sentence_without_interval(unit)
        better = self.verdict == BETTER
        sign = -1.0 if better and measure.lower_is_better else 1.0
        oriented = self.reversed.difference if sign < 0.0 else d
        mean, _, low, high = oriented.text(measure.factor)
        if better:
            mean, low, high = (text.removeprefix("+") for text in (mean, low, high))
            if low == high:
                return (
                    f"{self.first} is better than {self.second} by {mean}{unit} in every repetition"
                )
            return f"{self.first} is better than {self.second} by {mean}{unit} [{low}, {high}]"
        if low == high == "0":
            return f"{self.first} and {self.second} have equal results"
        text = f"no difference shown between {self.first} and {self.second}: {mean}{unit}"
        alone = ", without 0 for this pair alone" if self.is_shown_alone else ""
        return f"{text} [{low}, {high}]{alone}"

    def _sentence_without_interval(self, unit: str) -> str:
        """Return the sentence of too few repetitions for an interval, which show no difference."""
        mean, count = self.measure.factor * self.difference.mean, self.difference.sample_size
        if not isfinite(mean):
            return f"{self.first} and {self.second} have no valid runs in common"
        relation = "less" if mean < 0.0 else "more"
        repetitions = "one repetition" if count == 1 else f"{count} repetitions"
        return (
            f"{self.first} has {number_text(abs(mean))}{unit} {relation} than {self.second} in "
            f"{repetitions}, too few for an interval"
        )

    @property
    def detail(self) -> str:
        """p-value and effect sizes as one phrase; empty for one repetition."""
        if not isfinite(self.p):
            return ""
        parts = [f"p {p_text(self.p)}"]
        if isfinite(self.relative):
            parts.append(signed_percent(self.relative))
        if isfinite(self.effect):
            parts.append(f"d = {self.effect:+.2f}".replace("-", "\u2212"))
        return ", ".join(parts)


def signed_percent(share: float) -> str:
    """Return a relative difference in per cent with two digits and its sign; a dash for NaN."""
    if not isfinite(share):
        return NO_VALUE
    percent = 100.0 * share
    digits = 1 - floor(log10(abs(percent))) if percent else 0
    return f"{percent:+.{min(max(digits, 0), 6)}f} %".replace("-", "\u2212")


class TaskEvidence(NamedTuple):
    """Evidence of one quantity in one task."""

    task: Task
    measure: Quantity
    summaries: tuple[Summary, ...]
    """One per controller, in the order of the study."""
    pairs: tuple[PairEvidence, ...]
    """All pairs: the later controller of the study minus the earlier one."""

    @property
    def ranking(self) -> tuple[Summary, ...]:
        """Controllers with a valid mean, the best first."""
        sign = 1.0 if self.measure.lower_is_better else -1.0
        valid = [each for each in self.summaries if isfinite(each.mean.mean)]
        return tuple(sorted(valid, key=lambda each: sign * each.mean.mean))

    def pair(self, first: str, second: str) -> PairEvidence | None:
        """Return the comparison of two controllers in this order; None: there is none."""
        for each in self.pairs:
            if (each.first, each.second) == (first, second):
                return each
            if (each.second, each.first) == (first, second):
                return each.reversed
        return None

    @property
    def leader(self) -> Summary | None:
        """Controller with the best mean of those that are not shown to be worse than another.

        A controller that fails in difficult cases may have the best mean, but be worse in the same
        cases. None: no controller has a valid mean.
        """
        ranking = self.ranking
        worse = {pair.first if pair.verdict == WORSE else pair.second
                 for pair in self.pairs if pair.verdict != NO_DIFFERENCE}  # fmt: skip
        return next((each for each in ranking if each.controller not in worse), (*ranking, None)[0])

    @property
    def best(self) -> tuple[str, ...]:
        """The leader, and the controllers from which no difference to it is shown."""
        leader = self.leader
        if leader is None:
            return ()
        first = leader.controller
        tied = [
            each.controller
            for each in self.ranking
            if (pair := self.pair(first, each.controller)) and pair.verdict == NO_DIFFERENCE
        ]
        return (first, *tied)


def task_evidence(
    runs: RunTable,
    metric: str,
    *,
    rows: Bool[Array, " runs"] | None = None,
    always_valid: bool = False,
) -> list[TaskEvidence]:
    """Return the evidence of a metric in every task that has valid values.

    The independent values are the repetitions: a mean over axis values is taken within each of
    them. The p-values of all pairs of controllers in one task are Holm-corrected together.

    Args:
        runs: The runs.
        metric: Name of the metric.
        rows: The rows that count. None: all.
        always_valid: Whether intervals and p-values hold at every number of repetitions, as for
            a study that ends when its intervals are narrow enough.

    Raises:
        InvalidInput: The runs have no such metric.
    """
    return [_adjusted([each])[0] for each in _unadjusted(runs, metric, rows, always_valid)]


class LevelEvidence(NamedTuple):
    """Evidence of one quantity in one task at one value of an axis."""

    level: Any
    """Value of the axis."""
    evidence: TaskEvidence


def axis_evidence(
    runs: RunTable, metric: str, path: str, *, always_valid: bool = False
) -> dict[Task, list[LevelEvidence]]:
    """Return the evidence of a metric at every value of a factor, by task.

    The p-values of all pairs of controllers at all values of the factor are Holm-corrected
    together. Other axes are averaged. Tasks in which the factor does not vary are omitted,
    and values at which no run is finished.

    Args:
        runs: The runs.
        metric: Name of the metric.
        path: Path of the factor.
        always_valid: See :func:`task_evidence`.

    Raises:
        InvalidInput: The runs have no such metric or factor.
    """
    levels, codes = runs.levels(path)
    found: dict[Task, list[LevelEvidence]] = {}
    for k, level in enumerate(levels):
        for each in _unadjusted(runs, metric, codes == k, always_valid):
            found.setdefault(each.task, []).append(LevelEvidence(level, each))
    return {
        task: [
            LevelEvidence(each.level, evidence)
            for each, evidence in zip(
                every, _adjusted([each.evidence for each in every]), strict=True
            )
        ]
        for task, every in found.items()
        if len(set(codes[runs.task == runs.tasks.index(task)].tolist())) > 1
    }


class StudyEvidence:
    """Evidence of a study, computed once per quantity.

    Attributes:
        runs: The runs.
        always_valid: Whether intervals and p-values hold at every number of repetitions, as for
            a study that ends when its intervals are narrow enough.
    """

    def __init__(self, runs: RunTable, *, always_valid: bool = False) -> None:
        self.runs, self.always_valid = runs, always_valid
        self._found: dict[str, list[TaskEvidence]] = {}
        self._along: dict[tuple[str, str], dict[Task, list[LevelEvidence]]] = {}

    def of(self, metric: str) -> list[TaskEvidence]:
        """Return the evidence of a metric in every task; see :func:`task_evidence`."""
        if metric not in self._found:
            self._found[metric] = task_evidence(self.runs, metric, always_valid=self.always_valid)
        return self._found[metric]

    def along(self, metric: str, path: str) -> dict[Task, list[LevelEvidence]]:
        """Return the evidence of a metric along an axis; see :func:`axis_evidence`."""
        if (metric, path) not in self._along:
            found = axis_evidence(self.runs, metric, path, always_valid=self.always_valid)
            self._along[metric, path] = found
        return self._along[metric, path]


def _unadjusted(
    runs: RunTable, metric: str, rows: Bool[Array, " runs"] | None, always_valid: bool
) -> list[TaskEvidence]:
    """Return the evidence of every task with p-values that are not adjusted."""
    measure = quantity(metric)
    return [_of_task(each, measure, always_valid) for each in repetition_means(runs, metric, rows)]


def _adjusted(family: list[TaskEvidence]) -> list[TaskEvidence]:
    """Return the evidence with the p-values of all its pairs Holm-adjusted together."""
    known = [pair.p for each in family for pair in each.pairs if isfinite(pair.p)]
    adjusted = iter(holm(known))
    return [
        each._replace(
            pairs=tuple(
                pair._replace(p=next(adjusted)) if isfinite(pair.p) else pair for pair in each.pairs
            )
        )
        for each in family
    ]


def _of_task(grid: RepetitionMeans, measure: Quantity, always_valid: bool) -> TaskEvidence:
    means = grid.means
    columns = list(combinations(range(len(grid.controllers)), 2))
    differences = [grid.difference(late, early) for early, late in columns]
    count = len(grid.controllers)
    stacked = np.column_stack([np.empty((len(means), 0)), *differences])
    if always_valid:
        own, tested = [each.estimate for each in _always_valid(means)], _always_valid(stacked)
    else:
        own, tested = mean_intervals(means), difference_tests(stacked)
    pairs = tuple(
        _pair(grid, measure, (late, early), each, values)
        for (early, late), each, values in zip(columns, tested, differences, strict=True)
    )
    summaries = tuple(_summary(grid, measure, k, own[k]) for k in range(count))
    return TaskEvidence(grid.task, measure, summaries, pairs)


def _summary(grid: RepetitionMeans, measure: Quantity, k: int, mean: MeanEstimate) -> Summary:
    values = grid.values[:, k]
    valid = values[np.isfinite(values)]
    median = p95 = worst = nan
    if len(valid):
        high = measure.lower_is_better
        median, p95 = np.percentile(valid, [50.0, 95.0 if high else 5.0]).tolist()
        worst = float(valid.max() if high else valid.min())
    return Summary(
        grid.task, grid.controllers[k], measure, int(grid.planned[:, k].sum()),
        int(grid.finished[:, k].sum()), mean, median, p95, worst,
    )  # fmt: skip


def _pair(
    grid: RepetitionMeans,
    measure: Quantity,
    columns: tuple[int, int],
    tested: TestedMean,
    values: Float[Array, " repetitions"],
) -> PairEvidence:
    first, second = columns
    ours, theirs = grid.values[:, first], grid.values[:, second]
    both = np.isfinite(ours) & np.isfinite(theirs)
    planned = grid.planned[:, first] & grid.planned[:, second]
    spread = float(np.nanstd(values, ddof=1)) if np.isfinite(values).sum() > 1 else nan
    lower = np.sign(theirs[both] - ours[both]) * (1.0 if measure.lower_is_better else -1.0)
    mean = float(np.mean(theirs[both])) if both.any() else nan
    difference = float(np.mean(ours[both] - theirs[both])) if both.any() else nan
    return PairEvidence(
        grid.task, grid.controllers[first], grid.controllers[second], measure,
        tested.estimate, tested.p,
        effect=tested.estimate.mean / spread if spread else nan,
        share_better=float(np.mean(0.5 + 0.5 * lower)) if both.any() else nan,
        relative=difference / mean if mean else nan,
        left_out=int((planned & ~both).sum()),
    )  # fmt: skip


def _always_valid(columns: Float[Array, "values columns"]) -> list[TestedMean]:
    """Return always valid intervals and p-values of all columns."""
    known = [values[np.isfinite(values)] for values in columns.T]
    return [TestedMean(always_valid_mean(values), always_valid_p(values)) for values in known]
