"""Comparison of two studies run by run."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.evaluation.measures.quantities import Quantity, quantity
from omnidrive.evaluation.statistics.evidence import NO_DIFFERENCE
from omnidrive.evaluation.statistics.mean_test import difference_tests, needed_differences
from omnidrive.evaluation.statistics.run_table import FACTOR_PREFIX, RunTable, Task
from omnidrive.evaluation.statistics.uncertainty import CONFIDENCE, MeanEstimate, holm
from omnidrive.evaluation.tables.table import RESOLUTION, Table, number_text

EQUAL = "equal"
"""Verdict of runs with equal values."""

_SHOWN_RUNS = 10


class MetricChange(NamedTuple):
    """Change of a metric of one controller in one task."""

    task: Task
    controller: str
    measure: Quantity
    runs: int
    """Number of pairs of runs that are valid in both studies."""
    equal: int
    """Number of those with exactly equal values."""
    first: float
    """Mean in the first study, in the stored unit."""
    change: MeanEstimate
    """Mean over the repetitions of second minus first."""
    p: float
    """p-value of no change, Holm-adjusted over all changes; NaN for one repetition."""
    largest: int
    """Number, in the first study, of the run with the largest change."""

    @property
    def verdict(self) -> str:
        """Result for the second study: equal, better, worse or no difference shown."""
        factor = self.measure.factor
        if self.equal == self.runs:
            return EQUAL
        small = max(abs(factor * self.change.low), abs(factor * self.change.high)) < RESOLUTION
        if not self.p < 1.0 - CONFIDENCE or small:
            return NO_DIFFERENCE
        return "better" if (self.change.mean < 0.0) == self.measure.lower_is_better else "worse"


class StudyDifference(NamedTuple):
    """Differences between two studies."""

    matched: int
    """Number of runs with the same controller, task, repetition and factors."""
    only_first: int
    """Number of runs of the first study only."""
    only_second: int
    same_key: int
    """Number of matched runs with one key: equal scenario, seed and versions."""
    not_reproduced: tuple[int, ...]
    """Numbers, in the first study, of runs with one key and different results."""
    outcomes: int
    """Number of matched runs that are finished in one study only."""
    changes: tuple[MetricChange, ...]

    @property
    def summary(self) -> str:
        """The differences in one or two sentences."""
        if not self.matched:
            return "The studies have no run in common."
        changed = sum(each.verdict != EQUAL for each in self.changes)
        parts = [f"{self.matched:,} runs in common, {self.same_key:,} with the same key"]
        if self.only_first or self.only_second:
            parts.append(f"{self.only_first:,} and {self.only_second:,} in one study only")
        text = ", ".join(parts) + "."
        if self.not_reproduced:
            numbers = ", ".join(map(str, self.not_reproduced[:_SHOWN_RUNS]))
            more = ", ..." if len(self.not_reproduced) > _SHOWN_RUNS else ""
            text += (
                f" {len(self.not_reproduced):,} runs with the same key have different results "
                f"(numbers {numbers}{more}): they are not reproducible, or computed by different "
                "hardware."
            )
        if not changed and not self.outcomes:
            return f"{text} All values are equal."
        return f"{text} {self.outcomes:,} runs are finished in one study only."


def study_difference(first: pa.Table, second: pa.Table) -> StudyDifference:
    """Compare two studies run by run.

    Runs are matched by controller, task, duration, variant, repetition, repeat and the values of
    all factors. Computing times are not compared.

    Args:
        first: Runs of the first study.
        second: Runs of the second study.

    Raises:
        InvalidInput: A table is not one of runs.
    """
    runs = RunTable(first), RunTable(second)
    names = [list(_identities(each.table)) for each in runs]
    places = {identity: k for k, identity in enumerate(names[1])}
    pairs = [(k, places[name]) for k, name in enumerate(names[0]) if name in places]
    rows, others = (np.array([p[i] for p in pairs], dtype=np.int64) for i in (0, 1))
    keys = [np.array(each.table["key"].to_pylist(), dtype=object) for each in runs]
    same = keys[0][rows] == keys[1][others] if len(rows) else np.zeros(0, dtype=bool)
    metrics = [m for m in runs[0].metrics if m in runs[1].metrics and m != "settling_time"]
    changes, differs = [], np.zeros(len(rows), dtype=bool)
    for metric in metrics:
        a, b = runs[0].values(metric)[rows], runs[1].values(metric)[others]
        differs |= (a != b) & ~(np.isnan(a) & np.isnan(b))
        changes += _changes(runs[0], metric, rows, a, b)
    ended = runs[0].finished[rows] != runs[1].finished[others]
    numbers = np.asarray(runs[0].table["number"].to_numpy())[rows]
    return StudyDifference(
        len(rows), len(runs[0]) - len(rows), len(runs[1]) - len(rows), int(same.sum()),
        tuple(numbers[same & (differs | ended)].tolist()), int(ended.sum()), _adjusted(changes),
    )  # fmt: skip


def difference_table(difference: StudyDifference) -> Table:
    """Return the changes of all metrics; those of metrics that are equal everywhere are omitted."""
    moved = {each.measure.name for each in difference.changes if each.verdict != EQUAL}
    rows = tuple(_row(each) for each in difference.changes if each.measure.name in moved)
    return Table(
        "Changes",
        ("task", "controller", "quantity", "first", "second − first", "95 % interval", "runs",
         "equal", "largest at run", "second is"),
        rows,
        "Second minus first study, mean over the repetitions; result Holm-corrected over all rows. "
        f"Equal: number of runs with exactly equal values.{_shortage(difference.changes)}",
        keys=3,
    )  # fmt: skip


def _shortage(changes: Sequence[MetricChange]) -> str:
    """Return the number of repetitions that a change needs, if there are fewer."""
    counts = [each.change.sample_size for each in changes if isfinite(each.p)]
    if not counts or max(counts) >= (needed := needed_differences(len(counts))):
        return ""
    return (
        f" With {max(counts)} repetitions no change of runs that vary can be shown at 5 %: "
        f"{len(counts)} results need at least {needed}."
    )


def _row(change: MetricChange) -> tuple[str, ...]:
    factor = change.measure.factor
    mean, _, low, high = change.change.text(factor)
    return (
        change.task.label, change.controller, change.measure.heading,
        number_text(factor * change.first), mean, low if low == high else f"{low} to {high}",
        str(change.runs), str(change.equal), str(change.largest), change.verdict,
    )  # fmt: skip


def _identities(table: pa.Table) -> Any:
    """Return what identifies each run: controller, task, repetition and factors."""
    fixed = ("controller", "task", "duration", "variant", "repetition", "repeat")
    factors = sorted(name for name in table.column_names if name.startswith(FACTOR_PREFIX))
    columns = [table[name].to_pylist() for name in (*fixed, *factors)]
    head = tuple(factors)
    return ((head, *row) for row in zip(*columns, strict=True))


def _changes(
    runs: RunTable,
    metric: str,
    rows: Int[Array, " pairs"],
    first: Float[Array, " pairs"],
    second: Float[Array, " pairs"],
) -> list[MetricChange]:
    """Return the changes of a metric by task and controller, with p-values not adjusted."""
    numbers = np.asarray(runs.table["number"].to_numpy())[rows]
    both = np.isfinite(first) & np.isfinite(second)
    found = []
    for t, task in enumerate(runs.tasks):
        for c, name in enumerate(runs.controllers):
            chosen = both & (runs.task[rows] == t) & (runs.controller[rows] == c)
            if not chosen.any():
                continue
            change = (second - first)[chosen]
            tested = difference_tests(_by_repetition(change, runs.unit[rows][chosen]))[0]
            found.append(MetricChange(
                task, name, quantity(metric), int(chosen.sum()), int((change == 0.0).sum()),
                float(first[chosen].mean()), tested.estimate, tested.p,
                int(numbers[chosen][np.argmax(np.abs(change))]),
            ))  # fmt: skip
    return found


def _by_repetition(
    values: Float[Array, " rows"], repetition: Int[Array, " rows"]
) -> Float[Array, "repetitions 1"]:
    _, index = np.unique(repetition, return_inverse=True)
    means: Float[Array, " repetitions"] = np.bincount(index, values) / np.bincount(index)
    return means[:, None]


def _adjusted(changes: list[MetricChange]) -> tuple[MetricChange, ...]:
    known = [each for each in changes if isfinite(each.p)]
    adjusted = iter(holm([each.p for each in known]))
    return tuple(each._replace(p=next(adjusted)) if isfinite(each.p) else each for each in changes)


def difference_record(difference: StudyDifference) -> dict[str, Any]:
    """Return the differences as JSON data, values in the stored units; NaN is None."""
    fields = ("matched", "only_first", "only_second", "same_key", "outcomes")
    return {
        **{name: getattr(difference, name) for name in fields},
        "not_reproduced": list(difference.not_reproduced),
        "changes": [
            {
                "task": each.task.label,
                "controller": each.controller,
                "metric": each.measure.name,
                "runs": each.runs,
                "equal": each.equal,
                "first": each.first,
                "change": each.change.mean,
                "low": each.change.low if isfinite(each.change.low) else None,
                "high": each.change.high if isfinite(each.change.high) else None,
                "p": each.p if isfinite(each.p) else None,
                "largest_at": each.largest,
                "verdict": each.verdict,
            }
            for each in difference.changes
        ],
    }
