"""Durations of the path-following tasks of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, floor, isfinite, log10
from typing import get_args

from omnidrive.choices import TaskName
from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.parameter import check_choice
from omnidrive.scenario.planned_scenario import PlannedScenario, plan_scenario
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
from omnidrive.scenario.tasks import DURATION, DurationsTask, FaultsTask, Tasks

DEFAULT_SPEED = 0.5
"""Default mean speed in m/s, close to that of the paper (its path in 20 s)."""

_MIN_SAMPLES = 10  # of a run at the default or a given mean speed

_NO_LENGTH = 1e-6  # m; a path of at most this length is a turn on the spot


def retime(
    scenario: Scenario, *, duration: float | None = None, speed: float | None = None
) -> Scenario:
    """Return the scenario with the durations of its tasks scaled to the path.

    Args:
        scenario: The scenario; the duration of its step response is unchanged.
        duration: First (shortest) duration of the path, in s.
        speed: Mean speed in m/s that determines this duration instead. If neither is given, the
            speed is :data:`DEFAULT_SPEED`, or the greatest feasible mean speed if that is lower;
            a motion with times of its own keeps its duration.

    Raises:
        InvalidInput: Both are given, one is not positive, the speed exceeds the largest one of the
            scenario, or a scaled time is out of range.
        InvalidReference: The mean speed exceeds that of the fastest motion within the limits.
    """
    if duration is not None and speed is not None:
        raise InvalidInput(
            "a duration and a speed were given, but the length of the path determines one from "
            "the other; give only one of them"
        )
    _check_positive("duration", duration, "s")
    _check_speed(scenario, speed)
    if duration is None:
        duration = _default_duration(scenario, speed)
    durations = scenario.tasks.path_durations
    return _scaled(scenario, duration / durations[0]) if durations else scenario


def plan_at(
    scenario: Scenario, speed: float | None = None, time_limit: float | None = None
) -> PlannedScenario:
    """Plan the scenario and scale its durations to the path, in whole sample times.

    Args:
        scenario: The scenario.
        speed: Mean speed in m/s; None for the duration of a motion with times of its own, and
            otherwise the shortest feasible one.
        time_limit: As for :func:`~omnidrive.scenario.planned_scenario.plan_scenario`.

    Raises:
        InvalidInput: The speed is not positive or exceeds the largest one of the scenario, or a
            scaled time is out of range.
        InvalidReference: The speed exceeds the limits of the robot.
    """
    _check_speed(scenario, speed)
    planned = plan_scenario(scenario, time_limit)
    durations = scenario.tasks.path_durations
    if not durations:
        return planned
    desired = _at_speed(planned, speed) if speed else planned.natural or planned.shortest
    duration = _whole(max(desired, DURATION.low), scenario.sample_time)
    _check_feasible(planned, duration, speed)
    planned.reference(duration)
    return replace(planned, scenario=_scaled(scenario, duration / durations[0]))


def lengthen(scenario: Scenario) -> Scenario:
    """Return the scenario with the durations of its tasks scaled up if the shortest is infeasible.

    Raises:
        InvalidInput: A scaled time is out of range.
    """
    durations = scenario.tasks.path_durations
    minimum = plan_scenario(scenario).minimum if durations else 0.0
    if not durations or durations[0] >= minimum:
        return scenario
    return _scaled(scenario, _whole(minimum, scenario.sample_time) / durations[0])


def _default_duration(scenario: Scenario, speed: float | None) -> float:
    """Return the duration in s at ``speed`` or the default speed, in whole sample times."""
    planned = plan_scenario(scenario)
    desired = _at_speed(planned, speed or DEFAULT_SPEED)
    if speed is None:
        desired = planned.natural or max(desired, planned.shortest)
    duration = _whole(max(desired, _MIN_SAMPLES * scenario.sample_time), scenario.sample_time)
    _check_feasible(planned, duration, speed)
    return duration


def _check_feasible(planned: PlannedScenario, duration: float, speed: float | None) -> None:
    """Raise InvalidReference if the duration (s) at a given mean speed (m/s) is infeasible."""
    minimum, length = planned.minimum, planned.path.length
    if speed is None or duration >= minimum * (1.0 - 1e-9):
        return
    top = length / _whole(minimum, planned.scenario.sample_time)
    digits = max(2 - floor(log10(top)), 0)
    raise InvalidReference(
        f"a mean speed of {speed:g} m/s is too high for this path of {length:.2f} m: the fastest "
        f"motion within the limits has {floor(top * 10**digits) / 10**digits:g} m/s "
        f"and takes {minimum:.1f} s"
    )


def _at_speed(planned: PlannedScenario, speed: float) -> float:
    """Return the duration (s) at a mean speed; the shortest for a turn on the spot."""
    length = planned.path.length
    return length / speed if length > _NO_LENGTH else planned.shortest


def _whole(duration: float, dt: float) -> float:
    """Round a duration (s) up to whole sample times."""
    return round(ceil(duration / dt - 1e-9) * dt, 9)


def _check_positive(name: str, value: float | None, unit: str) -> None:
    if value is not None and not (isfinite(value) and value > 0.0):
        raise InvalidInput(f"the {name} must be positive, got {value:g} {unit}")


def _check_speed(scenario: Scenario, speed: float | None) -> None:
    _check_positive("speed", speed, "m/s")
    top = scenario.timing.max_speed
    if speed is not None and top is not None and speed > top:
        raise InvalidInput(
            f"the mean speed of {speed:g} m/s exceeds the largest speed of {top:g} m/s; lower the "
            "mean speed, or raise the largest"
        )


def _scaled(scenario: Scenario, factor: float) -> Scenario:
    """Return the scenario with every duration of the path multiplied by ``factor``."""
    durations = scenario.tasks.path_durations
    for duration in (round(factor * durations[0], 6), round(factor * durations[-1], 6)):
        if not DURATION.low <= duration <= DURATION.high:
            raise InvalidInput(
                f"a run would take {duration:g} s, need {DURATION.low:g} to {DURATION.high:g} s: "
                "choose another duration or speed"
            )
    tasks = scenario_data(scenario)["tasks"]
    for name in ("track", "noise"):
        if tasks[name]:
            tasks[name]["durations"] = [round(factor * t, 6) for t in tasks[name]["durations"]]
    if tasks["horizon"]:
        tasks["horizon"]["duration"] = round(factor * tasks["horizon"]["duration"], 6)
    if tasks["faults"]:
        tasks["faults"]["duration"] = round(factor * tasks["faults"]["duration"], 6)
    return parse_scenario({**scenario_data(scenario), "tasks": tasks}, "with these durations")


def with_task(scenario: Scenario, names: Sequence[str]) -> Scenario:
    """Return the scenario with the task `faults` added if it is named and missing.

    Its duration is the first duration of the path.
    """
    durations = scenario.tasks.path_durations
    if "faults" not in names or scenario.tasks.faults is not None or not durations:
        return scenario
    task = FaultsTask(duration=durations[0])
    tasks = scenario.tasks.model_copy(update={"faults": task})
    return scenario.model_copy(update={"tasks": tasks})


def one_task(tasks: Tasks, name: TaskName) -> Tasks:
    """Return the tasks reduced to one task with the first of its durations.

    Raises:
        InvalidInput: The name is unknown, or the scenario does not have this task.
    """
    check_choice("task", name, get_args(TaskName))
    task = getattr(tasks, name)
    if task is None:
        raise InvalidInput(f"the scenario has no task '{name}'")
    if isinstance(task, DurationsTask):
        task = type(task)(durations=task.durations[:1])
    return Tasks(**{name: task})
