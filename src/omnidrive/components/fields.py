"""Names, types and values of the fields of parameter classes."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_type_hints

from pydantic import BaseModel


def field_names(cls: Any) -> list[str]:
    """Return the names of the fields of a pydantic model, dataclass or named tuple; else none."""
    for attribute in ("__pydantic_fields__", "__dataclass_fields__", "_fields"):
        if hasattr(cls, attribute):
            return list(getattr(cls, attribute))
    return []


def field_type(cls: Any, name: str) -> Any:
    """Return the type of a field; ``X`` for ``X | None`` if ``X`` has fields."""
    hint = get_type_hints(cls)[name]
    options = [h for h in get_args(hint) if h is not type(None)] if get_args(hint) else [hint]
    return options[0] if field_names(options[0]) else hint


def plain(value: Any) -> Any:
    """Return ``value`` as dictionaries, lists, numbers, strings and None.

    A value with a method ``plain`` is what that returns; models, dataclasses and named tuples are
    dictionaries of their fields.
    """
    if callable(getattr(value, "plain", None)):
        return value.plain()
    if isinstance(value, BaseModel):
        return {name: plain(getattr(value, name)) for name in type(value).model_fields}
    if is_dataclass(value):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    if hasattr(value, "_asdict"):
        return {name: plain(item) for name, item in value._asdict().items()}
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, tuple | list) else value


class PresetDefaults:
    """Base class of dataclasses of which a field that is None stands for the value of a preset.

    Such a field is not written to files.
    """

    def plain(self) -> dict[str, Any]:
        """Return the fields that have a value, as in a scenario file."""
        every: Any = self
        found = {each.name: plain(getattr(self, each.name)) for each in fields(every)}
        return {name: value for name, value in found.items() if value is not None and value != {}}
