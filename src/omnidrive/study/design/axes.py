"""Axes of a study: settings of a scenario with a list of values each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from json import dumps
from math import isfinite
from typing import Any, Literal, cast

import numpy as np

from omnidrive.errors import InvalidStudy, one_line, short_repr, suggestion
from omnidrive.parameter import is_number
from omnidrive.scenario.scenario_path import Keys, Setting, relocated

MAX_VALUES = 10_000
"""Largest number of values of an axis."""

_GRID = ("from", "to", "count", "scale")
_FORMS = (
    "need a list of values, {times: [0.7, 1, 1.4]}, {from: 1, to: 5, count: 5}, "
    "{named: {LABEL: VALUE}} or {cases: {LABEL: {PATH: VALUE}}}"
)
Label = float | int | bool | str
"""Value of a factor in tables."""


@dataclass(frozen=True, eq=False, slots=True)
class Axis:
    """Values of one setting of a scenario, or cases of several settings.

    Attributes:
        path: Dotted path into the scenario; of cases, their name.
        source: The values as in the study file.
        labels: The values in tables: numbers, true, false or text, all different.
        settings: The settings of each value.
        relative: Whether the values are multiples of the setting in the scenario.
    """

    path: str
    source: Any
    labels: tuple[Label, ...]
    settings: tuple[tuple[Setting, ...], ...]
    relative: bool = False

    @property
    def name(self) -> str:
        """Name of the factor in tables."""
        return factor_name(self.path, relative=self.relative)

    @property
    def keys(self) -> tuple[Keys, ...]:
        """Keys of all settings of the axis."""
        return tuple(dict.fromkeys(each.keys for value in self.settings for each in value))


def factor_name(path: str, *, relative: bool) -> str:
    """Return the name of a factor in tables: its path, with ``times`` if it is a multiple."""
    return f"{path} times" if relative else path


def parse_axis(path: str, source: Any, find: Callable[[str], Keys]) -> Axis:
    """Return the axis that the value of a key of ``axes`` describes; values are checked later.

    Args:
        path: The key.
        source: Its value.
        find: Returns the keys of a dotted path, or raises InvalidStudy.

    Raises:
        InvalidStudy: It has another form, an unknown path, no values, a value twice, or too many.
    """
    if isinstance(source, dict) and source.keys() == {"cases"}:
        return _cases(path, source, find)
    keys = find(path)
    names: list[Label] | None = None
    relative = False
    if isinstance(source, list):
        values = source
    elif isinstance(source, dict) and source.keys() == {"times"}:
        values, relative = _numbers(source["times"]), True
    elif isinstance(source, dict) and source.keys() == {"named"}:
        names, values = _named("named", source["named"])
    elif isinstance(source, dict) and {"from", "to", "count"} & source.keys():
        values = _grid(source)
    else:
        raise InvalidStudy(f"{_FORMS}, got {short_repr(source)}")
    _check_values(values)
    labels = list(map(label_of, values)) if names is None else names
    settings = tuple((Setting(keys, each, relative),) for each in values)
    return Axis(path, source, numbered(values, labels), settings, relative)


def _cases(path: str, source: Any, find: Callable[[str], Keys]) -> Axis:
    """Return the axis of cases that set several settings together."""
    labels, cases = _named("cases", source["cases"])
    _check_values(cases)
    settings = []
    for label, case in zip(labels, cases, strict=True):
        if not isinstance(case, dict) or not all(isinstance(each, str) for each in case):
            raise InvalidStudy(f"the case '{label}' needs a mapping of settings to values")
        settings.append(tuple(Setting(find(each), value) for each, value in case.items()))
    return Axis(path, source, numbered(cases, labels), tuple(settings))


def first_values(path: str, source: Any) -> list[tuple[str, Any]]:
    """Return paths and values of the first case of an axis that lists its values; else nothing."""
    if isinstance(source, list):
        return [(path, each) for each in source[:1]]
    form = next((each for each in ("named", "cases") if _has_first(source, each)), None)
    if form is None:
        return []
    first = next(iter(source[form].values()))
    if form == "named":
        return [(path, first)]
    return [(k, v) for k, v in first.items() if isinstance(k, str)] if type(first) is dict else []


def _has_first(source: Any, form: str) -> bool:
    values = source.get(form) if isinstance(source, dict) else None
    return isinstance(values, dict) and bool(values)


def _check_values(values: list[Any]) -> None:
    if not values:
        raise InvalidStudy("has no values")
    if len(values) > MAX_VALUES:
        raise InvalidStudy(f"has {len(values)} values, need at most {MAX_VALUES}")
    check_plain(values)
    if len(set(map(_text, values))) < len(values):
        raise InvalidStudy("contains a value twice")


def check_plain(value: Any) -> None:
    """Raise InvalidStudy unless a value is of the kinds that a scenario file contains."""
    if isinstance(value, dict):
        odd = [key for key in value if not isinstance(key, str)]
        if odd:
            raise InvalidStudy(f"the key {short_repr(odd[0])} is no text; write it in quotes")
        value = list(value.values())
    if isinstance(value, list):
        for each in value:
            check_plain(each)
    elif not (value is None or isinstance(value, str | bool | int | float)):
        raise InvalidStudy(
            f"{short_repr(value)} is a {type(value).__name__}, need numbers, texts, true, false, "
            "null, and lists and mappings of these"
        )


def _text(value: Any) -> str:
    return dumps(value, sort_keys=True)


def moved_files(axis: Axis, move: Callable[[str], str]) -> Any:
    """Return the source of an axis with other names of the files in it; see :func:`relocated`."""
    source = axis.source
    keys = axis.keys
    if isinstance(source, list):
        return [relocated(each, keys[0], move) for each in source]
    if not isinstance(source, dict):
        return source
    for form in ("named", "cases"):
        if form in source:
            found = zip(source[form].items(), axis.settings, strict=True)
            return {form: {label: _moved(form, v, each, move) for (label, v), each in found}}
    return source


def _moved(form: str, value: Any, settings: Sequence[Setting], move: Callable[[str], str]) -> Any:
    if form == "named":
        return relocated(value, settings[0].keys, move)
    pairs = zip(value, settings, strict=True)
    return {path: relocated(each.value, each.keys, move) for path, each in pairs}


def label_of(value: Any) -> Label:
    """Return the value of a factor in tables: a section or component is named by its main key."""
    if isinstance(value, str | bool | int | float):
        return value if not isinstance(value, str) else one_line(value, 80)
    if value is None:
        return "none"
    if isinstance(value, list):
        return one_line(", ".join(str(label_of(each)) for each in value), 80) or "none"
    name = next((value[k] for k in ("type", "name", "source", "kind", "law") if k in value), None)
    if isinstance(name, str):
        return one_line(name, 80)
    return one_line(", ".join(f"{k} {label_of(each)}" for k, each in value.items()), 80)


def numbered(values: Sequence[Any], labels: Sequence[Label]) -> tuple[Label, ...]:
    """Return labels that differ if the values do: equal ones of different values are numbered."""
    found: dict[str, Label] = {}
    used: set[Label] = set()
    for value, label in zip(map(_text, values), labels, strict=True):
        free = (f"{label} ({k})" for k in count(2))
        if value not in found:
            found[value] = label if label not in used else next(e for e in free if e not in used)
            used.add(found[value])
    return tuple(found[value] for value in map(_text, values))


def _numbers(value: Any) -> list[float]:
    if not isinstance(value, list) or not all(map(is_finite_number, value)):
        raise InvalidStudy(f"times: needs a list of numbers, got {short_repr(value)}")
    return [float(each) for each in value]


def is_finite_number(value: Any) -> bool:
    """Return whether a value of a file is a finite number."""
    return is_number(value) and not isinstance(value, bool) and isfinite(value)


def _named(form: str, value: Any) -> tuple[list[Label], list[Any]]:
    if not isinstance(value, dict) or not all(isinstance(each, str) and each for each in value):
        raise InvalidStudy(f"{form}: needs a mapping of labels to values, got {short_repr(value)}")
    return [one_line(label, 80) for label in value], list(value.values())


def _grid(source: dict[Any, Any]) -> list[float]:
    """Return equally spaced values; with the scale `log`, values with equal ratios."""
    odd = [str(key) for key in source if key not in _GRID]
    if odd:
        raise InvalidStudy(f"unknown key '{one_line(odd[0], 60)}'{suggestion(odd[0], _GRID)}")
    ends, count = (source.get("from"), source.get("to")), source.get("count")
    if not all(map(is_finite_number, ends)):
        raise InvalidStudy("a grid needs two numbers, from and to")
    if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= MAX_VALUES:
        raise InvalidStudy(f"count is {short_repr(count)}, need 2 to {MAX_VALUES}")
    first, last = (float(cast(float, each)) for each in ends)
    scale = check_scale(source.get("scale", "linear"), min(first, last))
    spaced = np.geomspace if scale == "log" else np.linspace
    values: list[float] = spaced(first, last, count).tolist()
    return values


def check_scale(scale: Any, low: float) -> Literal["linear", "log"]:
    """Return the scale of a range from ``low`` on.

    Raises:
        InvalidStudy: It is not linear or log, or log and ``low`` is not positive.
    """
    if scale not in {"linear", "log"}:
        raise InvalidStudy(f"scale is {short_repr(scale)}, need linear or log")
    if scale == "log" and not low > 0.0:
        raise InvalidStudy(f"scale log needs positive values, got {low:g}")
    return cast(Literal["linear", "log"], scale)
