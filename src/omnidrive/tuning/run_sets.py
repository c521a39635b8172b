"""Training and held-out runs of tuning: with different seeds, references and robots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from omnidrive.components import Configured
from omnidrive.errors import InvalidInput
from omnidrive.scenario import Scenario, plan_at, retime
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.study import RunPlan, StudyDefinition, parse_definition

TRAINING_REPETITIONS, HELD_OUT_REPETITIONS = 2, 12
"""Repetitions of the sets that :func:`default_sets` returns; a difference needs 6."""

_SHAPES = ("circle", "eight", "square")
"""References to which the reference of training does not belong are held out."""

_SLOWER = 1.2
"""Factor of the durations of a planned path on the held-out set."""

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


def default_sets(scenario: Scenario, label: str) -> RunSets:
    """Return training and held-out runs of one controller in a scenario.

    Training has the reference and the durations of the task `track` (of all tasks, if there is no
    such task), and robots whose mass and friction differ by up to 10 % from the scenario. The
    held-out set has other seeds, robots that are 10 to 25 % heavier on a floor with 10 to 25 % less
    friction, and other references: a planned path is driven there in 1.2 times the duration, both
    ways; for other references it has those of circle, eight and square that training does not have.
    Wheel angles at the start are random where the plant has rollers. Without forces, sensors or
    noise nothing is random, and the sets have one repetition.

    Args:
        scenario: The scenario.
        label: Label of the controller.

    Raises:
        OmnidriveError: The path of the scenario cannot be planned or timed.
    """
    tasks = scenario.tasks
    if tasks.track is not None:
        tasks = type(tasks)(track=tasks.track)
    robot = scenario.true_robot
    changes: dict[str, Any] = {
        "tasks": tasks,
        "controllers": {label: scenario.controllers[label]},
    }
    if scenario.plant.type in {"mujoco-rollers", "planar"}:
        changes["plant_robot"] = robot.model_copy(update={"roller_phase": True})
    base = scenario.model_copy(update=changes)
    other = base.model_copy(update={"seed": (scenario.seed + _HELD_OUT_SEED) % _SEEDS})
    return RunSets(
        _definition("training", base, {}, _TRAINING_ROBOTS, TRAINING_REPETITIONS),
        _definition("held-out", other, _references(base), _HELD_OUT_ROBOTS, HELD_OUT_REPETITIONS),
    )


def _definition(
    name: str,
    scenario: Scenario,
    axes: dict[str, Any],
    robots: dict[str, tuple[float, float]],
    repetitions: int,
) -> StudyDefinition:
    forces = scenario.plant_capabilities.forces
    is_random = forces or scenario.sensors is not None or scenario.tasks.noise is not None
    data = {
        "format": "omnidrive-study-1",
        "name": name,
        "scenario": scenario_data(scenario),
        "axes": axes,
        "random": {"factors": _factors(robots) if forces else {}},
        "repetitions": repetitions if is_random else 1,
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

    A planned path is driven there in 1.1 and 1.5 times the duration; other references are the
    slalom, the raised cosine and that of training in 1.5 times the duration and as quickly as the
    limits of the robot allow, because held-out references may come near these limits. Instead of
    the robots of :func:`default_sets`, it has some that are 25 to 40 % heavier on a floor with 25
    to 40 % less friction: what gains with both kinds of robots, gains with those in between. A
    training set with axes of its own keeps them, and its robots.

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
    if training.axes:
        return other
    slow = _durations(scenario, 1.5)
    if scenario.reference == "path":
        cases = {"slower": _durations(scenario, 1.1), "slow": slow}
    else:
        shapes = _shape_cases(scenario, ("slalom", "raised-cosine"))
        cases = {"slow": slow, **_quick_case(scenario, slow), **shapes}
    axes = {"motion": {"cases": cases}}
    moved = _definition("validation", other.scenario, axes, _VALIDATION_ROBOTS, repetitions)
    usual = _factors(_TRAINING_ROBOTS)
    if {each.path: each.source for each in training.random.factors} == usual:
        return moved
    return replace(moved, random=training.random, repetitions=repetitions)


_VALIDATION_SEED = 2**42
_MORE_REPETITIONS = 3


def _references(scenario: Scenario) -> dict[str, Any]:
    """Return the axis of the references of the held-out set."""
    cases: dict[str, Any]
    if scenario.reference == "path":
        slower = _durations(scenario, _SLOWER)
        assert scenario.start is not None
        assert scenario.goal is not None
        back = {"start": [*scenario.goal[:2], None], "goal": [*scenario.start[:2], None]}
        cases = {"slower": slower, "back": {**back, **slower}}
    else:
        cases = _shape_cases(scenario, _SHAPES)
    return {"motion": {"cases": cases}}


def _shape_cases(scenario: Scenario, shapes: Sequence[str]) -> dict[str, Any]:
    """Return the cases of references other than that of the scenario, on an open floor."""
    cases = {}
    for shape in shapes:
        if scenario.reference == "path" or shape != scenario.reference.type:
            shaped = scenario.with_values(reference={"type": shape}, start=None, map=_NO_MAP)
            cases[shape] = {
                "reference": {"type": shape},
                "map": _NO_MAP,
                "start": None,
                **_durations(retime(shaped), 1.0),
            }
    return cases


def _quick_case(scenario: Scenario, slow: dict[str, Any]) -> dict[str, Any]:
    """Return the case of the shortest durations.

    There is none for a motion with times of its own, or if it is the slow case, as without tasks
    along the motion.
    """
    planned = plan_at(scenario)
    quick = _durations(planned.scenario, 1.0)
    return {} if planned.natural is not None or quick == slow else {"quick": quick}


_NO_MAP = {"source": "none"}


def _durations(scenario: Scenario, factor: float) -> dict[str, Any]:
    """Return the settings of the durations of the path, times a factor."""
    found: dict[str, Any] = {}
    for name in ("track", "noise"):
        task = getattr(scenario.tasks, name)
        if task is not None:
            durations = [round(factor * each, 6) for each in task.durations]
            found[f"tasks.{name}.durations"] = durations
    return found


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
