"""Parts of a text with their positions, and errors that name them."""

from __future__ import annotations

import re
from typing import NamedTuple

from omnidrive.errors import InvalidFuzzyFile
from omnidrive.files import number_text
from omnidrive.files.position import Position

_INFINITY = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)


class LocatedText(NamedTuple):
    """Part of a text, such as a word or a quoted name, and its position."""

    text: str
    position: Position


def malformed(position: Position | None, what: str) -> InvalidFuzzyFile:
    """Return an error that names a position; None: ``what`` alone.

    ``what`` says what was expected and what was found. :func:`omnidrive.fuzzy.load` prepends the
    name of the file.
    """
    where = f"line {position.line}, column {position.column}: " if position else ""
    return InvalidFuzzyFile(f"{where}{what}")


def parse_number(text: str, position: Position | None) -> float:
    """Return the finite or infinite number that ``text`` denotes; never NaN.

    Raises:
        InvalidFuzzyFile: ``text`` is not a number.
    """
    value = number_text.parse_number(text)
    if value is None and _INFINITY.fullmatch(text):
        value = float(text)
    if value is None:
        raise malformed(position, f"expected a number, got {text[:40]!r}")
    return value
