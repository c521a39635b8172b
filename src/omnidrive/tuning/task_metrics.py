"""Metrics that the runs of each task have, and their values for tuning."""

from __future__ import annotations

from math import isfinite, isnan, nan

from omnidrive.evaluation.measures.metrics import Metrics
from omnidrive.evaluation.measures.quantities import quantity
from omnidrive.evaluation.measures.step_response import STEP_AXES, StepResponse
from omnidrive.evaluation.run_record import TIMING, RunRecord

_OF_FAULTS = frozenset({"recovered", "time_to_recover", "worst_error"})
_EVERYWHERE = frozenset({"finished", "work", *TIMING})
_STEP = _EVERYWHERE | {"settling_time"} | {
    f"{name}_{axis}" for axis in STEP_AXES for name in StepResponse._fields
}  # fmt: skip
_TRACKING = _EVERYWHERE | {*Metrics._fields, "collisions", "min_clearance"}
_FAULTS = (_TRACKING | _OF_FAULTS) - {"min_clearance"}


def metrics_of(task: str) -> frozenset[str]:
    """Return the names of the metrics that runs of a task have."""
    return {"step": _STEP, "faults": _FAULTS}.get(task, _TRACKING)


def has_metric(record: RunRecord, name: str) -> bool:
    """Return whether runs of this kind have a metric: by their task, in `faults` also the fault."""
    if name in _OF_FAULTS and record.variant.startswith("00-"):
        return False
    return name in metrics_of(record.task)


def metric_value(record: RunRecord, name: str) -> float:
    """Return a metric or a computing time of a run; NaN if the run has none.

    ``settling_time`` is that of the slowest axis with a step; NaN if one does not settle.
    """
    if name == "finished":
        return float(record.finished)
    if name == "settling_time":
        times = [record.metrics[f"settling_time_{axis}"] for axis in _moved(record)]
        return nan if not times or any(map(isnan, times)) else max(times)
    return record.metrics.get(name, record.timing.get(name, nan))


def compared_value(record: RunRecord, name: str) -> float:
    """Return a metric for a comparison: a time that is not reached counts as the whole run."""
    value = metric_value(record, name)
    known = name in record.metrics or (name == "settling_time" and has_metric(record, name))
    if isfinite(value) or quantity(name).unit != "s" or not known:
        return value
    moved, axis = _moved(record), name.rpartition("_")[2]
    is_reachable = record.task != "step" or axis in moved or (axis not in STEP_AXES and moved)
    return record.duration if is_reachable else nan


def _moved(record: RunRecord) -> list[str]:
    """Return the axes in which the reference of a step response has a step."""
    return [each for each in STEP_AXES if isfinite(record.metrics.get(f"overshoot_{each}", nan))]
