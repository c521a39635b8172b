"""Lines of a ``.fis`` file: sections, keys, and the values between quotes and brackets."""

from __future__ import annotations

import re
from math import isfinite
from typing import NamedTuple, NoReturn

from omnidrive.fuzzy.position import Position, malformed, parse_number
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES
from omnidrive.fuzzy.variables import MAX_SETS

_NOT_CODE = re.compile(r"""'[^']*'|"[^"]*"|[%#]|//""")
_SECTION = re.compile(r"\s*\[([A-Za-z]+)\s*(?:(\d+)\s*)?\]\s*")
_ENTRY = re.compile(r"\s*([A-Za-z]\w*)\s*=\s*")
_QUOTED = re.compile(r"""'((?:[^']|'')*)'|"((?:[^"]|"")*)\"""")
_WORD = re.compile(r"""[^\s,:()\[\]'"]+""")
_MOST_LINES = {"rules": MAX_RULES, "input": 2 * MAX_SETS, "output": 2 * MAX_SETS, "system": 50}


class Cursor:
    """What remains of a line, taken piece by piece.

    Every method skips blanks, takes what it is named after, and refuses anything else, saying where
    and what was expected.
    """

    def __init__(self, line: str, row: int, at: int = 0) -> None:
        self._line, self._row, self._at = line, row, at
        self._skip()

    @property
    def position(self) -> Position:
        """Where what comes next stands."""
        return Position(self._row, self._at + 1)

    def fail(self, expected: str) -> NoReturn:
        """Refuse what comes next."""
        rest = self._line[self._at :]
        found = repr(rest[:30] + "..." * (len(rest) > 30)) if rest else "the end of the line"
        raise malformed(self.position, f"expected {expected}, got {found}")

    def mark(self, mark: str) -> bool:
        """Take a mark, if it comes next."""
        found = self._line.startswith(mark, self._at)
        if found:
            self._at += len(mark)
            self._skip()
        return found

    def expect(self, mark: str, where: str) -> None:
        """Take a mark."""
        if not self.mark(mark):
            self.fail(f"{mark!r} {where}")

    def end(self) -> None:
        """Nothing but the end of the line."""
        if self._at < len(self._line):
            self.fail("the end of the line")

    def quoted(self, what: str) -> str:
        """A text in quotes; a doubled quote is one of the text."""
        match = _QUOTED.match(self._line, self._at)
        if match is None:
            self.fail(f"{what} in single quotes")
        self._at = match.end()
        self._skip()
        single, double = match.groups()
        return str(double).replace('""', '"') if single is None else single.replace("''", "'")

    def word(self, what: str) -> str:
        """Characters up to a blank, quote, bracket, comma or colon."""
        match = _WORD.match(self._line, self._at)
        if match is None:
            self.fail(what)
        self._at = match.end()
        self._skip()
        return match[0]

    def number(self, what: str) -> float:
        """A finite number."""
        before = self._at, self.position
        value = parse_number(self.word(what), before[1])
        if not isfinite(value):
            self._at = before[0]
            self.fail(f"{what}, which must be finite")
        return value

    def numbers(self, what: str) -> tuple[float, ...]:
        """Numbers in brackets, between blanks or commas; or one number without."""
        if not self.mark("["):
            return (self.number(f"{what} in [brackets]"),)
        values: list[float] = []
        while not self.mark("]"):
            if len(values) > MAX_VARIABLES:
                self.fail(f"{what}: at most {MAX_VARIABLES + 1} numbers and ']'")
            values.append(self.number(f"{what}: a number or ']'"))
            self.mark(",")
        return tuple(values)

    def _skip(self) -> None:
        line, at = self._line, self._at
        while at < len(line) and line[at].isspace():
            at += 1
        self._at = at


class Section(NamedTuple):
    """What stands under one ``[Heading]``."""

    title: str
    """As ``Input1``."""
    position: Position
    entries: dict[str, tuple[str, Position, Cursor]]
    """By the key in lower case: the key as written, its place, and the value."""
    lines: list[Cursor]
    """Instead of entries, for the rules."""


def sections(text: str) -> dict[tuple[str, int], Section]:
    """Sections by their kind, in lower case, and number; 0 where they have none.

    Comments begin with ``%``, ``#`` or ``//`` outside quotes. Keys and headings are read in any
    case.

    Raises:
        InvalidFuzzyFile: A line is of no section, or stands twice; a heading is unknown.
    """
    found: dict[tuple[str, int], Section] = {}
    section: Section | None = None
    kind = ""
    for row, written in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        line = _code(written)
        if not line:
            continue
        heading = _SECTION.fullmatch(line)
        if heading is not None:
            kind, index = _heading(heading, Cursor(line, row))
            if (kind, index) in found:
                raise malformed(Cursor(line, row).position, f"{line.strip()} is there twice")
            title = heading[1] + (heading[2] or "")
            section = found[kind, index] = Section(title, Cursor(line, row).position, {}, [])
            continue
        if section is None:
            Cursor(line, row).fail("[System]")
        if len(section.entries) + len(section.lines) >= _MOST_LINES[kind]:
            raise malformed(
                Position(row, 1), f"[{section.title}] has more than {_MOST_LINES[kind]} lines"
            )
        if kind == "rules":
            section.lines.append(Cursor(line, row))
        else:
            _add_entry(section, line, row)
    return found


def _heading(heading: re.Match[str], cursor: Cursor) -> tuple[str, int]:
    kind, digits = heading[1].lower(), heading[2] or ""
    numbered = kind in {"input", "output"}
    if kind not in _MOST_LINES or numbered != bool(digits):
        cursor.fail("[System], [Input1], ..., [Output1], ..., or [Rules]")
    if numbered and not (len(digits) <= 9 and 1 <= int(digits) <= MAX_VARIABLES):
        cursor.fail(f"at most [{heading[1]}{MAX_VARIABLES}]")
    return kind, int(digits or 0)


def _add_entry(section: Section, line: str, row: int) -> None:
    start = Cursor(line, row)
    entry = _ENTRY.match(line)
    if entry is None:
        start.fail("'Key=value' or a [Section]")
    key = entry[1]
    if key.lower() in section.entries:
        raise malformed(start.position, f"{key[:40]} is there twice in [{section.title}]")
    section.entries[key.lower()] = key, start.position, Cursor(line, row, entry.end())


def _code(line: str) -> str:
    """The line without a comment and without blanks at its end."""
    for match in _NOT_CODE.finditer(line):
        if match[0] in {"%", "#", "//"}:
            line = line[: match.start()]
            break
    return line.rstrip()
