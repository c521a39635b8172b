"""Choosing how long the robot gets for its path."""

from __future__ import annotations

from math import ceil, isfinite

from omnidrive.errors import InvalidInput
from omnidrive.reference import shortest_duration
from omnidrive.study.prepared import lay_out
from omnidrive.study.scenario import DurationsTask, Scenario, TaskName, Tasks, study_tasks

USUAL_SPEED = 0.5
"""Mean speed in m/s when the user names none: the paper's at 20 s."""


def retime(
    scenario: Scenario, *, duration: float | None = None, speed: float | None = None
) -> Scenario:
    """The scenario with the paper's tasks, in times that suit its path.

    Args:
        scenario: Its tasks are replaced.
        duration: Time for the whole path in s.
        speed: Mean speed in m/s instead; with neither, the usual speed, or the robot's best if
            that is less.

    Raises:
        InvalidInput: Both are given, or one is not positive.
    """
    if duration is not None and speed is not None:
        raise InvalidInput(
            "a duration and a speed were given; the path's length ties one to the "
            "other: give one of them"
        )
    for name, value, unit in (("duration", duration, "s"), ("speed", speed, "m/s")):
        if value is not None and not (isfinite(value) and value > 0.0):
            raise InvalidInput(f"the {name} must be positive, got {value:g} {unit}")
    if duration is None:
        prepared = lay_out(scenario)
        wanted = prepared.spline.length / (speed or USUAL_SPEED)
        if speed is None:
            wanted = max(wanted, shortest_duration(prepared.spline, prepared.robot.chassis))
        step = scenario.sample_time
        duration = round(ceil(wanted / step - 1e-9) * step, 6)
    return scenario.model_copy(update={"tasks": study_tasks(duration)})


def one_task(tasks: Tasks, name: TaskName) -> Tasks:
    """One task alone, with the first of its durations.

    Raises:
        InvalidInput: The scenario does not have it.
    """
    task = getattr(tasks, name)
    if task is None:
        raise InvalidInput(f"the scenario has no task '{name}'")
    if isinstance(task, DurationsTask):
        task = DurationsTask(durations=task.durations[:1])
    return Tasks(**{name: task})
