"""Scenario files in YAML."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from omnidrive.choices import WAYPOINTS
from omnidrive.components.code import CodePermission
from omnidrive.components.configured import ALLOW_CODE
from omnidrive.components.fields import field_names, field_type, plain
from omnidrive.errors import InvalidScenario, one_line, short_repr, suggestion
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.robot import is_robot_file
from omnidrive.robot.robot_file import FORMAT as ROBOT_FORMAT
from omnidrive.scenario.controller_file import files_moved
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation.disturbances import FAULTS

_KEY = re.compile(r"(?!function-)[\w.+-]+")
_MISSING = "'{key}' is missing"
_NOT_A_NUMBER = "{key} must be a plain number without a unit, got {value}"
_UNKNOWN_FAULT = f"{{key}}: unknown kind of fault; there are {', '.join(FAULTS)}"
_MESSAGES = {
    **dict.fromkeys(("missing", "missing_argument"), _MISSING),
    **dict.fromkeys(("float_parsing", "float_type", "int_parsing", "int_type"), _NOT_A_NUMBER),
    **dict.fromkeys(("union_tag_invalid", "union_tag_not_found"), _UNKNOWN_FAULT),
}
"""Messages by pydantic's type of the error."""


def load_scenario(path: StrPath, *, allow_code: bool | CodePermission = False) -> Scenario:
    """Read a scenario file; paths of its files become relative to the working directory.

    Args:
        path: The file.
        allow_code: Whether components may be code that is not installed, such as
            ``mine.py:MyController``, which is imported. Only for files that you trust.

    Raises:
        InvalidScenario: The file is missing or malformed, or a value is invalid; the message names
            up to ten invalid keys.
    """
    path = to_path(path)
    data, name = read_yaml(path, "scenario", InvalidScenario), one_line(str(path))
    if not isinstance(data, dict):
        raise InvalidScenario(f"{name} is not a scenario: it contains no keys")
    if data.get("format") == ROBOT_FORMAT:
        raise InvalidScenario(f"{name} is a robot file; use --robot {name}")
    if str(data.get("format")).startswith("omnidrive-study-"):
        raise InvalidScenario(f"{name} is a study file; use omnidrive study {name}")
    if "controllers" in data:
        moved = files_moved(data["controllers"], lambda each: str(path.parent / each))
        data = {**data, "controllers": moved}
    scenario = parse_scenario(data, name, allow_code=allow_code)
    changes: dict[str, object] = {}
    for key, robot in (("robot", scenario.robot), ("plant_robot", scenario.plant_robot)):
        if robot is not None and is_robot_file(robot.name):
            file = _relative_to(path, robot.name, f"{key}.name")
            changes[key] = robot.model_copy(update={"name": file})
    if scenario.map.is_file:
        source = _relative_to(path, scenario.map.source, "map.source")
        changes["map"] = scenario.map.model_copy(update={"source": source})
    if scenario.costs is not None:
        files = {key: getattr(scenario.costs, key) for key in ("keepout", "speed", "costs")}
        moved = {k: _relative_to(path, f, f"costs.{k}") for k, f in files.items() if f is not None}
        changes["costs"] = scenario.costs.model_copy(update=moved)
    reference = scenario.reference
    if reference != "path" and reference.type == WAYPOINTS:
        file = _relative_to(path, reference.values["file"], "reference.file")
        changes["reference"] = reference.with_values(file=file)
    return scenario.model_copy(update=changes)


def _relative_to(scenario: Path, name: str, key: str) -> str:
    """Return the path of a file that a scenario file names, as the value of ``key``."""
    if not name or "\0" in name:
        place = one_line(str(scenario))
        raise InvalidScenario(f"{place}: {key} must name a file, got {short_repr(name)}")
    return str(scenario.parent / name)


def save_scenario(scenario: Scenario, path: StrPath) -> None:
    """Write a scenario file that :func:`load_scenario` can read.

    Raises:
        CannotWrite: The file cannot be written.
    """
    text = yaml.safe_dump(scenario_data(scenario), sort_keys=False)
    with output_file(to_path(path)) as part:
        part.write_text(text, encoding="utf-8")


