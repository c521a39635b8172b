"""Verdicts of all tasks of a study, from its evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan

import numpy as np

from omnidrive.evaluation.measures.quantities import quantity
from omnidrive.evaluation.run_record import TIMING
from omnidrive.evaluation.statistics.evidence import (
    StudyEvidence,
    Summary,
    TaskEvidence,
)
from omnidrive.evaluation.statistics.run_table import RunTable, Task
from omnidrive.evaluation.study_logs import StudyLogs
from omnidrive.evaluation.tables.table import (
    level_text,
)
from omnidrive.evaluation.verdict import Cost, TaskVerdict, listed

_MEASURES = {"step": "settling_time", "faults": "worst_error"}
"""Compared quantity of a task, if it is not the mean error."""
_COSTS = {"work": "work", "step_time": "step_time_median"}
"""Metric of each field of a cost."""
_MAX_LISTED = 4  # values of an axis in a sentence


def study_verdicts(
    study: StudyEvidence, metric: str | None = None, logs: StudyLogs | None = None
) -> list[TaskVerdict]:
    """Return the verdict of every task.

    Args:
        study: The evidence.
        metric: Compared quantity. None: the mean error (ME), or the mean distance to the path
            where a controller follows a reference that is too fast late on purpose; in step
            responses the settling time, with faults the worst error.
        logs: Logs of the study; None: they are not kept.

    Raises:
        InvalidInput: The runs have no such metric.
    """
    runs, success = study.runs, {}
    if not runs.finished.all():
        every = study.of("finished")
        success = {e.task: e for e in every if any(s.finished < s.runs for s in e.summaries)}
    late = logs.late_durations if logs else frozenset()
    found = []
    for task in runs.tasks:
        is_late = task.name == "track" and task.duration in late
        name = metric or ("path_me" if is_late else main_metric(runs, task))
        swept = _swept(study, task, name)
        if swept is not None:
            found.append(swept)
            continue
        for evidence in study.of(name):
            if evidence.task == task:
                found.append(
                    TaskVerdict(
                        evidence,
                        success.get(task),
                        _costs(study, task),
                        _recovered(runs, task),
                        _faults(runs, task),
                        _differing(study, evidence),
                        _lost(study, task, success),
                    )
                )
    return found


def has_evidence(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> bool:
    """Return whether a study has distributions: several repetitions, or values of axes."""
    return any(each.is_tested for each in verdicts) or bool(table_axes(study, verdicts))


def table_axes(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> list[str]:
    """Return the axes with a table of their own; horizons, and single faults, have another one."""
    shown = {"horizon", *(() if any(each.is_tested for each in verdicts) else ("fault",))}
    return [path for path in study.runs.shown_axes if path not in shown]


def _costs(study: StudyEvidence, task: Task) -> dict[str, Cost]:
    """Return the cost of every controller in a task."""
    means = {
        field: {s.controller: s.mean.mean for e in study.of(name) if e.task == task
                for s in e.summaries}
        for field, name in _COSTS.items()
        if name in study.runs.metrics
    }  # fmt: skip
    return _costs_of(means)


def _costs_of(means: Mapping[str, Mapping[str, float]]) -> dict[str, Cost]:
    """Return costs by contender from the means of each field by contender."""
    names = dict.fromkeys(name for each in means.values() for name in each)
    return {
        name: Cost(**{field: each.get(name, nan) for field, each in means.items()})
        for name in names
    }


def _swept(study: StudyEvidence, task: Task, metric: str) -> TaskVerdict | None:
    """Return the verdict of the task ``horizon``, whose contenders are the horizons.

    None: another task, one horizon only, or several controllers.
    """
    if task.name != "horizon" or "horizon" not in study.runs.factors:
        return None
    found = _by_horizon(study, task, metric)
    controllers = {s.controller for s in found.values()}
    if len(controllers) != 1:
        return None
    costs = {
        field: {level: s.mean.mean for level, s in _by_horizon(study, task, name).items()}
        for field, name in _COSTS.items()
        if name in study.runs.metrics
    }
    summaries = tuple(s._replace(controller=level) for level, s in found.items())
    evidence = TaskEvidence(task, quantity(metric), summaries, ())
    return TaskVerdict(evidence, costs=_costs_of(costs), swept=controllers.pop())


def _by_horizon(study: StudyEvidence, task: Task, metric: str) -> dict[str, Summary]:
    """Return the summary of the last controller at each horizon, such as ``N = 15``."""
    levels = study.along(metric, "horizon").get(task, [])
    return {str(each.level): s for each in levels for s in each.evidence.summaries}


def _recovered(runs: RunTable, task: Task) -> dict[str, int]:
    """Return the number of recoveries of every controller in one repetition of a task."""
    if task.name != "faults" or "recovered" not in runs.metrics or runs.repetitions > 1:
        return {}
    values, of_task = runs.values("recovered"), runs.task == runs.tasks.index(task)
    return {
        name: int(np.nansum(values[of_task & (runs.controller == k)]))
        for k, name in enumerate(runs.controllers)
    }


def _faults(runs: RunTable, task: Task) -> int:
    """Return the number of different faults in a task."""
    _, codes = runs.levels("fault") if "fault" in runs.factors else ([], np.zeros(len(runs)))
    known = np.isfinite(runs.values("recovered")) if "recovered" in runs.metrics else codes < 0
    return len(np.unique(codes[known & (runs.task == runs.tasks.index(task))]))


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
    return listed(levels)


def main_metric(runs: RunTable, task: Task) -> str:
    """Return the quantity by which the controllers are compared in a task."""
    usual = _MEASURES.get(task.name, "me")
    rows = runs.task == runs.tasks.index(task)
    others = [n for n in runs.metrics if quantity(n).needs_finish and n not in TIMING]
    candidates = (usual, "me", *others, "finished")
    return next(
        name
        for name in candidates
        if name == "finished"
        or (name in runs.metrics and bool(np.isfinite(runs.values(name)[rows]).any()))
    )
