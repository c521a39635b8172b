"""Output folder of a study; each file is complete or absent."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from platform import python_version
from shutil import copyfile
from typing import Any

import pyarrow.parquet as pq

from omnidrive.choices import WAYPOINTS
from omnidrive.components import configure, find_component
from omnidrive.errors import CannotWrite
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
from omnidrive.files.output_file import atomic_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps import save_nav2_map
from omnidrive.robot import is_robot_file, save_robot
from omnidrive.simulation import Outcome, Run
from omnidrive.simulation.log_file import log_table
from omnidrive.study.output_folder import check_new_folder
from omnidrive.study.planned_scenario import PlannedScenario
from omnidrive.study.scenario import Scenario
from omnidrive.study.scenario_file import save_scenario, scenario_data
from omnidrive.study.scenario_sections import RobotSection

_VERSIONS = ("omnidrive", "numpy", "scipy", "numba", "mujoco")


class RunFolder:
    """Writer of the results of a study; the folder is readable at any time during the study.

    Attributes:
        path: The folder.
    """

    def __init__(self, path: StrPath) -> None:
        """Create the folder.

        Raises:
            CannotWrite: It cannot be created, or is not empty.
        """
        self.path = to_path(path)
        check_new_folder(self.path)
        with write_errors(self.path):
            self.path.mkdir(parents=True, exist_ok=True)

    def save_inputs(self, planned: PlannedScenario) -> None:
        """Write the scenario and copies of its map, robot and waypoint files."""
        if planned.scenario.map.is_file:
            with write_errors(self.path):
                save_nav2_map(planned.obstacles, self.path / "map.yaml")
        waypoints = _waypoint_file(planned.scenario)
        if waypoints:
            with write_errors(self.path):
                copyfile(waypoints, self.path / f"waypoints{waypoints.suffix}")
        for key in _robot_files(planned.scenario):
            with write_errors(self.path):
                save_robot(getattr(planned, key), self.path / f"{key}.yaml")
        with self.complete_file("scenario.yaml") as path:
            save_scenario(_portable(planned.scenario), path)

    def save_series(self, name: str, run: Run) -> None:
        """Write the time series of a run to ``series/NAME.parquet``."""
        with self.complete_file(f"series/{name}.parquet") as path:
            path.parent.mkdir(exist_ok=True)
            pq.write_table(log_table(run.columns), path)

    def save_results(
        self, planned: PlannedScenario, results: StudyResults, timing: dict[str, float]
    ) -> None:
        """Write ``results.json``; docs/run-folder.md describes its schema."""
        data = {
            "format": "omnidrive-results-1",
            "versions": {
                "python": python_version(),
                **{name: version(name) for name in _VERSIONS},
            },
            "components": component_origins(planned.scenario),
            "scenario": scenario_data(_portable(planned.scenario)),
            "path": {
                "length": results.spline.length,
                "cells": len(results.grid_path.poses) if results.grid_path else None,
            },
            "verdict": [verdict_record(verdict) for verdict in verdicts(results)],
            "runs": [track_record(result) for result in results.tracks],
            "step_response": [row for step in results.steps for row in step_records(step)],
            "repeated": [mean_record(group) for group in repeated_runs(results)],
            "paired": [paired_record(difference) for difference in paired_differences(results)],
            "faults": [fault_record(*recovery) for recovery in results.recoveries],
            "timing_s": timing,
        }
        with self.complete_file("results.json") as path:
            path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")

    @contextmanager
    def complete_file(self, name: str) -> Iterator[Path]:
        """Yield a temporary path; rename the file there to ``name`` if the block succeeds."""
        final = self.path / name
        with write_errors(self.path), atomic_file(final) as part:
            yield part


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


def _portable(scenario: Scenario) -> Scenario:
    """Return the scenario with the copies of its files in the run folder."""
    changes: dict[str, object] = {}
    waypoints = _waypoint_file(scenario)
    if waypoints:
        file = f"waypoints{waypoints.suffix}"
        changes["reference"] = configure("references", WAYPOINTS, {"file": file})
    if scenario.map.is_file:
        copy = {"source": "map.yaml", "resolution": None}
        changes["map"] = scenario.map.model_copy(update=copy)
    for key, section in _robot_files(scenario).items():
        changes[key] = section.model_copy(update={"name": f"{key}.yaml"})
    return scenario.model_copy(update=changes)


def _waypoint_file(scenario: Scenario) -> Path | None:
    """Return the waypoint file of the scenario's reference; None for another reference."""
    reference = scenario.reference
    if reference == "path" or reference.type != WAYPOINTS:
        return None
    return Path(reference.values["file"])


