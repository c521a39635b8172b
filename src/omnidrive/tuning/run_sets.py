"""Training and held-out runs of tuning: with different seeds, references and robots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from omnidrive.components import Configured
from omnidrive.errors import InvalidInput, one_line
from omnidrive.scenario import Scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.tasks import Tasks
from omnidrive.study import RunPlan, StudyDefinition, parse_definition
from omnidrive.tuning.balanced import BalancedObjective
from omnidrive.tuning.motions import (
    balanced_motions,
    held_out_motions,
    validation_motions,
    with_track,
)
from omnidrive.tuning.objective import BALANCED, Limit, Objective

TRAINING_REPETITIONS, HELD_OUT_REPETITIONS = 2, 6
"""Repetitions of the sets that :func:`default_sets` returns; a difference needs 6."""

_SEEDS = 2**53
_HELD_OUT_SEED = 2**40  # difference of the seeds of the sets

_TRAINING_ROBOTS = {"mass": (0.9, 1.1), "friction": (0.9, 1.1)}
_HELD_OUT_ROBOTS = {"mass": (1.1, 1.25), "friction": (0.75, 0.9)}
_VALIDATION_ROBOTS = {"mass": (1.25, 1.4), "friction": (0.6, 0.75)}
"""Ranges of robot parameters, relative to the scenario; they do not overlap."""


class RunSets(NamedTuple):
    """The runs that the search sees, and those that measure its gain."""

    training: StudyDefinition
    held_out: StudyDefinition


def default_sets(
    scenario: Scenario, label: str, objectives: Sequence[Objective] = (BalancedObjective(),)
) -> RunSets:
    """Return training and held-out runs of one controller in a scenario.

    Training has the reference and the durations of the task `track`, for the balanced objective
    also a reference of another kind and a step response; without this objective and without such a
    task, the tasks of the scenario that have the metrics of an objective. Its robots have masses
    and frictions that differ by up to 10 % from the scenario.

    The held-out set has other seeds, robots that are 10 to 25 % heavier on a floor with 10 to 25 %
    less friction, and the motions of :func:`held_out_motions`, of which training has none. Wheel
    angles at the start are random where the plant has rollers. Without forces, sensors or noise
    nothing is random, and the sets have one repetition.

    Args:
        scenario: The scenario.
        label: Label of the controller.
        objectives: What is minimised.

    Raises:
        OmnidriveError: The path of the scenario cannot be planned or timed.
    """
    balanced = any(isinstance(each, BalancedObjective) for each in objectives)
    robot = scenario.true_robot
    changes: dict[str, Any] = {
        "tasks": with_track(scenario) if balanced else _tasks(scenario, objectives),
        "controllers": {label: scenario.controllers[label]},
    }
    if scenario.plant.type in {"mujoco-rollers", "planar"}:
        changes["plant_robot"] = robot.model_copy(update={"roller_phase": True})
    base = scenario.model_copy(update=changes)
    other = base.model_copy(update={"seed": (scenario.seed + _HELD_OUT_SEED) % _SEEDS})
    axes = _axes(balanced_motions(base)) if balanced else {}
    motions = held_out_motions(base, scenario.tasks.step, balanced=balanced, noise=_is_random(base))
    return RunSets(
        _definition("training", base, axes, _TRAINING_ROBOTS, TRAINING_REPETITIONS),
        _definition("held-out", other, _axes(motions), _HELD_OUT_ROBOTS, HELD_OUT_REPETITIONS),
    )


def _is_balanced(training: StudyDefinition) -> bool:
    """Return whether a training set has the motions of the balanced objective."""
    labels = [(each.path, each.labels) for each in training.axes]
    return bool(labels) and labels == [("motion", tuple(balanced_motions(training.scenario)))]


def _tasks(scenario: Scenario, objectives: Sequence[Objective]) -> Tasks:
    """Return the task `track` if it has the metrics of an objective; else those that do, or all.

    A task `track` that has none of them is left out, too, if another one has.
    """
    tasks = scenario.tasks
    fit = {
        name: task
        for name in type(tasks).model_fields
        if (task := getattr(tasks, name)) is not None
        and any(each.covers(name) for each in objectives)
    }
    if "track" in fit:
        fit = {"track": fit["track"]}
    return Tasks(**fit) if fit else tasks


def _axes(cases: dict[str, Any]) -> dict[str, Any]:
    return {"motion": {"cases": cases}}


def _is_random(scenario: Scenario) -> bool:
    """Return whether forces, sensors or noise make repetitions differ."""
    forces = scenario.plant_capabilities.forces
    return forces or scenario.sensors is not None or scenario.tasks.noise is not None


def _definition(
    name: str,
    scenario: Scenario,
    axes: dict[str, Any],
    robots: dict[str, tuple[float, float]],
    repetitions: int,
) -> StudyDefinition:
    forces = scenario.plant_capabilities.forces
    data = {
        "format": "omnidrive-study-1",
        "name": name,
        "scenario": scenario_data(scenario),
        "axes": axes,
        "random": {"factors": _factors(robots) if forces else {}},
        "repetitions": repetitions if _is_random(scenario) else 1,
    }
    return parse_definition(data, f"the {name} set")


def _factors(robots: dict[str, tuple[float, float]]) -> dict[str, Any]:
    """Return random factors of the robot, from ranges relative to the scenario."""
    return {
        f"plant_robot.{key}": {"times": {"low": low, "high": high}}
        for key, (low, high) in robots.items()
    }


def validation_set(training: StudyDefinition) -> StudyDefinition:
    """Return the runs on which the best trials are compared: with other seeds and motions.

    The motions are those of :func:`validation_motions`. Instead of
    the robots of :func:`default_sets`, it has some that are 25 to 40 % heavier on a floor with 25
    to 40 % less friction: what gains with both kinds of robots, gains with those in between. A
    training set of a study file with axes keeps them, and its robots.

    Raises:
        OmnidriveError: The motion of the scenario cannot be planned or timed.
    """
    scenario = training.scenario
    seed = (scenario.seed + _VALIDATION_SEED) % _SEEDS
    repetitions = training.repetitions * (_MORE_REPETITIONS if training.repetitions > 1 else 1)
    other = replace(
        training,
        scenario=scenario.model_copy(update={"seed": seed}),
        repetitions=repetitions,
    )
    is_balanced = _is_balanced(training)
    if training.axes and not is_balanced:
        return other
    axes = _axes(validation_motions(scenario, balanced=is_balanced))
    moved = _definition("validation", other.scenario, axes, _VALIDATION_ROBOTS, repetitions)
    usual = _factors(_TRAINING_ROBOTS)
    if {each.path: each.source for each in training.random.factors} == usual:
        return moved
    return replace(moved, random=training.random, repetitions=repetitions)


_VALIDATION_SEED = 2**42
_MORE_REPETITIONS = 3


def with_controllers(
    definition: StudyDefinition, controllers: dict[str, Configured]
) -> StudyDefinition:
    """Return a study with other controllers."""
    scenario = definition.scenario.model_copy(update={"controllers": controllers})
    return replace(definition, scenario=scenario)


def check_apart(sets: RunSets) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` if a held-out run is also a training run."""
    plans = RunPlan(sets.training), RunPlan(sets.held_out)
    training, held_out = (set(plan.keys(0, min(len(plan), _COMPARED))) for plan in plans)
    common = len(training & held_out)
    if common:
        raise InvalidInput(
            f"{common} of the held-out runs are training runs; give the held-out study another "
            "seed, other references or other robots"
        )


