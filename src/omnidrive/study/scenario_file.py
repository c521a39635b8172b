"""Scenario files in YAML."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

import yaml
from pydantic import BaseModel, ValidationError

from omnidrive.errors import InvalidScenario, suggestion
from omnidrive.files.bounded_file import one_line, short_repr
from omnidrive.files.yaml_file import read_yaml
from omnidrive.simulation.disturbances import FAULTS
from omnidrive.study.scenario import Scenario

_MISSING = "'{key}' is missing"
_NOT_A_NUMBER = "{key} must be a plain number without a unit, got {value}"
_UNKNOWN_FAULT = f"{{key}}: unknown kind of fault; there are {', '.join(FAULTS)}"
_MESSAGES = {
    **dict.fromkeys(("missing", "missing_argument"), _MISSING),
    **dict.fromkeys(("float_parsing", "float_type", "int_parsing", "int_type"), _NOT_A_NUMBER),
    **dict.fromkeys(("union_tag_invalid", "union_tag_not_found"), _UNKNOWN_FAULT),
}
"""Messages by pydantic's type of the error."""


def load_scenario(path: Path) -> Scenario:
    """Read a scenario file; the path of its map becomes relative to the working directory.

    Raises:
        InvalidScenario: The file is missing or malformed, or a value is invalid; the message names
            every invalid key.
    """
    data = read_yaml(path, "scenario", InvalidScenario)
    if not isinstance(data, dict):
        raise InvalidScenario(f"{path} is not a scenario: it contains no keys")
    scenario = parse_scenario(data, str(path))
    if scenario.map.source == "paper":
        return scenario
    if not scenario.map.source or "\0" in scenario.map.source:
        raise InvalidScenario(
            f"{path}: map.source must name a file, got {short_repr(scenario.map.source)}"
        )
    source = str(path.parent / scenario.map.source)
    return scenario.model_copy(update={"map": scenario.map.model_copy(update={"source": source})})


def save_scenario(scenario: Scenario, path: Path) -> None:
    """Write a scenario file that :func:`load_scenario` can read."""
    path.write_text(yaml.safe_dump(scenario_data(scenario), sort_keys=False), encoding="utf-8")


def scenario_data(scenario: Scenario) -> dict[str, Any]:
    """Return the scenario as dictionaries, lists, numbers and strings."""
    data: dict[str, Any] = _plain(scenario)
    return data


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return {name: _plain(getattr(value, name)) for name in type(value).model_fields}
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, tuple) and type(value).__name__ == "Waypoint":
        return [v for v in value if v is not None]
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return value._asdict()
    return [_plain(v) for v in value] if isinstance(value, tuple) else value


def parse_scenario(data: dict[Any, Any], where: str) -> Scenario:
    """Validate ``data`` and return the scenario.

    Args:
        data: Content of a scenario file.
        where: Source of the data, for messages.

    Raises:
        InvalidScenario: A key or value is invalid; the message names every one.
    """
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        problems = [p for p in error.errors() if p["type"] != "too_short"] or error.errors()
        facts = dict.fromkeys(map(_explain, problems))
        raise InvalidScenario(f"{where}: " + "; ".join(facts)) from None


def _explain(problem: Any) -> str:
    """Return the message for one error: the key, the cause and the valid values."""
    kind, value = problem["type"], problem.get("input")
    if kind in {"extra_forbidden", "unexpected_keyword_argument", "invalid_key"}:
        *outer, name = problem["loc"]  # the name is that in the file, not always an identifier
        keys = _fields(outer)
        if kind == "invalid_key":  # not a string; pydantic reports true as 1
            return f"unknown key {short_repr(value)}" + _within(keys) + _suggestion("", keys)
        key = ".".join([*map(str, keys), one_line(str(name), 60)])
        return f"unknown key '{key}'" + _suggestion(str(name), keys)
    key = ".".join(map(str, _fields(problem["loc"])))
    if kind in _MESSAGES:
        return _MESSAGES[kind].format(key=key, value=short_repr(value))
    message = problem["msg"].removeprefix("Value error, ")
    if kind == "value_error":
        return f"{key} {message}".lstrip()
    return f"{key or 'a key'}: {message[0].lower()}{message[1:]}, got {short_repr(value)}"


def _fields(loc: Iterable[Any]) -> list[Any]:
    """Return the keys in ``loc``, without additions such as `function-after[check(), float]`."""
    return [part for part in loc if isinstance(part, int) or part.isidentifier() or part in FAULTS]


def _within(keys: list[Any]) -> str:
    return f" in '{'.'.join(map(str, keys))}'" if keys else ""


def _suggestion(name: str, loc: list[Any]) -> str:
    """Return a suggestion of the closest valid key at ``loc``, or of all."""
    model: Any = Scenario
    for part in loc:
        if part in FAULTS:
            model = FAULTS[part]
        elif isinstance(part, str) and part in _keys(model):
            model = _type_at(model, part)
    keys = _keys(model)
    return suggestion(name, keys, most=len(keys))


def _keys(model: Any) -> list[str]:
    for attribute in ("model_fields", "__dataclass_fields__", "_fields"):
        if hasattr(model, attribute):
            return list(getattr(model, attribute))
    return []


def _type_at(model: Any, name: str) -> Any:
    """Return the class of a field; ``X`` for ``X | None``."""
    hint = get_type_hints(model)[name]
    options = [h for h in get_args(hint) if h is not type(None)] if get_args(hint) else [hint]
    return options[0] if _keys(options[0]) else hint
