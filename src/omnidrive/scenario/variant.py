"""Variants of a scenario: the same with other values of some settings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from omnidrive.components.code import CodePermission
from omnidrive.components.configured import ALLOW_CODE
from omnidrive.components.fields import plain
from omnidrive.errors import InvalidStudy
from omnidrive.robot import Robot
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_path import (
    Setting,
    completed,
    value_at,
    with_plant_robot,
    with_value,
)
from omnidrive.scenario.sections import RobotSection, robot_of

_ROBOTS = ("robot", "plant_robot")


def variant_data(data: dict[str, Any], settings: Sequence[Setting]) -> dict[str, Any]:
    """Return the data of a scenario with other settings; unchanged sections are shared.

    If the scenario has no section ``plant_robot`` but a setting in it, it begins with the values of
    the robot. With another type, a component has the defaults of its parameters.

    Raises:
        InvalidStudy: There is no number that a relative value can multiply.
    """
    for setting in sorted(settings, key=_order):
        if setting.keys[0] == "plant_robot" and len(setting.keys) > 1:
            data = with_plant_robot(data)
        value = setting.value
        if setting.relative or setting.drawn:
            old = _number_at(data, setting)
            value = _like(old, _product(old, value) if setting.relative else value)
        is_type = setting.keys[-1] == "type"
        if is_type and value != value_at(data, setting.keys):
            component = value if value == "path" else {"type": value}
            data = with_value(data, setting.keys[:-1], component)
        elif not is_type:
            data = with_value(data, setting.keys, value)
    return data


def _order(setting: Setting) -> tuple[bool, ...]:
    """Return the sort key: first types of components, without which parameters have no meaning.

    Last what depends on other settings: relative values, and the robot that the plant simulates.
    """
    return setting.keys[-1] != "type", setting.keys[0] == "plant_robot", setting.relative


def _number_at(data: dict[str, Any], setting: Setting) -> Any:
    """Return the value in use at the keys of a setting: that of the robot or preset by default."""
    keys = setting.keys
    value = value_at(data, keys)
    if value is None and keys[0] in _ROBOTS and len(keys) == 2:
        value = plain(getattr(robot_in(data[keys[0]]), str(keys[1])))
    if value is None and keys[0] == "controllers" and len(keys) > 2:
        controller = completed(data["controllers"][keys[1]], data["preset"])
        value = value_at(controller, keys[2:])
    if setting.relative and not _is_numeric(value):
        path = ".".join(map(str, keys))
        raise InvalidStudy(f"{path} has no number in the scenario to multiply; give its values")
    return value


def _is_numeric(value: Any) -> bool:
    each = value if isinstance(value, list) and value else [value]
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in each)


def _product(old: Any, factor: Any) -> Any:
    if isinstance(old, list):
        factors = factor if isinstance(factor, list) else [factor] * len(old)
        return [a * b for a, b in zip(old, factors, strict=False)]
    return old * factor


def _like(old: Any, value: Any) -> Any:
    """Return a drawn number, rounded if the scenario has an integer."""
    if isinstance(old, int) and not isinstance(old, bool) and isinstance(value, float):
        return round(value)
    return value


def variant_of(
    scenario: Scenario,
    data: dict[str, Any],
    changed: Sequence[str],
    *,
    allow_code: bool | CodePermission,
) -> Scenario:
    """Return the scenario with the sections ``changed`` of ``data``, which are checked.

    Raises:
        pydantic.ValidationError: A value is invalid.
    """
    sections = {**dict(scenario), **{name: data[name] for name in changed}}
    return Scenario.model_validate(sections, context={ALLOW_CODE: allow_code})


def changed_sections(settings: Sequence[Setting]) -> list[str]:
    """Return the sections of the scenario that settings change."""
    return list(dict.fromkeys(str(each.keys[0]) for each in settings))


def robot_in(section: dict[str, Any]) -> Robot:
    """Return the robot of the data of a section.

    Raises:
        InvalidInput: See :func:`robot_of`.
    """
    return robot_of(RobotSection(**section))
