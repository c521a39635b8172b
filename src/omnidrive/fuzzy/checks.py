"""Validation of the parts of a fuzzy system."""

from __future__ import annotations

from omnidrive.errors import InvalidInput

MAX_NUMBER = 1e100
"""Largest magnitude of a number of a system: products of two and sums of many do not overflow."""
MAX_NAME = 200
"""Largest number of characters of a name."""


def convert_to_floats(value: object, *fields: str) -> None:
    """Convert the given fields to floats where a user passed integers; None stays None."""
    for field in fields:
        given = getattr(value, field)
        if given is not None:
            object.__setattr__(value, field, float(given))


def check_numbers(owner: str, *values: float) -> None:
    """Raise for a number that is not finite or above :data:`MAX_NUMBER` in magnitude."""
    for value in values:
        if not abs(value) <= MAX_NUMBER:  # NaN as well
            raise InvalidInput(
                f"{owner}: {value:g} is not a finite number of at most {MAX_NUMBER:g} in magnitude"
            )


def check_name(what: str, name: str) -> None:
    """Raise for a name that is empty, too long, or has invisible characters."""
    if not 1 <= len(name) <= MAX_NAME or not name.isprintable() or name != name.strip():
        raise InvalidInput(
            f"the name of a {what} must be 1 to {MAX_NAME} printable characters: {name[:40]!r}"
        )


def check_unique(what: str, names: list[str]) -> None:
    """Raise if two names are equal."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InvalidInput(f"{what}: the name {name!r} is there twice")
        seen.add(name)
