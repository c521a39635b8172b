"""Scenarios as YAML files."""

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
_NO_NUMBER = "{key} must be a plain number without a unit, got {value}"
_NO_FAULT = f"{{key}}: there is no such kind of fault; there are {', '.join(FAULTS)}"
_SAYINGS = {
    **dict.fromkeys(("missing", "missing_argument"), _MISSING),
    **dict.fromkeys(("float_parsing", "float_type", "int_parsing", "int_type"), _NO_NUMBER),
    **dict.fromkeys(("union_tag_invalid", "union_tag_not_found"), _NO_FAULT),
}
"""What to say of problems, by the name that pydantic has for them."""


def load_scenario(path: Path) -> Scenario:
    """Read a scenario; a map file is made relative to the working folder.

    Raises:
        InvalidScenario: The file is missing, malformed, or says something that has no meaning; the
            message names every wrong key.
    """
    data = read_yaml(path, "scenario", InvalidScenario)
    if not isinstance(data, dict):
        raise InvalidScenario(f"{path} is not a scenario: it holds no keys")
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
    """Write a scenario so that :func:`load_scenario` reads the same."""
    path.write_text(yaml.safe_dump(scenario_data(scenario), sort_keys=False), encoding="utf-8")


def scenario_data(scenario: Scenario) -> dict[str, Any]:
    """The scenario as dictionaries, lists, numbers and strings."""
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
    """Check ``data`` and make it a scenario; ``where`` names its source in messages.

    Raises:
        InvalidScenario: As for :func:`load_scenario`.
    """
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        problems = [p for p in error.errors() if p["type"] != "too_short"] or error.errors()
        facts = dict.fromkeys(map(_explain, problems))
        raise InvalidScenario(f"{where}: " + "; ".join(facts)) from None


def _explain(problem: Any) -> str:
    """One problem in words: which key, what is wrong, what would be right."""
    kind, value = problem["type"], problem.get("input")
    if kind in {"extra_forbidden", "unexpected_keyword_argument", "invalid_key"}:
        *outer, name = problem["loc"]  # name: as in the file, so perhaps no identifier
        spot = _fields(outer)
        if kind == "invalid_key":  # not text; pydantic takes true for 1
            return f"unknown key {short_repr(value)}" + _within(spot) + _suggestion("", spot)
        key = ".".join([*map(str, spot), one_line(str(name), 60)])
        return f"unknown key '{key}'" + _suggestion(str(name), spot)
    key = ".".join(map(str, _fields(problem["loc"])))
    if kind in _SAYINGS:
        return _SAYINGS[kind].format(key=key, value=short_repr(value))
    message = problem["msg"].removeprefix("Value error, ")
    if kind == "value_error":
        return f"{key} {message}".lstrip()
    return f"{key or 'a key'}: {message[0].lower()}{message[1:]}, got {short_repr(value)}"


def _fields(loc: Iterable[Any]) -> list[Any]:
    """``loc`` without what pydantic adds to it, such as `function-after[check(), float]`."""
    return [part for part in loc if isinstance(part, int) or part.isidentifier() or part in FAULTS]


def _within(spot: list[Any]) -> str:
    return f" in '{'.'.join(map(str, spot))}'" if spot else ""


def _suggestion(name: str, loc: list[Any]) -> str:
    """The nearest key that exists at ``loc``, or all of them."""
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
    """Class of a field, with ``| None`` taken off."""
    hint = get_type_hints(model)[name]
    options = [h for h in get_args(hint) if h is not type(None)] if get_args(hint) else [hint]
    return options[0] if _keys(options[0]) else hint