def scenario_data(scenario: Scenario) -> dict[str, Any]:
    """Return the scenario as dictionaries, lists, numbers and strings."""
    data: dict[str, Any] = plain(scenario)
    return data


def parse_scenario(
    data: dict[Any, Any], where: str, *, allow_code: bool | CodePermission = False
) -> Scenario:
    """Validate ``data`` and return the scenario.

    Args:
        data: Content of a scenario file.
        where: Source of the data, for messages.
        allow_code: See :func:`load_scenario`.

    Raises:
        InvalidScenario: A key or value is invalid; the message names the first ten.
    """
    try:
        return Scenario.model_validate(data, context={ALLOW_CODE: allow_code})
    except ValidationError as error:
        raise InvalidScenario(f"{where}: {listed(problems_of(error))}") from None


def problems_of(error: ValidationError, model: type = Scenario) -> list[str]:
    """Return a message for each invalid key and value: the key, the cause and the valid values.

    Args:
        error: Error of pydantic.
        model: The class that was validated.
    """
    problems = [p for p in error.errors() if p["type"] != "too_short"] or error.errors()
    return list(dict.fromkeys(_explain(each, model) for each in problems))


def listed(facts: Sequence[str]) -> str:
    """Return messages in one line, the first ten and the number of the others."""
    rest = f"; and {len(facts) - _LISTED} more" if len(facts) > _LISTED else ""
    return "; ".join(facts[:_LISTED]) + rest


_LISTED = 10
"""Number of invalid keys and values that one message names."""

_SENTENCES = ("there is ", "there are ", "the ", "cannot read ")
"""First words of messages that are sentences; others go on from the key, such as `is -1 m`."""


def _explain(problem: Any, model: type) -> str:
    """Return the message for one error: the key, the cause and the valid values."""
    kind, value = problem["type"], problem.get("input")
    if kind in {"extra_forbidden", "unexpected_keyword_argument", "invalid_key"}:
        *outer, name = problem["loc"]  # the name is that in the file, not always an identifier
        keys = _fields(outer)
        if kind == "invalid_key":  # not a string; pydantic reports true as 1
            return f"unknown key {short_repr(value)}" + _within(keys) + _suggestion("", keys, model)
        key = ".".join([*map(str, keys), one_line(str(name), 60)])
        return f"unknown key '{key}'" + _suggestion(str(name), keys, model)
    key = ".".join(map(str, _fields(problem["loc"])))
    if kind in _MESSAGES:
        return _MESSAGES[kind].format(key=key, value=short_repr(value))
    if kind in {"model_type", "dataclass_type"}:
        names = field_names(_model_at(_fields(problem["loc"]), model))
        first = f", such as {names[0]}: ..." if names else ""
        if key.endswith(".fuzzy") and isinstance(value, str):
            first = f", such as fuzzy.file={one_line(value, 60)} for the system in a file"
        return f"{key or 'it'} must hold keys{first}; got {short_repr(value)}"
    message = problem["msg"].removeprefix("Value error, ")
    if kind in {"value_error", "component"}:
        colon = ":" if key and message.startswith(_SENTENCES) else ""
        return f"{key}{colon} {message}".lstrip()
    return f"{key or 'a key'}: {message[0].lower()}{message[1:]}, got {short_repr(value)}"


def _fields(loc: Iterable[Any]) -> list[Any]:
    """Return the keys in ``loc``, without additions such as `function-after[check(), float]`."""
    return [part for part in loc if isinstance(part, int) or _KEY.fullmatch(part)]


def _within(keys: list[Any]) -> str:
    return f" in '{'.'.join(map(str, keys))}'" if keys else ""


def _suggestion(name: str, loc: list[Any], model: Any) -> str:
    """Return a suggestion of the closest valid key at ``loc`` of a model, or of all."""
    keys = field_names(_model_at(loc, model))
    return suggestion(name, keys, maximum=len(keys))


def _model_at(loc: list[Any], model: Any) -> Any:
    """Return the class of the value at ``loc`` of a model."""
    for part in loc:
        if part in FAULTS:
            model = FAULTS[part]
        elif isinstance(part, str) and part in field_names(model):
            model = field_type(model, part)
    return model
