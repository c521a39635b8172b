"""What is checked of the parts of a fuzzy system, and how errors help."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from omnidrive.errors import InvalidInput


def nearest(name: str, known: Sequence[str]) -> str:
    """``; did you mean ...?`` or a list of what there is: the end of an error message."""
    close = get_close_matches(name, known, n=1) or [k for k in known if k.lower() == name.lower()]
    if close:
        return f"; did you mean {close[0]!r}?"
    shown = ", ".join(known[:12])
    return f"; there are {shown}{', ...' if len(known) > 12 else ''}"


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
        raise InvalidInput(f"there is no {what} {name!r}{nearest(name, tuple(known))}")
