"""Dotted paths into the data of a scenario, such as ``plant_robot.mass`` or ``start.x``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from json import dumps, loads
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from omnidrive.choices import WAYPOINTS
from omnidrive.components import configure, find_component
from omnidrive.components.code import is_code
from omnidrive.components.entry_points import Group
from omnidrive.components.fields import field_names, field_type
from omnidrive.errors import InvalidInput, InvalidStudy, one_line, suggestion
from omnidrive.maps import is_named_map
from omnidrive.planning import Waypoint
from omnidrive.robot import is_robot_file
from omnidrive.scenario.controller_file import files_moved, is_controller_file

Keys = tuple[str | int, ...]
"""Keys of nested dictionaries and indices of lists, from the outermost on."""


class Setting(NamedTuple):
    """A value for one part of the data of a scenario."""

    keys: Keys
    value: Any
    relative: bool = False
    """Whether the value is a factor on the one in the scenario."""
    drawn: bool = False
    """Whether the value is rounded where the scenario has an integer."""


FIXED = ("format", "name")
"""Keys of a scenario that are no settings of its runs."""
_WAYPOINTS = ("start", "goal")
CODE_SECTIONS: dict[str, Group] = {
    "controllers": "controllers", "plant": "plants", "reference": "references",
    "sensors": "estimators",
}  # fmt: skip
"""Groups of the components that are the values of sections of a scenario."""


def find_keys(data: dict[str, Any], path: str, *, addable: bool = False) -> Keys:
    """Return the keys that a dotted path names; labels of controllers may contain dots.

    Items of a list are numbered from 0; x, y and yaw are those of start and goal. Without a section
    ``plant_robot``, its keys are those of ``robot``; parameters of controllers that have the values
    of the preset are not in the data, but have paths.

    Args:
        data: Data of the scenario.
        path: The path.
        addable: Whether ``controllers.LABEL`` may name a new controller.

    Raises:
        InvalidStudy: The scenario has no such key; the message names the most similar path.
    """
    controllers = {k: completed(v, data["preset"]) for k, v in data["controllers"].items()}
    known = {**with_plant_robot(data), "controllers": controllers}
    if known["reference"] == "path":
        known["reference"] = {"type": "path"}
    node: Any = known
    keys: list[str | int] = []
    rest = path
    while True:
        key = _first_key(node, rest, in_waypoint=keys in [[each] for each in _WAYPOINTS])
        if key is None and addable and keys == ["controllers"] and "." not in rest:
            return ("controllers", rest)
        if key is None or (not keys and key in FIXED):
            hint = suggestion(path, _paths(known), maximum=20)
            raise InvalidStudy(f"the scenario has no '{one_line(path, 80)}'{hint}")
        text, found = key, _index(key) if isinstance(node, list) else key
        keys.append(found)
        node = node[found] if not isinstance(found, int) or found < len(node) else None
        if rest == text:
            return tuple(keys)
        rest = rest[len(text) + 1 :]


def with_plant_robot(data: dict[str, Any]) -> dict[str, Any]:
    """Return the data with a section ``plant_robot``: by default that of the robot."""
    return data if data["plant_robot"] is not None else {**data, "plant_robot": data["robot"]}


def completed(controller: dict[str, Any], preset: str) -> dict[str, Any]:
    """Return the data of a controller with all its parameters, in a scenario with ``preset``.

    Those without a value in use are None, or the names of their groups with None in them.
    """
    try:
        name = controller["type"]
        code = find_component("controllers", name, allow_code=False).origin if is_code(name) else ""
        return dict(_completed(dumps(controller), preset, code))
    except (InvalidInput, ValidationError):  # see below
        return dict(controller)


def code_in(path: str, value: Any) -> Iterator[tuple[Group, str]]:
    """Yield group and name of all code in a value for a dotted path of a scenario."""
    head, _, rest = path.partition(".")
    if head not in CODE_SECTIONS:
        return
    if isinstance(value, str):
        if is_code(value) and _names_component(head, rest):
            yield CODE_SECTIONS[head], value
    elif isinstance(value, list):
        for each in value:
            yield from code_in(path, each)
    elif isinstance(value, dict):
        for key in ["type"] if "type" in value else value:
            yield from code_in(f"{path}.{key}", value[key])


def _names_component(section: str, rest: str) -> bool:
    """Return whether a text at a path in a section is the name of a component, no parameter."""
    if section == "controllers":
        return "." not in rest or rest.endswith(".type")
    where = "estimator" if section == "sensors" else ""
    return rest in {where, f"{where}.type".removeprefix(".")}


def allow_named(path: str, value: Any) -> None:
    """Import the code that a user names in a value for a dotted path.

    Raises:
        InvalidInput: It cannot be imported.
    """
    for group, name in code_in(path, value):
        find_component(group, name, allow_code=True)


@lru_cache(maxsize=256)
def _completed(text: str, preset: str, code: str) -> dict[str, Any]:
    """Return the completed data of a controller, whose code is that of an origin.

    Raises:
        InvalidInput: It is an object of a session or code that was not imported, or has a parameter
            of another preset.
        pydantic.ValidationError: A value is invalid.
    """
    name, values = (data := loads(text)).pop("type"), data
    configured = configure("controllers", name, values, allow_code=False).resolved(preset)
    names = _names(configured.component.parameter_class)
    return {"type": name, **_merged(names, configured.values)}


def _names(cls: Any) -> dict[str, Any]:
    """Return the fields of a parameter class with None, or with the fields of their classes."""
    return {each: _names(field_type(cls, each)) or None for each in field_names(cls)}


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    found = {**below, **above}
    for name in below.keys() & above.keys():
        if isinstance(below[name], dict) and isinstance(above[name], dict):
            found[name] = _merged(below[name], above[name])
    return found


def _first_key(node: Any, rest: str, *, in_waypoint: bool) -> str | None:
    """Return the first part of a path that is a key of ``node``; None: there is none."""
    head = rest.partition(".")[0]
    if isinstance(node, dict):
        fitting = [k for k in node if rest == k or rest.startswith(f"{k}.")]
        return max(fitting, key=len, default=None)
    if isinstance(node, list):
        if in_waypoint:
            return head if head in Waypoint._fields else None
        return head if head.isdecimal() and len(head) < 4 and int(head) < len(node) else None
    return None


def _index(key: str) -> int:
    return Waypoint._fields.index(key) if key in Waypoint._fields else int(key)


def _paths(data: Any, prefix: str = "") -> Iterator[str]:
    """Yield every path into the data."""
    for key, value in data.items():
        if not prefix and key in FIXED:
            continue
        yield f"{prefix}{key}"
        if isinstance(value, dict):
            yield from _paths(value, f"{prefix}{key}.")
        elif not prefix and key in _WAYPOINTS and value is not None:
            yield from (f"{key}.{each}" for each in Waypoint._fields)


def value_at(data: Any, keys: Keys) -> Any:
    """Return the value at ``keys``; None if there is none.

    The type of the reference `path`, which is a name without parameters, is `path`.
    """
    for key in keys:
        if isinstance(key, int):
            data = data[key] if data and key < len(data) else None
        elif isinstance(data, str):
            data = data if key == "type" else None
        else:
            data = data.get(key) if data else None
    return data


def with_value(data: Any, keys: Keys, value: Any) -> Any:
    """Return a copy of the data with another value at ``keys``; other parts are shared."""
    if not keys:
        return value
    first, *rest = keys
    if not isinstance(first, int):
        inner = with_value((data or {}).get(first), tuple(rest), value)
        return {**(data or {}), first: inner}
    inner = with_value(value_at(data, (first,)), tuple(rest), value)
    return [*data[:first], inner, *data[first + 1 :]]


def relocated(value: Any, keys: Keys, move: Callable[[str], str]) -> Any:
    """Return the value at ``keys`` of a scenario with other names of its files.

    Args:
        value: Data of a whole scenario (``keys`` is empty) or of a part of it.
        keys: Keys of the value.
        move: Returns the new name of a file.
    """
    head = keys[0] if keys else None
    if not keys:
        return {key: relocated(each, (key,), move) for key, each in value.items()}
    if keys in {("robot",), ("plant_robot",), ("map",), ("reference",)} and isinstance(value, dict):
        name = {"map": "source", "reference": "file"}.get(str(head), "name")
        is_other = head == "reference" and value.get("type") != WAYPOINTS
        if name not in value or is_other:
            return value
        return {**value, name: relocated(value[name], (*keys, name), move)}
    if head == "controllers" and not isinstance(value, str):
        return _relocated_controllers(value, keys, move)
    if isinstance(value, str) and value and _names_file(keys, value):
        return move(value)
    return value


def _relocated_controllers(value: Any, keys: Keys, move: Callable[[str], str]) -> Any:
    """As :func:`relocated`, for all controllers, one, or its fuzzy system."""
    if len(keys) == 1:
        return files_moved(value, move)
    if len(keys) == 2:
        return files_moved({keys[1]: value}, move)[keys[1]]
    if keys[2:] == ("fuzzy",) and isinstance(value, dict) and "file" in value:
        return {**value, "file": relocated(value["file"], (*keys, "file"), move)}
    return value


def _names_file(keys: Keys, value: str) -> bool:
    if keys == ("map", "source"):
        return value != "none" and not is_named_map(value)
    if keys in {("robot", "name"), ("plant_robot", "name")}:
        return is_robot_file(value)
    if len(keys) == 2 and keys[0] == "controllers":
        return is_controller_file(value)
    if keys[0] == "controllers":
        return keys[2:] == ("fuzzy", "file")
    return keys == ("reference", "file")


def beside(file: Path) -> Callable[[str], str]:
    """Return the function that makes names relative to a file relative to the working folder."""
    return lambda name: str(file.parent / name)
