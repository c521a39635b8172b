"""Validation of the parts of a fuzzy system."""

from __future__ import annotations

from omnidrive.errors import InvalidInput


def convert_to_floats(value: object, *fields: str) -> None:
    """Convert the given fields to floats where a user passed integers; None stays None."""
    for field in fields:
        given = getattr(value, field)
        if given is not None:
            object.__setattr__(value, field, float(given))


def check_name(what: str, name: str) -> None:
    """Raise for a name that is empty, too long, or has invisible characters."""
    if not name or len(name) > 200 or not name.isprintable() or name != name.strip():
        raise InvalidInput(
            f"the name of a {what} must be 1 to 200 printable characters: {name[:40]!r}"
        )


def check_unique(what: str, names: list[str]) -> None:
    """Raise if two names are equal."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InvalidInput(f"{what}: the name {name!r} is there twice")
        seen.add(name)
