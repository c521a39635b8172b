"""Where in a text something stands, and errors that say so."""

from __future__ import annotations

from math import isnan, nan
from typing import NamedTuple

from omnidrive.errors import InvalidFuzzyFile


class Place(NamedTuple):
    """Where in a text something stands."""

    line: int
    """From 1."""
    column: int
    """From 1."""

    def after(self, text: str) -> Place:
        """Place of what follows ``text``, which begins here."""
        lines = text.count("\n")
        if not lines:
            return Place(self.line, self.column + len(text))
        return Place(self.line + lines, len(text) - text.rindex("\n"))


def malformed(place: Place | None, what: str) -> InvalidFuzzyFile:
    """Error at a place: what was found, and what was expected; the reader adds the file's name."""
    where = f"line {place.line}, column {place.column}: " if place else ""
    return InvalidFuzzyFile(f"{where}{what}")


def number(text: str, place: Place | None) -> float:
    """A finite or infinite number; never NaN.

    Raises:
        InvalidFuzzyFile: ``text`` is none.
    """
    try:
        value = float(text) if "_" not in text and len(text) <= 400 else nan
    except ValueError:
        value = nan
    if isnan(value):
        raise malformed(place, f"expected a number, got {text[:40]!r}")
    return value
