"""Scenarios as YAML files."""

from __future__ import annotations

from dataclasses import asdict, is_dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args, get_type_hints

import yaml
from pydantic import BaseModel, ValidationError

from omnidrive.errors import InvalidScenario
from omnidrive.study.scenario import Scenario

_MAX_BYTES = 100_000


class _Loader(yaml.SafeLoader):
    """YAML without aliases, which can make a short file enormous."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not allowed in a scenario")
        return super().compose_node(parent, index)


def load_scenario(path: Path) -> Scenario:
    """Read a scenario; a map file is made relative to the working folder.

    Raises:
        InvalidScenario: The file is missing, malformed, or says something that has no meaning; the
            message names every wrong key.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InvalidScenario(f"{path} is too large for a scenario")
        data = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except OSError as error:
        raise InvalidScenario(f"cannot read the scenario {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        reason = " ".join(str(error).split())[:200]
        raise InvalidScenario(f"{path} is not a YAML scenario: {reason}") from None
    if not isinstance(data, dict):
        raise InvalidScenario(f"{path} is not a scenario: it holds no keys")
    scenario = parse_scenario(data, str(path))
    if scenario.map.source == "paper":
        return scenario
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
    if isinstance(value, tuple) and type(value).__name__ == "Place":
        return [v for v in value if v is not None]
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return value._asdict()
    return [_plain(v) for v in value] if isinstance(value, tuple) else value


def parse_scenario(data: dict[str, Any], where: str) -> Scenario:
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
    loc = [part for part in problem["loc"] if isinstance(part, int) or part.isidentifier()]
    key = ".".join(str(part) for part in loc)
    kind, value = problem["type"], problem.get("input")
    if kind in {"extra_forbidden", "unexpected_keyword_argument"}:
        return f"unknown key '{key}'" + _suggestion(str(loc[-1]), loc[:-1])
    if kind in {"missing", "missing_argument"}:
        return f"'{key}' is missing"
    if kind in {"float_parsing", "float_type", "int_parsing", "int_type"}:
        return f"{key} must be a plain number without a unit, got {value!r}"
    message = problem["msg"].removeprefix("Value error, ")
    if kind == "value_error":
        return f"{key} {message}"
    return f"{key}: {message[0].lower()}{message[1:]}, got {_short(value)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _suggestion(name: str, loc: list[Any]) -> str:
    """The nearest key that exists at ``loc``, or all of them."""
    model: Any = Scenario
    for part in loc:
        if isinstance(part, str) and part in _keys(model):
            model = _type_at(model, part)
    keys = _keys(model)
    near = get_close_matches(name, keys, n=1, cutoff=0.5)
    return f"; did you mean '{near[0]}'?" if near else f"; there are {', '.join(keys)}"


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