_COMPARED = 10_000  # runs of each set


def check_measured(sets: RunSets, objectives: Sequence[Objective], limits: Sequence[Limit]) -> None:
    """Raise InvalidInput if runs lack what is minimised or limited, before any is simulated.

    Every training run has all metrics of an objective or that of a limit, and every objective and
    limit has training runs; every objective has held-out runs.
    """
    for name, definition in zip(("training", "held-out"), sets, strict=True):
        plan = RunPlan(definition)
        tasks = sorted({each.settings.task for each in plan[: min(plan.per_repetition, _COMPARED)]})
        for objective in objectives:
            if not any(map(objective.covers, tasks)):
                raise InvalidInput(_unmeasured(f"the objective {objective.text}", name, tasks))
        if name == "held-out":
            continue
        for limit in limits:
            if not any(map(limit.covers, tasks)):
                raise InvalidInput(_unmeasured(f"the limit {limit.text}", name, tasks))
        served: list[Objective | Limit] = [*objectives, *limits]
        for task in tasks:
            if not any(each.covers(task) for each in served):
                text = " and ".join(each.text for each in objectives)
                raise InvalidInput(_unmeasured(f"the objective {text}", name, [task]))


def _unmeasured(what: str, name: str, tasks: Sequence[str]) -> str:
    """Return the message that runs of tasks lack the metrics of an objective or a limit."""
    known = "settling_time or overshoot_x" if tasks == ["step"] else "me or mae"
    runs = f"the {name} runs of the task{'s' * (len(tasks) > 1)} {' and '.join(tasks)}"
    return (
        f"{one_line(what, 80)} has no value in {runs}; use metrics of one of these tasks, such as "
        f"{known}, the objective {BALANCED}, or --{name} STUDY with other tasks"
    )
