"""Lines and tokens of the FuzzyLite Language (.fll)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from omnidrive.files.position import Position
from omnidrive.fuzzy.position import LocatedText, malformed


class Line(NamedTuple):
    """A line ``key: value`` without its comment."""

    key: str
    """Without surrounding whitespace; may be empty."""
    position: Position
    """Position of the first character of the key."""
    value: str
    """Without surrounding whitespace; may be empty."""
    value_position: Position
    """Position of the first character of the value; if empty, the end of the line or the comment's
    start."""

    def tokens(self) -> list[LocatedText]:
        """Return the words of the value, which are separated by whitespace."""
        line, column = self.value_position
        return [
            LocatedText(match[0], Position(line, column + match.start()))
            for match in re.finditer(r"\S+", self.value)
        ]


def lines(text: str) -> Iterator[Line]:
    """Yield the lines except empty ones and those with only a comment, which begins with ``#``.

    Raises:
        InvalidFuzzyFile: A line has no colon.
    """
    for number, row in enumerate(text.split("\n"), 1):
        code = row.partition("#")[0]
        if not code.strip():
            continue
        key, colon, rest = code.partition(":")
        position = Position(number, len(key) - len(key.lstrip()) + 1)
        if not colon:
            raise malformed(position, f"expected 'key: value', got {code.strip()[:40]!r}")
        column = len(key) + 2 + len(rest) - len(rest.lstrip())
        yield Line(key.strip(), position, rest.strip(), Position(number, column))
