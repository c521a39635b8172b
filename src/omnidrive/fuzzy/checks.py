"""What is checked of the parts of a fuzzy system, and how errors help."""

from __future__ import annotations

from collections.abc import Sequence

from omnidrive.errors import InvalidInput, suggestion


def as_floats(value: object, *fields: str) -> None:
    """Make floats of the integers that a user may have written."""
    for field in fields:
        given = getattr(value, field)
        if given is not None:
            object.__setattr__(value, field, float(given))


def check_name(what: str, name: str) -> None:
    """Refuse a name that is empty, too long, or hard to see."""
    if not name or len(name) > 200 or not name.isprintable() or name != name.strip():
        raise InvalidInput(
            f"the name of a {what} must be 1 to 200 printable characters: {name[:40]!r}"
        )


def check_different(what: str, names: list[str]) -> None:
    """Refuse names of which two are equal."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InvalidInput(f"{what}: the name {name!r} is there twice")
        seen.add(name)


def check_choice(
    what: str, name: str, known: Sequence[str] | dict[str, str] | dict[str, int]
) -> None:
    """Refuse a name that is not known, with the nearest one that is."""
    if name not in known:
        raise InvalidInput(f"there is no {what} {name!r}{suggestion(name, tuple(known))}")
