"""Lines and tokens of a ``.fis`` file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import isfinite
from typing import NoReturn

from omnidrive.files.position import Position
from omnidrive.fuzzy.position import malformed, parse_number
from omnidrive.fuzzy.system import MAX_VARIABLES

_QUOTED_OR_COMMENT = re.compile(r"""'[^']*'|"[^"]*"|[%#]|//""")
_QUOTED = re.compile(r"""'((?:[^']|'')*)'|"((?:[^"]|"")*)\"""")
_WORD = re.compile(r"""[^\s,:()\[\]'"]+""")


def code_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield the number and the text of each line, without comments and trailing blanks.

    Comments begin with ``%``, ``#`` or ``//`` outside quotes. Lines without code are skipped.
    """
    for row, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        if code := _code(line):
            yield row, code


def _code(line: str) -> str:
    for match in _QUOTED_OR_COMMENT.finditer(line):
        if match[0] in {"%", "#", "//"}:
            line = line[: match.start()]
            break
    return line.rstrip()


class Cursor:
    """Tokenizer of one line.

    Each method that consumes a token skips the blanks after it, and raises an
    :class:`~omnidrive.errors.InvalidFuzzyFile` with the position if another token comes next.
    """

    def __init__(self, line: str, row: int, start: int = 0) -> None:
        self._line, self._row, self._at = line, row, start
        self._skip()

    @property
    def position(self) -> Position:
        """Position of the next token."""
        return Position(self._row, self._at + 1)

    def fail(self, expected: str) -> NoReturn:
        """Refuse the next token."""
        rest = self._line[self._at :]
        found = repr(rest[:30] + "..." * (len(rest) > 30)) if rest else "the end of the line"
        raise malformed(self.position, f"expected {expected}, got {found}")

    def accept(self, mark: str) -> bool:
        """Consume a punctuation mark if it comes next; return whether it does."""
        found = self._line.startswith(mark, self._at)
        if found:
            self._at += len(mark)
            self._skip()
        return found

    def expect(self, mark: str, where: str) -> None:
        """Consume a punctuation mark; ``where`` completes the error message."""
        if not self.accept(mark):
            self.fail(f"{mark!r} {where}")

    def end(self) -> None:
        """Check that the end of the line is reached."""
        if self._at < len(self._line):
            self.fail("the end of the line")

    def quoted(self, what: str) -> str:
        """Consume a text in quotes; a doubled quote stands for one quote."""
        match = _QUOTED.match(self._line, self._at)
        if match is None:
            self.fail(f"{what} in single quotes")
        self._at = match.end()
        self._skip()
        single, double = match.groups()
        return str(double).replace('""', '"') if single is None else single.replace("''", "'")

    def word(self, what: str) -> str:
        """Consume the characters up to a blank, quote, bracket, comma or colon."""
        match = _WORD.match(self._line, self._at)
        if match is None:
            self.fail(what)
        self._at = match.end()
        self._skip()
        return match[0]

    def number(self, what: str) -> float:
        """Consume a finite number."""
        before = self._at, self.position
        value = parse_number(self.word(what), before[1])
        if not isfinite(value):
            self._at = before[0]
            self.fail(f"{what}, which must be finite")
        return value

    def numbers(self, what: str) -> tuple[float, ...]:
        """Consume numbers in brackets, separated by blanks or commas; or one number without."""
        if not self.accept("["):
            return (self.number(f"{what} in [brackets]"),)
        values: list[float] = []
        while not self.accept("]"):
            if len(values) > MAX_VARIABLES:
                self.fail(f"{what}: at most {MAX_VARIABLES + 1} numbers and ']'")
            values.append(self.number(f"{what}: a number or ']'"))
            self.accept(",")
        return tuple(values)

    def _skip(self) -> None:
        line, at = self._line, self._at
        while at < len(line) and line[at].isspace():
            at += 1
        self._at = at
