"""Choosing how long the robot gets for its path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, isfinite

from omnidrive.errors import InvalidInput
from omnidrive.study.prepared import Prepared, lay_out
from omnidrive.study.scenario import Scenario
from omnidrive.study.scenario_file import parse_scenario, scenario_data
from omnidrive.study.tasks import DurationsTask, FaultsTask, TaskName, Tasks

USUAL_SPEED = 0.5
"""Mean speed in m/s when the user names none: the paper's at 20 s."""

_LEAST_SAMPLES = 10  # of a run whose start is its goal


def retime(
    scenario: Scenario, *, duration: float | None = None, speed: float | None = None
) -> Scenario:
    """The scenario with its tasks' durations scaled, so that the shortest suits the path.

    Args:
        scenario: Its step response keeps its own duration.
        duration: Shortest time for the whole path, in s.
        speed: Mean speed in m/s instead; with neither, the usual speed, or the robot's best if
            that is less.

    Raises:
        InvalidInput: Both are given, one is not positive, or a time is out of range.
    """
    if duration is not None and speed is not None:
        raise InvalidInput(
            "a duration and a speed were given; the path's length ties one to the other: give "
            "one of them"
        )
    _refuse_unless_positive("duration", duration, "s")
    _refuse_unless_positive("speed", speed, "m/s")
    if duration is None:
        duration = _suitable(scenario, speed)
    following = scenario.tasks.following
    return _scaled(scenario, duration / following[0]) if following else scenario


def plan_at(scenario: Scenario, speed: float | None = None) -> Prepared:
    """Plan, and give the robot the time that suits the path, in whole samples.

    Args:
        scenario: Its tasks' durations are scaled.
        speed: Mean speed in m/s; without one, as fast as the robot can follow.

    Raises:
        InvalidInput: The speed is not positive, or a time is out of range.
        InvalidReference: The robot is not that fast.
    """
    _refuse_unless_positive("speed", speed, "m/s")
    prepared = lay_out(scenario)
    following = scenario.tasks.following
    if not following:
        return prepared
    wanted = prepared.shortest if speed is None else prepared.path.length / speed
    duration = _whole(wanted, scenario.sample_time)
    prepared.reference(duration)
    return replace(prepared, scenario=_scaled(scenario, duration / following[0]))


def _suitable(scenario: Scenario, speed: float | None) -> float:
    """Duration in s at ``speed`` or the usual one, a whole number of samples."""
    prepared = lay_out(scenario)
    wanted = prepared.path.length / (speed or USUAL_SPEED)
    if speed is None:
        wanted = max(wanted, prepared.shortest)
    return _whole(wanted, scenario.sample_time)


def _whole(duration: float, dt: float) -> float:
    """At least a duration (s), in whole samples, and not too few."""
    return ceil(max(duration / dt, _LEAST_SAMPLES) - 1e-9) * dt


def _refuse_unless_positive(name: str, value: float | None, unit: str) -> None:
    if value is not None and not (isfinite(value) and value > 0.0):
        raise InvalidInput(f"the {name} must be positive, got {value:g} {unit}")


def _scaled(scenario: Scenario, factor: float) -> Scenario:
    """Every time for the path multiplied by ``factor``."""
    tasks = scenario_data(scenario)["tasks"]
    for name in ("track", "noise"):
        if tasks[name]:
            tasks[name]["durations"] = [round(factor * t, 6) for t in tasks[name]["durations"]]
    if tasks["horizon"]:
        tasks["horizon"]["duration"] = round(factor * tasks["horizon"]["duration"], 6)
    if tasks["faults"]:
        tasks["faults"]["duration"] = round(factor * tasks["faults"]["duration"], 6)
    return parse_scenario({**scenario_data(scenario), "tasks": tasks}, "with these times")


def with_task(scenario: Scenario, names: Sequence[str]) -> Scenario:
    """The scenario with the task `faults`, if that is among the names and it has none.

    It takes the shortest time in which the path is followed.
    """
    following = scenario.tasks.following
    if "faults" not in names or scenario.tasks.faults is not None or not following:
        return scenario
    task = FaultsTask(duration=following[0])
    tasks = scenario.tasks.model_copy(update={"faults": task})
    return scenario.model_copy(update={"tasks": tasks})


def one_task(tasks: Tasks, name: TaskName) -> Tasks:
    """One task alone, once, with the first of its durations.

    Raises:
        InvalidInput: The scenario does not have it.
    """
    task = getattr(tasks, name)
    if task is None:
        raise InvalidInput(f"the scenario has no task '{name}'")
    if isinstance(task, DurationsTask):
        task = type(task)(durations=task.durations[:1])
    return Tasks(**{name: task})
