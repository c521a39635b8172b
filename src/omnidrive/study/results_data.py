"""Content of results.json; docs/run-folder.md describes its schema."""

from __future__ import annotations

from importlib.metadata import version
from math import isfinite
from pathlib import Path
from platform import python_version
from typing import Any

from omnidrive.components import find_component
from omnidrive.evaluation import (
    MEASURES,
    STEP_AXES,
    FaultResult,
    PairedDifference,
    Recovery,
    RepeatedRuns,
    StepResult,
    StudyResults,
    TrackResult,
    Verdict,
    paired_differences,
    repeated_runs,
    verdicts,
)
from omnidrive.evaluation.verdict import Advantage
from omnidrive.robot import is_robot_file
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.simulation import Outcome, Run

_VERSIONS = ("omnidrive", "numpy", "scipy", "numba", "mujoco")


def results_data(
    scenario: Scenario, saved: Scenario, results: StudyResults, timing: dict[str, float]
) -> dict[str, Any]:
    """Return the content of results.json as dictionaries, lists, numbers, strings and None.

    Numbers that are undefined are None.

    Args:
        scenario: The scenario of the study.
        saved: The scenario as it is in the run folder, with the copies of its files.
        results: Results of the runs that are finished.
        timing: Wall time of each part of the study, s.
    """
    content = {
        "format": "omnidrive-results-1",
        "versions": {
            "python": python_version(),
            **{name: version(name) for name in _VERSIONS},
        },
        "components": component_origins(scenario),
        "scenario": scenario_data(saved),
        "path": {
            "length": results.spline.length,
            "cells": len(results.grid_path.poses) if results.grid_path else None,
        },
        "verdict": [_verdict_record(verdict) for verdict in verdicts(results)],
        "runs": [_track_record(result) for result in results.tracks],
        "step_response": [row for step in results.steps for row in _step_records(step)],
        "repeated": [_mean_record(group) for group in repeated_runs(results)],
        "paired": [_paired_record(difference) for difference in paired_differences(results)],
        "faults": [_fault_record(*recovery) for recovery in results.recoveries],
        "timing_s": timing,
    }
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


def _track_record(result: TrackResult) -> dict[str, Any]:
    """Return an entry of ``runs`` in results.json, in m, rad, s."""
    m, run = result.metrics, result.run
    return {
        "name": result.name,
        "controller": result.controller,
        "task": result.task,
        "duration": result.duration,
        "noise": result.noise,
        "horizon": result.horizon,
        "repeat": result.repeat,
        **_outcome_record(run),
        "me": m.me,
        "mae": m.mae,
        "max_error": m.max_error,
        "me_measured": m.me_measured,
        "mae_measured": m.mae_measured,
        "me_after_start": m.me_after_start,
        "mae_after_start": m.mae_after_start,
        "path_me": m.path_me,
        "path_mae": m.path_mae,
        "arrival": m.arrival,
        "wheel_acceleration": m.wheel_acceleration,
        "work": m.work,
        "min_clearance": result.min_clearance,
        "collisions": result.collisions,
        "fallbacks": m.fallbacks,
        "step_time_us": {"median": m.step_time_median, "p99": m.step_time_p99},
        "series": f"series/{result.name}.parquet",
    }


def _step_records(result: StepResult) -> list[dict[str, Any]]:
    """Return the entries of ``step_response`` in results.json, one per axis."""
    return [
        {
            "controller": result.controller,
            "axis": axis,
            **response._asdict(),
            **_outcome_record(result.run),
            "series": f"series/{result.name}.parquet",
        }
        for axis, response in zip(STEP_AXES, result.responses, strict=True)
    ]


def _fault_record(result: FaultResult, recovery: Recovery) -> dict[str, Any]:
    """Return an entry of ``faults`` in results.json."""
    fault = result.fault
    return {
        "name": result.name,
        "controller": result.controller,
        "fault": fault.model_dump() if fault else None,
        "duration": result.duration,
        "recovered": recovery.recovered,
        "time_to_recover": recovery.time_to_recover,
        "worst_error": recovery.max_error,
        "stopped": recovery.stopped,
        "me": result.metrics.me,
        "mae": result.metrics.mae,
        **_outcome_record(result.run),
        "series": f"series/{result.name}.parquet",
    }


def _outcome_record(run: Run) -> dict[str, Any]:
    """Return outcome and events of a run, and the traceback of the exception that ended it."""
    record = {
        "finished": run.outcome is Outcome.FINISHED,
        "outcome": run.ending,
        "events": [event._asdict() for event in run.events],
    }
    return record | ({"traceback": run.traceback} if run.traceback else {})


def _mean_record(group: RepeatedRuns) -> dict[str, Any]:
    """Return an entry of ``repeated`` in results.json: means over the finished runs."""
    estimates = {measure: group.estimate_mean(measure)._asdict() for measure in MEASURES}
    return {
        "controller": group.controller,
        "duration": group.duration,
        "runs": len(group.runs),
        "finished": len(group.finished),
        **{
            measure: {k: estimate[k] for k in ("mean", "low", "high")}
            for measure, estimate in estimates.items()
        },
    }


def _paired_record(pair: PairedDifference) -> dict[str, Any]:
    """Return an entry of ``paired`` in results.json."""
    mean, low, high, count = pair.difference
    return {
        "first": pair.first,
        "second": pair.second,
        "duration": pair.duration,
        "measure": pair.measure,
        "unit": MEASURES[pair.measure],
        "seeds": count,
        "mean": mean,
        "low": low if isfinite(low) else None,
        "high": high if isfinite(high) else None,
        "p": pair.p,
        "verdict": pair.verdict,
    }


def _verdict_record(verdict: Verdict) -> dict[str, Any]:
    """Return an entry of ``verdict`` in results.json."""
    advantage = verdict.advantage
    return {
        "task": verdict.task,
        "name": verdict.name,
        "measure": verdict.measure,
        "tied": advantage is not None and advantage.is_tied,
        **(dict.fromkeys(Advantage._fields) if advantage is None else advantage._asdict()),
        "ranking": [
            {
                "name": contender.name,
                "value": contender.value,
                "work": contender.work,
                "step_time_us": contender.step_time,
                "recovered": contender.recovered,
            }
            for contender in verdict.ranking
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
