"""Content of results.json; docs/run-folder.md describes its schema."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from platform import python_version
from typing import Any

from omnidrive.components import find_component
from omnidrive.evaluation import STEP_AXES, RunRecord, StudyLogs, TaskVerdict
from omnidrive.evaluation.statistics.evidence import PairEvidence, StudyEvidence, Summary
from omnidrive.files.output_file import output_file
from omnidrive.robot import is_robot_file
from omnidrive.scenario.run_settings import fault_of
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.simulation import Run
from omnidrive.study.folder import ADVICE, portable
from omnidrive.study.study import Study

_VERSIONS = ("omnidrive", "numpy", "scipy", "numba", "mujoco")
_COMPARED = ("me_measured", "mae_measured", "me", "mae")


def save_results(study: Study, folder: Path, *, drive: Mapping[str, object] | None = None) -> None:
    """Write ``results.json`` of a study of one scenario.

    Args:
        study: The study.
        folder: The folder.
        drive: Entry ``drive`` of a drive in real time. None: these are simulations.

    Raises:
        CannotWrite: The file cannot be written.
    """
    data = results_data(study)
    if drive is not None:
        data["drive"] = dict(drive)
    with output_file(folder / "results.json", ADVICE) as part:
        part.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def results_data(study: Study) -> dict[str, Any]:
    """Return the content of results.json as dictionaries, lists, numbers, strings and None.

    Numbers that are undefined are None.

    Args:
        study: A study of one scenario.
    """
    scenario, logs = study.definition.scenario, study.logs
    by_name = {each.name: each.log for each in logs.runs} if logs else {}

    def log_of(record: RunRecord) -> Run | None:
        """Return the log of a run; of a repeated one it is read for its ending and events."""
        return by_name.get(record.name) or study.log_of(record)

    content = {
        "format": "omnidrive-results-2",
        "versions": {
            "python": python_version(),
            **{name: version(name) for name in _VERSIONS},
        },
        "components": component_origins(scenario),
        "scenario": scenario_data(portable(scenario)),
        "path": _path(logs),
        "verdict": [_verdict_entry(verdict) for verdict in study.verdicts],
        "runs": [
            _track_entry(study, each, log_of(each))
            for each in study.records
            if each.task not in {"step", "faults"}
        ],
        "step_response": [row for each in study.records if each.task == "step"
                          for row in _step_entries(study, each, log_of(each))],
        "repeated": _repeated(study.evidence),
        "paired": _paired(study.evidence),
        "faults": [_fault_entry(study, each, log_of(each)) for each in study.records
                   if each.task == "faults" and study.plan[each.number].settings.fault],
        "timing_s": study.timing,
    }  # fmt: skip
    record: dict[str, Any] = _json_safe(content)
    return record


def component_origins(scenario: Scenario) -> dict[str, Any]:
    """Return distribution and version, or file and hash, of the scenario's components."""
    estimator = scenario.sensors.estimator if scenario.sensors else None
    reference = scenario.reference
    robot, plant_robot = (
        _robot_origin(each.name) for each in (scenario.robot, scenario.true_robot)
    )
    return {
        "robot": robot,
        "plant_robot": plant_robot,
        "reference": None if reference == "path" else reference.component.origin,
        "controllers": {label: c.component.origin for label, c in scenario.controllers.items()},
        "plant": scenario.plant.component.origin,
        "estimator": estimator and estimator.component.origin,
    }


def _robot_origin(name: str) -> str:
    """Return the distribution of an installed robot, or the name of a file, which is copied."""
    return (
        f"file {Path(name).name}" if is_robot_file(name) else find_component("robots", name).origin
    )


def _path(logs: StudyLogs | None) -> dict[str, Any]:
    """Return length (m) and number of cells of the path."""
    if logs is None:
        return {"length": None, "cells": None}
    cells = len(logs.grid_path.poses) if logs.grid_path else None
    return {"length": logs.spline.length, "cells": cells}


def _track_entry(study: Study, record: RunRecord, log: Run | None) -> dict[str, Any]:
    """Return an entry of ``runs``, in m, rad, s."""
    metrics, settings = record.metrics, study.plan[record.number].settings
    return {
        "name": record.name,
        "controller": record.controller,
        "task": record.task,
        "duration": record.duration,
        "noise": record.task == "noise",
        "horizon": settings.horizon,
        "repeat": record.repeat,
        **_outcome(study, record, log),
        **{name: metrics.get(name) for name in _METRICS},
        **{name: int(metrics[name]) if name in metrics else None for name in _COUNTS},
        "step_time_us": {
            "median": record.timing.get("step_time_median"),
            "p99": record.timing.get("step_time_p99"),
        },
        "series": _series(record),
    }


_METRICS = (
    "me", "mae", "max_error", "me_measured", "mae_measured", "me_after_start", "mae_after_start",
    "path_me", "path_mae", "arrival", "wheel_acceleration", "work", "min_clearance",
)  # fmt: skip
_COUNTS = ("collisions", "fallbacks")


