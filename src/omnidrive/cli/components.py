"""Controllers, plants and references that are named in options, as data of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, get_args

from omnidrive import components
from omnidrive import scenario as scenarios
from omnidrive.choices import WAYPOINTS, TaskName
from omnidrive.cli.completion import component
from omnidrive.cli.options import RUN_PANEL, choose_one, option
from omnidrive.components.entry_points import Group, noun
from omnidrive.errors import InvalidInput
from omnidrive.study.output_paths import WAYPOINT_FORMATS

_FORM = "[LABEL=]NAME[,KEY=VALUE...]"
_HELP = (
    "with values of its parameters: its label in the scenario, its name (`omnidrive list "
    "controllers`), a file of `omnidrive tune` (.yaml), or your own as FILE.py:NAME."
)
_NAMES = component("controllers")
ControllerOption = Annotated[str, option(_FORM, f"Controller, {_HELP}", RUN_PANEL, complete=_NAMES)]
ControllersOption = Annotated[
    list[str] | None,
    option(_FORM, f"Only this controller (repeatable), {_HELP}", RUN_PANEL, complete=_NAMES),
]

RUN_TASKS = tuple(name for name in get_args(TaskName) if name != "horizon")
"""Tasks with runs of single controllers."""


def with_controllers(
    scenario: scenarios.Scenario, texts: Sequence[str], *, allow_code: bool = False
) -> scenarios.Scenario:
    """Return the scenario with these controllers only.

    Args:
        scenario: The scenario.
        texts: Each ``[LABEL=]TYPE[,KEY=VALUE...]``. The type is a label of the scenario, whose
            parameters apply unless another value is given, the name of a component, or a controller
            file.
        allow_code: Whether code may be imported that a controller file names.

    Raises:
        InvalidInput: A controller does not exist, a value is invalid, or two labels are alike.
    """
    from omnidrive.components.code import CodePermission
    from omnidrive.scenario.controller_file import (
        is_controller_file,
        label_of_file,
        permitted_controller,
    )
    from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
    from omnidrive.scenario.scenario_path import allow_named

    controllers: dict[str, Any] = {}
    own = scenario_data(scenario)["controllers"]
    for text in texts:
        given = components.parse_specification(text)
        if is_controller_file(given.type):
            found = permitted_controller(given.type, CodePermission.of(allow_code))
            label = label_of_file(given.type) if given.label == given.type else given.label
            given = components.Specification(label, given.type, given.values)
        else:
            found = {"type": given.type}
            allow_named("controllers", found)
        if given.label.lower() in map(str.lower, controllers):
            raise InvalidInput(
                f"two controllers are labelled '{given.label}'; name one of them, such as "
                f"other={given.type}"
            )
        base = own.get(given.type, found)
        controllers[given.label] = _merged(base, given.values)
    data = scenario_data(scenario) | {"controllers": controllers}
    return parse_scenario(data, "with these options")


def one_run(
    scenario: scenarios.Scenario,
    controller: str,
    task: str,
    horizon: int | None,
    *,
    allow_code: bool = False,
) -> scenarios.Scenario:
    """Return the scenario with one controller and the first duration of one task.

    Args:
        scenario: The scenario.
        controller: The controller, as for :func:`with_controllers`.
        task: Task with runs of single controllers.
        horizon: Prediction horizon of the controller, in steps; None: its own.
        allow_code: As for :func:`with_controllers`.

    Raises:
        InvalidInput: There is no such controller or task, or the controller has no horizon.
    """
    scenario = with_controllers(scenario, [controller], allow_code=allow_code)
    chosen = choose_one("task", task, RUN_TASKS)
    if horizon is not None:
        (label,) = scenario.controllers
        if label not in scenario.predictive:
            raise InvalidInput(
                f"--horizon applies to controllers with the parameter horizon, not to {label}"
            )
        scenario = with_controllers(scenario, [f"{label},horizon={horizon}"], allow_code=allow_code)
    tasks = scenarios.one_task(scenarios.with_task(scenario, [chosen]).tasks, chosen)
    return scenario.model_copy(update={"tasks": tasks})


def plant_data(text: str, present: components.Configured) -> dict[str, Any]:
    """Return the value of the scenario key ``plant`` for ``TYPE[,KEY=VALUE...]``.

    Args:
        text: The option.
        present: Plant of the scenario, whose parameters apply to a plant of the same type unless
            another value is given.
    """
    given = components.parse_specification(text)
    same = given.type == present.type
    return _merged(present.plain() if same else {"type": given.type}, given.values)


def reference_data(text: str) -> Any:
    """Return the value of the scenario key ``reference`` for an option.

    Args:
        text: ``path``, ``TYPE[,KEY=VALUE...]``, or the name of a waypoint file.

    Raises:
        InvalidInput: The text has another form.
    """
    if Path(text).suffix.lower() in WAYPOINT_FORMATS and "=" not in text:
        return {"type": WAYPOINTS, "file": text}
    given = components.parse_specification(text)
    if "=" in text.split(",", maxsplit=1)[0]:
        raise InvalidInput(f"a reference has no label: write {given.type} instead of '{text}'")
    return {"type": given.type, **given.values}


def chosen_component(group: Group, text: str) -> components.Configured:
    """Return the component that ``NAME[,KEY=VALUE...]`` names, with its parameters.

    Raises:
        InvalidInput: The text has another form, there is no such component, or a parameter is
            unknown, missing or invalid.
    """
    from pydantic import ValidationError

    from omnidrive.scenario.scenario_file import listed, problems_of

    given = components.parse_specification(text)
    kind = noun(group)
    if "=" in text.split(",", maxsplit=1)[0]:
        raise InvalidInput(f"a {kind} has no label: write {given.type} instead of '{text}'")
    try:
        return components.configure(group, given.type, given.values)
    except ValidationError as error:
        raise InvalidInput(f"the {kind} {given.type}: {listed(problems_of(error))}") from None


def _merged(base: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """Return nested ``values`` on top of ``base``."""
    result = dict(base)
    for key, value in values.items():
        inner = result.get(key)
        if isinstance(value, dict) and isinstance(inner, dict):
            result[key] = _merged(inner, value)
        else:
            result[key] = value
    return result
