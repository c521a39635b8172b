"""Dotted paths into the data of a scenario, such as ``plant_robot.mass`` or ``start.x``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from omnidrive.choices import WAYPOINTS
from omnidrive.errors import InvalidStudy, one_line, suggestion
from omnidrive.maps import is_named_map
from omnidrive.planning import Waypoint
from omnidrive.robot import is_robot_file
from omnidrive.study.controller_file import files_moved, is_controller_file

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


def find_keys(data: dict[str, Any], path: str) -> Keys:
    """Return the keys that a dotted path names; labels of controllers may contain dots.

    Items of a list are numbered from 0; x, y and yaw are those of start and goal. Without a section
    ``plant_robot``, its keys are those of ``robot``.

    Raises:
        InvalidStudy: The scenario has no such key; the message names the most similar path.
    """
    known = with_plant_robot(data)
    node: Any = known
    keys: list[str | int] = []
    rest = path
    while rest:
        key = _first_key(node, rest, in_waypoint=keys in [[each] for each in _WAYPOINTS])
        if key is None or (not keys and key in FIXED):
            hint = suggestion(path, _paths(known), most=20)
            raise InvalidStudy(f"the scenario has no '{one_line(path, 80)}'{hint}")
        text, found = key, _index(key) if isinstance(node, list) else key
        keys.append(found)
        node = node[found] if not isinstance(found, int) or found < len(node) else None
        rest = rest[len(text) + 1 :]
    return tuple(keys)


def with_plant_robot(data: dict[str, Any]) -> dict[str, Any]:
    """Return the data with a section ``plant_robot``: by default that of the robot."""
    return data if data["plant_robot"] is not None else {**data, "plant_robot": data["robot"]}


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
    """Return the value at ``keys``; None at the end of a list."""
    for key in keys:
        if isinstance(key, int) and key >= len(data):
            return None
        data = data[key]
    return data


def with_value(data: Any, keys: Keys, value: Any) -> Any:
    """Return a copy of the data with another value at ``keys``; other parts are shared."""
    if not keys:
        return value
    first, *rest = keys
    if isinstance(data, dict):
        return {**data, first: with_value(data[first], tuple(rest), value)}
    assert isinstance(first, int)
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
    if keys == ("controllers",):
        return files_moved(value, move)
    if isinstance(value, str) and value and _names_file(keys, value):
        return move(value)
    return value


def _names_file(keys: Keys, value: str) -> bool:
    if keys == ("map", "source"):
        return value != "none" and not is_named_map(value)
    if keys in {("robot", "name"), ("plant_robot", "name")}:
        return is_robot_file(value)
    if len(keys) == 2 and keys[0] == "controllers":
        return is_controller_file(value)
    return keys == ("reference", "file")


def beside(file: Path) -> Callable[[str], str]:
    """Return the function that makes names relative to a file relative to the working folder."""
    return lambda name: str(file.parent / name)


def file_names(data: dict[str, Any]) -> Sequence[str]:
    """Return the files that the data of a scenario name."""
    found: list[str] = []

    def note(name: str) -> str:
        found.append(name)
        return name

    relocated(data, (), note)
    return found
