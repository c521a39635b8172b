"""Names and types of the fields of parameter classes."""

from __future__ import annotations

from typing import Any, get_args, get_type_hints


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
