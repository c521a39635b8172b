"""Motions of tuning: references of several kinds and steps, for training, choice and proof."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any

from omnidrive.geometry import wrap
from omnidrive.scenario import Scenario, plan_at, retime
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.tasks import DurationsTask, StepTask, Tasks

Cases = dict[str, dict[str, Any]]
"""Settings of a scenario by the label of the motion."""

_OPEN = {"map": {"source": "none"}, "start": None}
"""Settings of the open floor on which other motions begin at the origin."""

_STEP = StepTask(displacement=(1.0, 1.0, 0.25 * pi), duration=10.0)
"""Step of scenarios without the task `step`, that of the paper."""

_SLOWER = 1.2
"""Factor of the durations of a planned path on the held-out set."""

_HELD_OUT_REFERENCES = 7
"""Smallest number of held-out references; an interval over them needs 6."""

_QUICK = 1.25
"""Duration of quick motions over the shortest one within the limits."""

_EXTENTS = (4.0, 2.0, 6.0, 3.0, 5.0, 2.5, 3.5)  # m; of the random motions
_FIRST_SEED = 100  # of the random motions; the default of a scenario is 1


def with_track(scenario: Scenario) -> Tasks:
    """Return the task `track` of a scenario, or one at the default speed, and its step response."""
    durations = scenario.tasks.path_durations
    track = scenario.tasks.track or (DurationsTask(durations=durations) if durations else None)
    if track is None:
        scaled = scenario.with_values(tasks={"track": {"durations": [10.0]}}, faults=())
        track = retime(scaled).tasks.track
    return Tasks(track=track, step=scenario.tasks.step)


def balanced_motions(scenario: Scenario) -> Cases:
    """Return the training motions of the balanced objective.

    The reference of the scenario; one of another kind: a square, whose corners are harder than
    smooth references, or an eight where the scenario has a square; and two steps, because a large
    one saturates the wheels and a small one does not.

    Args:
        scenario: The scenario with the tasks of :func:`with_track`.
    """
    other = _other_kind(scenario)
    return {
        _kind(scenario): _durations(scenario, 1.0),
        other: _tracking(scenario, {"type": other}),
        "step": _step(scenario, scenario.tasks.step),
        "small step": _step(scenario, scenario.tasks.step, (0.5, -0.5, 0.5)),
    }


def validation_motions(scenario: Scenario, *, balanced: bool) -> Cases:
    """Return the motions on which the best trials are compared.

    A planned path is driven in 1.1 and 1.5 times the duration; another reference in 1.5 times the
    duration and as quickly as the limits of the robot allow, because held-out references may come
    near these limits, and with it are the slalom and the raised cosine. The balanced objective also
    has the slalom and another step, which is all where no task follows the reference.
    """
    another_step = _step(scenario, scenario.tasks.step, (-0.8, 0.6, 0.7))
    if not scenario.tasks.path_durations:
        return {"step": another_step}
    slow = _durations(scenario, 1.5)
    cases: Cases = {"slow": slow}
    shapes: Sequence[str] = ("slalom", "raised-cosine")
    if scenario.reference == "path":
        cases = {"slower": _durations(scenario, 1.1), "slow": slow}
        shapes = ("slalom",) if balanced else ()
    else:
        planned = plan_at(scenario)
        quick = _durations(planned.scenario, 1.0)
        if planned.natural is None and quick != slow:
            cases["quick"] = quick
    cases |= {
        each: _tracking(scenario, {"type": each}) for each in shapes if each != _kind(scenario)
    }
    if balanced:
        cases["step"] = another_step
    return cases


def held_out_motions(
    scenario: Scenario, step: StepTask | None, *, balanced: bool, noise: bool
) -> Cases:
    """Return the motions on which the gain is measured, of which training has none.

    A planned path in 1.2 times the duration, both ways; those of circle, eight and square that
    training does not have; random smooth motions of several seeds, every other one quick, and one
    of them with measurement noise; and two steps: a smaller one backwards, and one with other
    ratios.

    Args:
        scenario: The scenario of training.
        step: Step of which the others are multiples; None: that of the paper.
        balanced: Whether training has the motions of :func:`balanced_motions`.
        noise: Whether one motion has measurement noise.
    """
    cases: Cases = {}
    if scenario.reference == "path":
        slower = _durations(scenario, _SLOWER)
        assert scenario.start is not None
        assert scenario.goal is not None
        back = {"start": [*scenario.goal[:2], None], "goal": [*scenario.start[:2], None]}
        cases = {"slower": slower, "back": {**back, **slower}}
    trained = {_kind(scenario), *([_other_kind(scenario)] if balanced else [])}
    shapes = [each for each in ("circle", "eight", "square") if each not in trained]
    cases |= {each: _tracking(scenario, {"type": each}) for each in shapes}
    count = max(2, _HELD_OUT_REFERENCES - len(cases))
    for k, extent in enumerate(_EXTENTS[:count], 1):
        cases[f"random {k}"] = _tracking(scenario, _random(k, extent), quick=k % 2 == 0)
    if noise and scenario.sensors is None:
        noisy = _tracking(scenario, _random(0, _EXTENTS[0]))
        cases["random, noise"] = {**noisy, "tasks": {"noise": noisy["tasks"]["track"]}}
    return {
        **cases,
        "step back": _step(scenario, step, (-0.4, -0.4, -0.4)),
        "step aside": _step(scenario, step, (-0.7, 0.7, 1.3)),
    }


def _random(number: int, extent: float) -> dict[str, Any]:
    return {"type": "random-smooth", "seed": _FIRST_SEED + number, "extent": extent}


def _kind(scenario: Scenario) -> str:
    return "path" if scenario.reference == "path" else scenario.reference.type


def _other_kind(scenario: Scenario) -> str:
    """Return the shape of the second training reference: with corners, or a smooth one."""
    return "eight" if _kind(scenario) == "square" else "square"


def _tracking(
    scenario: Scenario, reference: dict[str, Any], *, quick: bool = False
) -> dict[str, Any]:
    """Return the settings of a reference at the default speed or, quick, near the limits."""
    tasks = {"track": {"durations": [10.0]}}
    shaped = scenario.with_values(reference=reference, tasks=tasks, faults=(), **_OPEN)
    timed = plan_at(shaped).scenario if quick else retime(shaped)
    seconds = round((_QUICK if quick else 1.0) * timed.tasks.shortest, 6)
    tasks = {"track": {"durations": [seconds]}}
    return {"reference": reference, **_OPEN, **_faults(scenario, seconds), "tasks": tasks}


def _step(
    scenario: Scenario, task: StepTask | None, factors: Sequence[float] = (1.0, 1.0, 1.0)
) -> dict[str, Any]:
    """Return the settings of the step response of a task times factors, on an open floor."""
    task = task or _STEP
    x, y, heading = (a * b for a, b in zip(task.displacement, factors, strict=True))
    step = {"displacement": [x, y, float(wrap(heading))], "duration": task.duration}
    tasks = {"tasks": {"step": step}}
    return {"reference": {"type": "circle"}, **_OPEN, **_faults(scenario, task.duration), **tasks}


def _faults(scenario: Scenario, seconds: float) -> dict[str, Any]:
    """Return the setting of the faults that begin before a run of this length ends."""
    given = scenario_data(scenario)["faults"]
    kept = [each for each in given if each["at"] < seconds]
    return {} if len(kept) == len(given) else {"faults": kept}


def _durations(scenario: Scenario, factor: float) -> dict[str, Any]:
    """Return the settings of the durations of the path, times a factor, without a step."""
    if not scenario.tasks.path_durations:
        return {}
    tasks = {k: v for k, v in scenario_data(scenario)["tasks"].items() if v and k != "step"}
    for name in ("track", "noise"):
        if name in tasks:
            durations = [round(factor * each, 6) for each in tasks[name]["durations"]]
            tasks[name] = {**tasks[name], "durations": durations}
    return {"tasks": tasks}
