"""Positions in a text."""

from __future__ import annotations

from typing import NamedTuple


class Position(NamedTuple):
    """Position of a character in a text."""

    line: int
    """From 1."""
    column: int
    """From 1."""

    def after(self, text: str) -> Position:
        """Return the position of the character that follows ``text``, which starts here."""
        lines = text.count("\n")
        if not lines:
            return Position(self.line, self.column + len(text))
        return Position(self.line + lines, len(text) - text.rindex("\n"))
