"""Objectives and limits of tuning: sums of metrics as text, parsed and never evaluated as code."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan, nan
from statistics import fmean
from typing import Literal, NamedTuple

from omnidrive.errors import InvalidInput, one_line, suggestion
from omnidrive.evaluation.measures.quantities import QUANTITIES, Quantity, parse_value
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.tuning.task_metrics import has_metric, metric_value, metrics_of

Statistic = Literal["mean", "max"]

SHORT_NAMES = {"effort": "wheel_acceleration", "computing_time": "step_time_median"}
"""Names of metrics in objectives, besides those of the columns."""

BALANCED = "balanced"
"""Name of the default objective, which is no sum of metrics."""

_MAX_LENGTH = 300
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_METRIC = r"(?:(mean|max)\()?\s*([A-Za-z_]\w*)\s*(?:\[([^\[\]]{1,12})\])?\s*(\))?"
_TERM = re.compile(rf"\s*(?:({_NUMBER})\s*\*\s*)?{_METRIC}\s*(?:\*\s*({_NUMBER}))?\s*", re.ASCII)
_LIMIT = re.compile(r"\s*([A-Za-z_]\w*)\s*(<=|>=)\s*([^<>=]{1,40})", re.ASCII)
_FORM = "a sum of metrics such as me or me + 0.1*effort"


class Term(NamedTuple):
    """A metric with its weight."""

    weight: float
    """Weight of the metric in the unit of the objective."""
    metric: Quantity
    statistic: Statistic
    """Statistic over the runs: their mean or their maximum."""
    unit: str
    """Unit in which the metric counts."""
    factor: float
    """Factor from the stored unit to that unit."""

    def value(self, records: Sequence[RunRecord]) -> float:
        """Return the weighted statistic over runs; NaN if a run has no such metric."""
        values = [metric_value(each, self.metric.name) for each in records]
        combined = fmean(values) if self.statistic == "mean" else _largest(values)
        return self.weight * self.factor * combined

    def __str__(self) -> str:
        unit = f" in {self.unit}" if self.unit else ""
        name = self.metric.label if self.statistic == "mean" else f"max. of {self.metric.label}"
        return f"{name}{unit}" if self.weight == 1.0 else f"{self.weight:g} × {name}{unit}"


@dataclass(frozen=True, slots=True)
class Objective:
    """A weighted sum of metrics, to be minimised.

    Attributes:
        text: The objective as the user writes it.
        terms: Metrics with their weights.
    """

    text: str
    terms: tuple[Term, ...]

    def covers(self, task: str) -> bool:
        """Return whether runs of a task have all metrics of the objective."""
        return {each.metric.name for each in self.terms} <= metrics_of(task)

    def counts(self, record: RunRecord) -> bool:
        """Return whether a run has all metrics of the objective, unless it ended too early."""
        return all(has_metric(record, each.metric.name) for each in self.terms)

    def relative_to(self, before: Sequence[RunRecord], axes: Sequence[str]) -> Objective:
        """Return the objective with its values before tuning; a sum of metrics needs none.

        Args:
            before: Runs before tuning.
            axes: Names of the axes of their study.
        """
        del before, axes
        return self

    def excess(self, records: Sequence[RunRecord]) -> float:
        """Return how far runs violate what the objective itself permits; 0 for a sum of metrics."""
        del records
        return 0.0

    def value(self, records: Sequence[RunRecord]) -> float:
        """Return the objective over the runs that count; infinite if one of them has no value."""
        counted = [each for each in records if self.counts(each)]
        if not counted:
            return inf
        total = sum(each.value(counted) for each in self.terms)
        return total if isfinite(total) else inf

    def __str__(self) -> str:
        return " + ".join(map(str, self.terms))


class Limit(NamedTuple):
    """A hard limit of a metric in every run."""

    text: str
    """The limit as the user writes it."""
    metric: Quantity
    bound: float
    """Bound in the stored unit of the metric."""
    is_upper: bool
    """Whether larger values violate the limit."""

    def covers(self, task: str) -> bool:
        """Return whether runs of a task have the metric."""
        return self.metric.name in metrics_of(task)

    def violation(self, record: RunRecord) -> float:
        """Return how far a run exceeds the limit, relative to it; 0 within it, infinite for NaN.

        A run of a task without the metric keeps the limit.
        """
        if not has_metric(record, self.metric.name):
            return 0.0
        value = metric_value(record, self.metric.name)
        excess = value - self.bound if self.is_upper else self.bound - value
        if isnan(value):
            return inf
        return max(0.0, excess) / max(abs(self.bound), 1e-9)


def parse_objective(text: str) -> Objective:
    """Parse a sum of metrics with weights, such as ``me + 0.1*effort``.

    A metric counts in the unit of the tables, such as mm for ``me``, or in the unit in brackets:
    ``me[m]``. Its value is the mean over the runs, or the largest with ``max(me)``.

    Raises:
        InvalidInput: The text has another form, a metric or unit is unknown, or more of every
            metric would be better than less of it.
    """
    if len(text) > _MAX_LENGTH:
        raise InvalidInput(f"an objective has at most {_MAX_LENGTH} characters")
    terms: list[Term] = []
    position = 0
    while position < len(text) or not terms:
        sign = 1.0
        if terms:
            if text[position] not in "+-":
                raise _malformed(text)
            sign = 1.0 if text[position] == "+" else -1.0
            position += 1
        match = _TERM.match(text, position)
        if match is None or bool(match[2]) != bool(match[5]):
            raise _malformed(text)
        terms.append(_term(match, sign))
        position = match.end()
    names = [(each.metric.name, each.statistic) for each in terms]
    if len(set(names)) < len(names):
        raise InvalidInput(f"the objective '{one_line(text, 60)}' contains a metric twice")
    return Objective(text.strip(), tuple(terms))


def parse_limit(text: str) -> Limit:
    """Parse a hard limit such as ``max_error <= 300mm`` or ``min_clearance >= 0.05m``.

    Raises:
        InvalidInput: The text has another form, the metric or the unit is unknown, or the unit is
            missing.
    """
    match = _LIMIT.fullmatch(text) if len(text) <= _MAX_LENGTH else None
    if match is None:
        raise InvalidInput(
            f"'{one_line(text, 60)}' is not a limit; write METRIC<=VALUE or METRIC>=VALUE, such as "
            "max_error<=300mm"
        )
    metric = _metric(match[1])
    bound = parse_value(match[3], metric)
    if metric.unit and re.fullmatch(rf"\s*[+-]?{_NUMBER}\s*", match[3]):
        raise InvalidInput(
            f"the limit of {match[1]} needs a unit, such as {match[3].strip()}{metric.shown_unit}"
        )
    return Limit(text.strip(), metric, bound, match[2] == "<=")


def _term(match: re.Match[str], sign: float) -> Term:
    metric = _metric(match[3])
    unit = metric.shown_unit if match[4] is None else match[4].strip()
    factor = metric.factor if match[4] is None else 1.0 / parse_value(f"1{unit}", metric)
    weight = sign
    for number in (match[1], match[6]):
        weight *= 1.0 if number is None else float(number)
    if not (isfinite(weight) and weight != 0.0):
        raise InvalidInput(f"the weight of {match[3]} is {weight:g}, need another number than 0")
    if (weight > 0.0) != metric.lower_is_better:
        better = "smaller" if metric.lower_is_better else "larger"
        sign_needed = "positive" if metric.lower_is_better else "negative"
        raise InvalidInput(
            f"{better} values of {match[3]} are better, and objectives are minimised: its weight "
            f"must be {sign_needed}"
        )
    return Term(weight, metric, "max" if match[2] == "max" else "mean", unit, factor)


def _metric(name: str) -> Quantity:
    """Return a metric by its name or short name."""
    found = QUANTITIES.get(SHORT_NAMES.get(name, name))
    if found is None:
        known = [*QUANTITIES, *SHORT_NAMES, BALANCED]
        raise InvalidInput(
            f"there is no metric '{one_line(name, 60)}'{suggestion(name, known, maximum=12)}"
        )
    return found


def _largest(values: Sequence[float]) -> float:
    """Return the largest value; NaN if one of them is NaN."""
    return nan if any(map(isnan, values)) else max(values)


def _malformed(text: str) -> InvalidInput:
    return InvalidInput(f"the objective '{one_line(text, 60)}' is not {_FORM}")
