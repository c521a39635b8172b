"""Set-up of a study, as its report states it: what differs from the defaults of a scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from omnidrive.choices import PresetName
from omnidrive.components import Configured
from omnidrive.components.fields import plain
from omnidrive.control.pid.options import FuzzyPidOptions, system_preset
from omnidrive.control.pid.tuners import Kind, gain_system
from omnidrive.errors import one_line
from omnidrive.evaluation.study_logs import ControllerType
from omnidrive.fuzzy import FuzzySystem
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.sections import RobotSection
from omnidrive.study.design.definition import StudyDefinition

_MAX_VALUES = 12  # of an axis
_MAX_TEXT = 300

_KINDS: dict[str, Kind] = {"fuzzy_t1": "t1", "fuzzy_t2": "t2", "fuzzy_t3": "t3"}
"""Kinds of the fuzzy systems of the fuzzy PID controllers, by component."""

_SET_BY = {
    "Robot": ("robot", "name"),
    "Simulated robot": ("plant_robot", "name"),
    "Plant": ("plant",),
    "Reference": ("reference",),
    "Sample time": ("sample_time",),
    "Preset": ("preset",),
}
"""Facts that an axis may set, and the keys of its settings."""

_STATED = {
    "format", "name", "seed", "robot", "plant_robot", "plant", "reference", "sample_time",
    "preset", "controllers", "tasks",
}  # fmt: skip
"""Keys of a scenario with facts of their own."""


def setup_facts(definition: StudyDefinition) -> dict[str, str]:
    """Return the facts about scenario, axes, random factors and repetitions."""
    scenario = definition.scenario
    facts = {
        "Robot": _robot_text(scenario.robot),
        **({"Simulated robot": _robot_text(scenario.plant_robot)} if scenario.plant_robot else {}),
        "Plant": _component_text(scenario.plant),
        "Reference": _reference_text(scenario),
        "Sample time": f"{scenario.sample_time:g} s",
        "Preset": scenario.preset,
        "Tasks": "; ".join(_task_text(*each) for each in scenario.tasks if each[1] is not None),
        "Controllers": "; ".join(
            label if _component_text(each) == label else f"{label}: {_component_text(each)}"
            for label, each in scenario.controllers.items()
        ),
    }
    for name, value in _changes(scenario).items():
        if name not in _STATED:
            facts[name.replace("_", " ").capitalize()] = _text(value)
    set_by_axes = {keys for axis in definition.axes for keys in axis.keys}
    for name, keys in _SET_BY.items():
        if keys in set_by_axes:
            facts.pop(name, None)
    for key, *deeper in set_by_axes:
        if not deeper and key not in _STATED:
            facts.pop(str(key).replace("_", " ").capitalize(), None)
    for axis in definition.axes:
        labels = [f"{v:g}" if isinstance(v, float) else str(v) for v in axis.labels]
        more = f", ... ({len(labels)} values)" if len(labels) > _MAX_VALUES else ""
        facts[f"Axis {axis.name}"] = ", ".join(labels[:_MAX_VALUES]) + more
    for factor in definition.random.factors:
        facts[f"Random {factor.name}"] = one_line(factor.distribution, 200)
    if definition.random.factors:
        facts["Sampling"] = definition.random.method
    for name, conditions in (("Only", definition.where), ("Left out", definition.leave_out)):
        if conditions:
            facts[name] = one_line("; ".join(str(each.source) for each in conditions), 300)
    facts["Repetitions"] = f"{definition.repetitions}, seed {scenario.seed}"
    return facts


def _changes(section: BaseModel) -> dict[str, Any]:
    """Return the keys of a section whose values differ from the defaults, as plain data."""
    found = {}
    for name, each in type(section).model_fields.items():
        value = getattr(section, name)
        if value != each.get_default(call_default_factory=True):
            found[name] = _changes(value) if isinstance(value, BaseModel) else plain(value)
    return found


def _text(value: Any) -> str:
    """Return plain data as in a scenario file, in one line."""
    text = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10**6)
    text = text.removesuffix("...\n").strip()
    return one_line(text[1:-1] if isinstance(value, dict | list) else text, _MAX_TEXT)


def _robot_text(section: RobotSection) -> str:
    changes = {name: value for name, value in _changes(section).items() if name != "name"}
    return f"{section.name} ({_text(changes)})" if changes else section.name


def _task_text(name: str, task: BaseModel) -> str:
    changes = _changes(task)
    return f"{name} ({_text(changes)})" if changes else name


def _reference_text(scenario: Scenario) -> str:
    if scenario.reference != "path":
        return _component_text(scenario.reference)
    return f"planned path on the map {one_line(Path(scenario.map.source).name, 60)}"


def _component_text(configured: Configured) -> str:
    """Return type and changed parameters of a component."""
    changes = _changes_text(configured)
    return one_line(f"{configured.type} ({changes})" if changes else configured.type, 200)


def _changes_text(configured: Configured) -> str:
    """Return the changed parameters, without the text of a fuzzy file, whose name is there."""
    return ", ".join(
        f"{name} = {one_line(str(value), _MAX_TEXT)}"
        for name, value in configured.changes.items()
        if name != "fuzzy.file.content"
    )


def controller_types(scenario: Scenario) -> dict[str, ControllerType]:
    """Return type, description and changed parameters of each controller, by its label."""
    return {
        label: ControllerType(
            each.type,
            each.component.summary,
            _changes_text(each),
            _gain_tuning_system(each, scenario.preset),
        )
        for label, each in scenario.controllers.items()
    }


def _gain_tuning_system(controller: Configured, preset: PresetName) -> FuzzySystem | None:
    """Return the system of a fuzzy PID controller of this package; None for one in a file."""
    kind, options = _KINDS.get(controller.type), controller.parameters
    if kind is None or not isinstance(options, FuzzyPidOptions) or options.fuzzy.file is not None:
        return None
    return gain_system(kind, system_preset(options.preset or preset), options.fuzzy)