def _step_entries(study: Study, record: RunRecord, log: Run | None) -> list[dict[str, Any]]:
    """Return the entries of ``step_response``, one per axis."""
    return [
        {
            "controller": record.controller,
            "axis": axis,
            **{name: record.metrics.get(f"{name}_{axis}")
               for name in ("overshoot", "rise_time", "settling_time")},
            **_outcome(study, record, log),
            "series": _series(record),
        }
        for axis in STEP_AXES
    ]  # fmt: skip


def _fault_entry(study: Study, record: RunRecord, log: Run | None) -> dict[str, Any]:
    """Return an entry of ``faults``."""
    planned, metrics = study.plan[record.number], record.metrics
    fault = fault_of(planned.scenario, planned.settings)
    return {
        "name": record.name,
        "controller": record.controller,
        "fault": fault.model_dump() if fault else None,
        "duration": record.duration,
        "recovered": metrics.get("recovered") == 1.0,
        "time_to_recover": metrics.get("time_to_recover"),
        "worst_error": metrics.get("worst_error"),
        "stopped": record.outcome == "stopped",
        "me": metrics.get("me"),
        "mae": metrics.get("mae"),
        **_outcome(study, record, log),
        "series": _series(record),
    }


def _outcome(study: Study, record: RunRecord, log: Run | None) -> dict[str, Any]:
    """Return outcome and events of a run, and the traceback of the exception that ended it."""
    reasons = dict(study.failures)
    ending = log.ending if log else reasons.get(record.number, record.outcome.replace("_", " "))
    entry = {
        "finished": record.finished,
        "outcome": ending,
        "events": [event._asdict() for event in log.events] if log else [],
    }
    return entry | ({"traceback": log.traceback} if log and log.traceback else {})


def _series(record: RunRecord) -> str | None:
    """Return the file of the time series; None: it is lost with the process of the run."""
    return None if record.is_lost else f"series/{record.name}.parquet"


def _repeated(study: StudyEvidence) -> list[dict[str, Any]]:
    """Return the means over the seeds of the noise, in m and rad; empty with one seed."""
    found: dict[tuple[str, float], dict[str, Any]] = {}
    for measure in _COMPARED if study.runs.repeats > 1 else ():
        for s in _of_noise(study, measure):
            entry = found.setdefault((s.controller, s.task.duration), {
                "controller": s.controller,
                "duration": s.task.duration,
                "runs": s.runs,
                "finished": s.finished,
            })  # fmt: skip
            entry[measure] = {"mean": s.mean.mean, "low": s.mean.low, "high": s.mean.high}
    return list(found.values())


def _of_noise(study: StudyEvidence, measure: str) -> list[Summary]:
    every = study.of(measure) if measure in study.runs.metrics else []
    return [s for e in every if e.task.name == "noise" for s in e.summaries]


def _paired(study: StudyEvidence) -> list[dict[str, Any]]:
    """Return the differences of all pairs of controllers with noise; empty with one seed."""
    return [
        _pair_entry(pair)
        for measure in (_COMPARED if study.runs.repeats > 1 else ())
        if measure in study.runs.metrics
        for evidence in study.of(measure)
        if evidence.task.name == "noise"
        for pair in evidence.pairs
    ]


def _pair_entry(pair: PairEvidence) -> dict[str, Any]:
    mean, low, high, count = pair.difference
    return {
        "first": pair.first,
        "second": pair.second,
        "duration": pair.task.duration,
        "measure": pair.measure.name,
        "unit": pair.measure.unit,
        "seeds": count,
        "mean": mean,
        "low": low,
        "high": high,
        "p": pair.p,
        "verdict": pair.verdict,
    }


def _verdict_entry(verdict: TaskVerdict) -> dict[str, Any]:
    """Return an entry of ``verdict``: ranking of a task, with the test of the first two."""
    first, second, evidence = verdict.leader, verdict.following, verdict.evidence
    pair = evidence.pair(first.controller, second.controller) if first and second else None
    tested = pair if pair and verdict.is_tested else None
    return {
        "task": evidence.task.name,
        "name": verdict.name,
        "measure": evidence.measure.name,
        "unit": evidence.measure.unit,
        "tied": len(verdict.best) > 1,
        "best": list(verdict.best),
        "factor": verdict.factor,
        "difference": tested.difference.mean if tested else None,
        "low": tested.difference.low if tested else None,
        "high": tested.difference.high if tested else None,
        "p": tested.p if tested else None,
        "repetitions": max((s.mean.sample_size for s in evidence.summaries), default=0),
        "ranking": [
            {
                "name": each.controller,
                "value": each.worst if verdict.recovered else each.mean.mean,
                "work": cost.work if cost else None,
                "step_time_us": cost.step_time if cost else None,
                "recovered": verdict.recovered.get(each.controller),
            }
            for each in verdict.ranking
            for cost in [verdict.costs.get(each.controller)]
        ],
        "unranked": list(verdict.unranked),
    }


def _json_safe(value: Any) -> Any:
    """Return a value, also nested, with None instead of numbers that JSON cannot represent."""
    if isinstance(value, dict):
        return {key: _json_safe(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_json_safe(each) for each in value]
    return None if isinstance(value, float) and not isfinite(value) else value
