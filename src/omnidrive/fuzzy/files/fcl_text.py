"""Text in the fuzzy control language as words, numbers and marks, without its comments."""

from __future__ import annotations

import re
from math import isfinite
from typing import NamedTuple, NoReturn

from omnidrive.fuzzy.files.source import Position, malformed, parse_number

_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]+)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?![\w])"
_TOKEN = re.compile(rf"(?P<number>{_NUMBER})|(?P<word>[^\W\d]\w*)|(?P<mark>:=|\.\.|.)", re.DOTALL)
_SPACE = re.compile(r"\s+")
_LINE_END = re.compile(r"[^\n]*")


MAX_LINE = 1000
"""Most characters of a name that is a whole line."""


class Token(NamedTuple):
    """Word, number or mark."""

    kind: str
    """``word``, ``number``, ``mark`` or ``end``."""
    text: str
    """As written."""
    key: str
    """Of a word or mark: in upper case, as keywords are compared."""
    offset: int
    position: Position

    def __str__(self) -> str:
        return "the end" if self.kind == "end" else repr(self.text[:40])


class FclText:
    """Reads a text token by token, with one token in view.

    Comments are those of IEC 61131-3, ``(* *)``, and of its readers: ``/* */``, ``//``, ``#``, and
    lines that begin with ``%``.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._line = 1
        self._line_start = 0
        self._end = 0
        self.next = self._read()

    def take(self) -> Token:
        """The token in view; the next comes into view."""
        token = self.next
        self._end = token.offset + len(token.text)
        self.next = self._read()
        return token

    def accept(self, *keys: str) -> bool:
        """Take the next word or mark if it is one of these."""
        if self.next.key in keys and self.next.kind != "number":
            self.take()
            return True
        return False

    def expect(self, *keys: str) -> Token:
        """Take one of these words or marks.

        Raises:
            InvalidFuzzyFile: Something else comes.
        """
        if self.next.key not in keys or self.next.kind == "number":
            self.fail(" or ".join(keys[:12]))
        return self.take()

    def name(self, what: str) -> Token:
        """Take a word that names something."""
        if self.next.kind != "word":
            self.fail(f"the name of {what}")
        return self.take()

    def number(self) -> float:
        """Take a finite number."""
        if self.next.kind != "number":
            self.fail("a number")
        token = self.take()
        value = parse_number(token.text, token.position)
        if not isfinite(value):
            raise malformed(token.position, f"expected a finite number, got {token.text[:40]}")
        return value

    def numbers(self) -> list[float]:
        """Take all the numbers that come."""
        values = []
        while self.next.kind == "number":
            values.append(self.number())
        return values

    def rest_of_line(self, line: int, *stops: str) -> str:
        """Take what is left of a line, up to one of the words in ``stops``."""
        start = self.next.offset
        end = start
        while (
            self.next.position.line == line
            and self.next.kind != "end"
            and self.next.key not in stops
        ):
            self.take()
            end = self._end
            if end - start > MAX_LINE:
                self.fail(f"at most {MAX_LINE} characters in this line")
        return self._text[start:end].strip().rstrip(";").rstrip()

    def fail(self, expected: str) -> NoReturn:
        """Refuse the token in view.

        Raises:
            InvalidFuzzyFile: Always.
        """
        raise malformed(self.next.position, f"expected {expected}, got {self.next}")

    def _read(self) -> Token:
        self._skip()
        position = Position(self._line, self._at - self._line_start + 1)
        match = _TOKEN.match(self._text, self._at)
        if match is None:
            return Token("end", "", "", self._at, position)
        self._at = match.end()
        kind = match.lastgroup or ""
        key = "" if kind == "number" else match[0].upper()
        return Token(kind, match[0], key, match.start(), position)

    def _skip(self) -> None:
        text = self._text
        while True:
            at = self._at
            if space := _SPACE.match(text, at):
                self._pass(space.end())
            elif text.startswith(("(*", "/*"), at):
                end = text.find("*)" if text[at] == "(" else "*/", at + 2)
                if end < 0:
                    position = Position(self._line, at - self._line_start + 1)
                    raise malformed(position, "a comment that does not end")
                self._pass(end + 2)
            elif text.startswith(("//", "#"), at) or (text.startswith("%", at) and self._is_first):
                end_of_line = _LINE_END.match(text, at)
                self._at = end_of_line.end() if end_of_line else len(text)
            else:
                return

    @property
    def _is_first(self) -> bool:
        return not self._text[self._line_start : self._at].strip()

    def _pass(self, end: int) -> None:
        lines = self._text.count("\n", self._at, end)
        if lines:
            self._line += lines
            self._line_start = self._text.rindex("\n", self._at, end) + 1
        self._at = end
