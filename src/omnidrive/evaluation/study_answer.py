"""Answer of a study in sentences: the best controller of each task, with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.evidence import (
    WORSE,
    PairEvidence,
    StudyEvidence,
    Summary,
    TaskEvidence,
)
from omnidrive.evaluation.run_table import RunTable, Task
from omnidrive.evaluation.table import level_text, number_text

_MEASURES = {"step": "settling_time", "faults": "worst_error"}
"""Compared quantity of a task, if it is not the mean error."""
_MAX_LISTED = 4  # values of an axis in a sentence


class TaskAnswer(NamedTuple):
    """Answer of one task."""

    evidence: TaskEvidence
    """Evidence of the compared quantity."""
    success: TaskEvidence | None
    """Evidence of the success rate; None if all runs are finished."""
    along: tuple[str, ...] = ()
    """Sentences on axes along which another controller than the leader is shown to be better."""
    lost: tuple[str, ...] = ()
    """Sentences on axes with values at which no run is finished."""

    @property
    def lead(self) -> str:
        """Best controller, or those that share the first place, as one sentence."""
        evidence, best = self.evidence, self.evidence.best
        measure = evidence.measure.label
        task = evidence.task.label.capitalize()
        first = evidence.leader
        if first is None:
            return f"{task}: no run has a valid {measure}."
        value = value_text(first)
        if len(evidence.summaries) == 1:
            return f"{task}: {first.controller} has {measure} {value}."
        if not isfinite(first.mean.margin):
            return (
                f"{task}: {first.controller} has the best {measure}, {value}, in too few "
                "repetitions for an interval; more of them show whether the difference is real."
            )
        if len(best) == 1:
            where = " on average" if self.along else ""
            return (
                f"{task}: {first.controller} is best{where}, {measure} {value}."
                f"{self._along}{self._failing(best)}"
            )
        rest = len(evidence.ranking) > len(best)
        return (
            f"{task}: no difference in {measure} is shown between {first.controller}, {value}, and "
            f"{_listed(best[1:])}{'; the others are worse' if rest else ''}."
            f"{self._along}{self._failing(best)}"
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """Comparison of the leader with each other controller, in the order of the means."""
        leader = self.evidence.leader
        if leader is None:
            return ()
        others = (each.controller for each in self.evidence.ranking)
        pairs = (self.evidence.pair(leader.controller, other) for other in others)
        return tuple(_with_detail(pair) for pair in pairs if pair)

    @property
    def _along(self) -> str:
        return "".join(f" {each}" for each in (*self.along, *self.lost))

    def _failing(self, best: Sequence[str]) -> str:
        """Return a warning of the best controllers that finish fewer runs than another."""
        if self.success is None:
            return ""
        warnings = []
        for name in best:
            others = (s.controller for s in self.success.summaries if s.controller != name)
            pairs = (self.success.pair(name, other) for other in others)
            worse = next((pair for pair in pairs if pair and pair.verdict == WORSE), None)
            if worse:
                rates = {s.controller: s.success_rate for s in self.success.summaries}
                warnings.append(
                    f" But {name} finishes {percent(rates[name])} of its runs, "
                    f"{worse.second} {percent(rates[worse.second])}."
                )
        return "".join(warnings)


def study_answers(study: StudyEvidence, metric: str | None = None) -> list[TaskAnswer]:
    """Return the answer of every task.

    Args:
        study: The evidence.
        metric: Compared quantity. None: the mean error (ME); in step responses the settling time,
            with faults the worst error.

    Raises:
        InvalidInput: The runs have no such metric.
    """
    runs, success = study.runs, {}
    if not runs.finished.all():
        every = study.of("finished")
        success = {e.task: e for e in every if any(s.finished < s.runs for s in e.summaries)}
    return [
        TaskAnswer(
            evidence, success.get(task), _differing(study, evidence), _lost(study, task, success)
        )
        for task in runs.tasks
        for evidence in study.of(metric or main_metric(runs, task))
        if evidence.task == task
    ]


def _lost(
    study: StudyEvidence, task: Task, success: Mapping[Task, TaskEvidence]
) -> tuple[str, ...]:
    """Return a sentence for each axis with values at which no run is finished."""
    found = []
    for path in study.runs.shown_axes if task in success else ():
        levels = study.along("finished", path).get(task, [])
        lost = [
            level_text(each.level)
            for each in levels
            if not any(s.success_rate for s in each.evidence.summaries)
        ]
        if 0 < len(lost) < len(levels):
            found.append(f"Along {path} no run is finished at {_shortened(lost)}.")
    return tuple(found)


def _differing(study: StudyEvidence, evidence: TaskEvidence) -> tuple[str, ...]:
    """Return a sentence for each axis at whose values different controllers are best.

    Another controller counts as best at a value only if it is shown there to be better than the
    one that is best on average.
    """
    leader = evidence.leader
    if leader is None:
        return ()
    found = []
    for path in study.runs.shown_axes:
        best: dict[str, list[str]] = {}
        for each in study.along(evidence.measure.name, path).get(evidence.task, []):
            first = each.evidence.leader
            compared = (other.controller for other in each.evidence.summaries)
            if first is not None and leader.controller in compared:
                tied = leader.controller in each.evidence.best
                name = leader.controller if tied else first.controller
                best.setdefault(name, []).append(level_text(each.level))
        if best.keys() - {leader.controller}:
            parts = (f"{name} at {_shortened(levels)}" for name, levels in best.items())
            found.append(f"Along {path} the best one differs: {'; '.join(parts)}.")
    return tuple(found)


def _shortened(levels: Sequence[str]) -> str:
    """Return the values of an axis in words; of many the first and the last one."""
    if len(levels) > _MAX_LISTED:
        return f"{len(levels)} values from {levels[0]} to {levels[-1]}"
    return _listed(levels)


def main_metric(runs: RunTable, task: Task) -> str:
    """Return the quantity by which the controllers are compared in a task."""
    usual = _MEASURES.get(task.name, "me")
    rows = runs.task == runs.tasks.index(task)
    candidates = (usual, "me", *runs.metrics, "finished")
    return next(
        name
        for name in candidates
        if name == "finished"
        or (name in runs.metrics and bool(np.isfinite(runs.values(name)[rows]).any()))
    )


def value_text(summary: Summary) -> str:
    """Return the mean with unit and interval, such as ``50.0 mm [49.2, 50.8]``."""
    measure, mean = summary.measure, summary.mean
    unit = f" {measure.shown_unit}" if measure.shown_unit else ""
    if not isfinite(mean.margin):
        return f"{number_text(measure.factor * mean.mean)}{unit}"
    text, _, low, high = (part.removeprefix("+") for part in mean.text(measure.factor))
    return f"{text}{unit} [{low}, {high}]" if low != high else f"{text}{unit}"


def percent(share: float) -> str:
    """Return a share in per cent; 100 % and 0 % only if it is exact."""
    value = 100.0 * share
    digits = 0 if value in {0.0, 100.0} or 1.0 <= value <= 99.0 else 2
    return f"{value:.{digits}f} %" if isfinite(value) else "–"


def _with_detail(pair: PairEvidence) -> str:
    detail = f" ({pair.detail})" if pair.detail else ""
    left = f"; {pair.left_out} pairs without two valid runs are left out" if pair.left_out else ""
    return f"{pair.sentence}{detail}{left}"


def _listed(words: Sequence[str]) -> str:
    return " and ".join((", ".join(words[:-1]), words[-1])) if len(words) > 1 else words[0]