def _robot_files(scenario: Scenario) -> dict[str, RobotSection]:
    """Return the sections of the scenario that name a robot file, by key."""
    sections = {"robot": scenario.robot, "plant_robot": scenario.plant_robot}
    return {key: each for key, each in sections.items() if each and is_robot_file(each.name)}


@contextmanager
def write_errors(folder: Path) -> Iterator[None]:
    """Convert an :class:`OSError` to :class:`CannotWrite`."""
    try:
        yield
    except OSError as error:
        raise CannotWrite(
            f"cannot write to {folder}: {error.strerror or error}. Files written before are "
            "kept; free disk space, or choose another folder with --out"
        ) from None


def track_record(result: TrackResult) -> dict[str, Any]:
    """Return an entry of ``runs`` in results.json, in m, rad, s; null if undefined."""
    m, run = result.metrics, result.run
    record = {
        "name": result.name,
        "controller": result.controller,
        "task": result.task,
        "duration": result.duration,
        "noise": result.noise,
        "horizon": result.horizon,
        "repeat": result.repeat,
        **outcome_record(run),
        "me": m.me,
        "mae": m.mae,
        "max_error": m.max_error,
        "me_measured": m.me_measured,
        "mae_measured": m.mae_measured,
        "me_after_start": m.me_after_start,
        "mae_after_start": m.mae_after_start,
        "wheel_acceleration": m.wheel_acceleration,
        "work": m.work,
        "min_clearance": result.min_clearance,
        "collisions": result.collisions,
        "fallbacks": m.fallbacks,
        "step_time_us": {"median": m.step_time_median, "p99": m.step_time_p99},
        "series": f"series/{result.name}.parquet",
    }
    return _json_safe(record)


def step_records(result: StepResult) -> list[dict[str, Any]]:
    """Return the entries of ``step_response`` in results.json, one per axis; null if undefined."""
    return [
        _json_safe(
            {
                "controller": result.controller,
                "axis": axis,
                **response._asdict(),
                **outcome_record(result.run),
                "series": f"series/{result.name}.parquet",
            }
        )
        for axis, response in zip(STEP_AXES, result.responses, strict=True)
    ]


def fault_record(result: FaultResult, recovery: Recovery) -> dict[str, Any]:
    """Return an entry of ``faults`` in results.json; null if undefined."""
    fault = result.fault
    return _json_safe(
        {
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
            **outcome_record(result.run),
            "series": f"series/{result.name}.parquet",
        }
    )


def outcome_record(run: Run) -> dict[str, Any]:
    """Return outcome and events of a run, and the traceback of the exception that ended it."""
    record = {
        "finished": run.outcome is Outcome.FINISHED,
        "outcome": run.ending,
        "events": [event._asdict() for event in run.events],
    }
    return record | ({"traceback": run.traceback} if run.traceback else {})


def mean_record(group: RepeatedRuns) -> dict[str, Any]:
    """Return an entry of ``repeated`` in results.json: means over the finished runs."""
    estimates = {measure: group.estimate_mean(measure)._asdict() for measure in MEASURES}
    return {
        "controller": group.controller,
        "duration": group.duration,
        "runs": len(group.runs),
        "finished": len(group.finished),
        **{
            measure: _json_safe({k: estimate[k] for k in ("mean", "low", "high")})
            for measure, estimate in estimates.items()
        },
    }


def paired_record(pair: PairedDifference) -> dict[str, Any]:
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
        "low": low,
        "high": high,
        "p": pair.p,
        "verdict": pair.verdict,
    }


def verdict_record(verdict: Verdict) -> dict[str, Any]:
    """Return an entry of ``verdict`` in results.json; null if undefined."""
    advantage = verdict.advantage
    return {
        "task": verdict.task,
        "name": verdict.name,
        "measure": verdict.measure,
        "tied": advantage is not None and advantage.is_tied,
        **_json_safe(
            dict.fromkeys(Advantage._fields) if advantage is None else advantage._asdict()
        ),
        "ranking": [
            _json_safe(
                {
                    "name": contender.name,
                    "value": contender.value,
                    "work": contender.work,
                    "step_time_us": contender.step_time,
                    "recovered": contender.recovered,
                }
            )
            for contender in verdict.ranking
        ],
        "unranked": list(verdict.unranked),
    }


def _json_safe(record: dict[str, Any]) -> dict[str, Any]:
    """Return the record with None instead of numbers that JSON cannot represent."""
    undefined = {k for k, v in record.items() if isinstance(v, float) and not isfinite(v)}
    return {k: None if k in undefined else v for k, v in record.items()}
