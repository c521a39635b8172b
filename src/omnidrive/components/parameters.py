"""Descriptions of the parameters of components, for lists and help texts."""

from __future__ import annotations

from dataclasses import MISSING, fields, is_dataclass
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from omnidrive.components.documentation import field_docs
from omnidrive.components.fields import field_names
from omnidrive.parameter import Bounds


class Parameter(NamedTuple):
    """Description of one parameter."""

    name: str
    """Name; ``group.name`` within a group of parameters."""
    kind: str
    """Type: `number`, `integer`, `true or false`, `text`, the possible values, or a class."""
    unit: str
    """Unit; empty if it has none."""
    range: tuple[float, float] | None
    """Least and greatest value; None: no range."""
    default: Any
    """Value without one in the scenario; ``...`` if it is required."""
    doc: str
    """Documentation in Markdown; may be empty."""


def parameters_of(cls: Any) -> list[Parameter]:
    """Return the parameters of a class, those of nested classes as ``group.name``.

    Args:
        cls: Dataclass, pydantic model or named tuple; None has no parameters.
    """
    if cls is None:
        return []
    hints, docs, found = get_type_hints(cls, include_extras=True), field_docs(cls), []
    for name in field_names(cls):
        hint, default = hints[name], _default(cls, name)
        inner = parameters_of(hint) if field_names(hint) else []
        for each in inner:
            value = each.default if default is ... else getattr(default, each.name, each.default)
            found.append(each._replace(name=f"{name}.{each.name}", default=value))
        if not inner:
            bounds = _bounds(hint)
            unit = "" if bounds is None or bounds.unit == "1" else bounds.unit
            limits = None if bounds is None else (bounds.low, bounds.high)
            found.append(Parameter(name, _kind(hint), unit, limits, default, docs.get(name, "")))
    return found


def _default(cls: Any, name: str) -> Any:
    """Return the default of a field; ``...`` without one."""
    if is_dataclass(cls):
        (each,) = (f for f in fields(cls) if f.name == name)
        if each.default_factory is not MISSING:
            return each.default_factory()
        return ... if each.default is MISSING else each.default
    if issubclass(cls, BaseModel):
        default = cls.model_fields[name].get_default(call_default_factory=True)
        return ... if default is PydanticUndefined else default
    return getattr(cls, "_field_defaults", {}).get(name, ...)


def _options(hint: Any) -> list[Any]:
    """Return the members of a union without None; the type itself if it is no union."""
    if get_origin(hint) in {Union, UnionType}:
        return [each for each in get_args(hint) if each is not type(None)]
    return [hint]


def _bounds(hint: Any) -> Bounds | None:
    for option in _options(hint):
        for meta in getattr(option, "__metadata__", ()):
            if isinstance(meta, Bounds):
                return meta
    return None


def _kind(hint: Any) -> str:
    """Return the type of a parameter in words."""
    words = {float: "number", int: "integer", bool: "true or false", str: "text"}
    shown = []
    for option in _options(hint):
        bare = get_args(option)[0] if get_origin(option) is Annotated else option
        if get_origin(bare) is Literal:
            shown.append("|".join(map(str, get_args(bare))))
        elif get_origin(bare) is tuple:
            shown.append("list")
        else:
            shown.append(words.get(bare, getattr(bare, "__name__", str(bare))))
    return " or ".join(shown)
