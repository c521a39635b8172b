"""Lines and tokens of the fuzzylite language."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from omnidrive.fuzzy.position import Position, malformed


class Token(NamedTuple):
    """Characters between blanks, and their position."""

    text: str
    position: Position


class Line(NamedTuple):
    """A line ``key: value``, without comment."""

    key: str
    position: Position
    value: str
    value_position: Position

    def tokens(self) -> list[Token]:
        """Return the tokens of the value."""
        return [
            Token(match[0], self.value_position.after(self.value[: match.start()]))
            for match in re.finditer(r"\S+", self.value)
        ]


def lines(text: str) -> Iterator[Line]:
    """Yield the lines that are not empty; comments begin with ``#``.

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
