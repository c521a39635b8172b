"""Tokens and keywords of the fuzzy control language."""

from __future__ import annotations

import re
from math import isfinite
from typing import Literal, NamedTuple, NoReturn

from omnidrive.files.position import Position
from omnidrive.fuzzy.position import malformed, parse_number
from omnidrive.fuzzy.rule_text import RESERVED as RULE_KEYWORDS

_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]+)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?![\w])"
_TOKEN = re.compile(rf"(?P<number>{_NUMBER})|(?P<word>[^\W\d]\w*)|(?P<mark>:=|\.\.|.)", re.DOTALL)
_SPACE = re.compile(r"\s+")
_LINE_END = re.compile(r"[^\n]*")

MAX_LINE = 1000
"""Maximum length of a name that extends to the end of its line."""

Dialect = Literal["iec", "fuzzylite"]


class Keywords(NamedTuple):
    """Keywords of the operators in a dialect, by the names in this package."""

    conjunctions: dict[str, str]
    disjunctions: dict[str, str]
    aggregations: dict[str, str]
    methods: dict[str, str]


IEC = Keywords(
    {
        "min": "MIN",
        "prod": "PROD",
        "lukasiewicz": "BDIF",
        "drastic": "DMIN",
        "nilpotent": "NIPMIN",
        "hamacher": "HAMACHER",
    },
    {
        "max": "MAX",
        "probor": "ASUM",
        "bsum": "BSUM",
        "drastic": "DMAX",
        "nilpotent": "NIPMAX",
        "einstein": "EINSTEIN",
    },
    {"max": "MAX", "bsum": "BSUM", "probor": "PROBOR", "sum": "SUM"},
    {"centroid": "COG", "bisector": "COA", "mom": "MM", "lm": "LM", "rm": "RM", "wtaver": "COGS"},
)
"""IEC 61131-7 with the additions of jFuzzyLogic."""

_FUZZYLITE_DISJUNCTIONS = {
    "max": "MAX",
    "probor": "ASUM",
    "bsum": "BSUM",
    "drastic": "DSUM",
    "einstein": "ESUM",
    "hamacher": "HSUM",
    "nilpotent": "NMAX",
}
FUZZYLITE = Keywords(
    {
        "min": "MIN",
        "prod": "PROD",
        "lukasiewicz": "BDIF",
        "drastic": "DPROD",
        "einstein": "EPROD",
        "hamacher": "HPROD",
        "nilpotent": "NMIN",
    },
    _FUZZYLITE_DISJUNCTIONS,
    {**_FUZZYLITE_DISJUNCTIONS, "sum": "UnboundedSum"},
    {**IEC.methods, "wtsum": "COGSS"},
)

ACTIVATIONS = {"min": "MIN", "prod": "PROD"}
"""Keywords of the implications in both dialects."""

KEYWORDS: dict[Dialect, Keywords] = {"iec": IEC, "fuzzylite": FUZZYLITE}

TERMS: dict[str, tuple[str, tuple[int, ...]]] = {
    "TRIAN": ("trimf", (0, 1, 2)),
    "TRAPE": ("trapmf", (0, 1, 2, 3)),
    "GAUSS": ("gaussmf", (1, 0)),
    "GAUSS2": ("gauss2mf", (1, 0, 3, 2)),
    "GBELL": ("gbellmf", (0, 1, 2)),
    "SIGM": ("sigmf", (0, 1)),
    "DSIGM": ("dsigmf", (0, 1, 2, 3)),
    "COSINE": ("cosinemf", (0, 1)),
}
"""jFuzzyLogic's keywords of terms: the shape, and for each of its parameters the index of
jFuzzyLogic's parameter."""

SECTIONS = ("VAR_INPUT", "VAR_OUTPUT", "FUZZIFY", "DEFUZZIFY", "RULEBLOCK", "END_FUNCTION_BLOCK")
BLOCK_KEYWORDS = ("AND", "OR", "ACT", "ACCU", "ENABLED", "RULE", "END_RULEBLOCK")

RESERVED = RULE_KEYWORDS | {
    each.lower()
    for each in (
        *SECTIONS,
        *BLOCK_KEYWORDS,
        *("FUNCTION_BLOCK", "END_VAR", "END_FUZZIFY", "END_DEFUZZIFY", "VAR", "REAL"),
        *("TERM", "RANGE", "METHOD", "DEFAULT", "LOCK", "NC", "TRUE", "FALSE"),
        *("TRIAN", "TRAPE", "GAUSS", "GAUSS2", "GBELL", "SIGM", "DSIGM", "COSINE"),
        *("SINGLETONS", "FUNCTION", "EXP", "LN", "LOG", "SIN", "COS", "TAN", "ABS"),
        *(word for table in IEC for word in table.values()),
    )
}
"""Words that are not valid as names, in lower case."""


class Token(NamedTuple):
    """Word, number, punctuation mark or the end of the text."""

    kind: str
    """``word``, ``number``, ``mark`` or ``end``."""
    text: str
    """As written."""
    key: str
    """A word or mark in upper case, for comparison with keywords; empty for a number."""
    offset: int
    """Index of the first character in the text."""
    position: Position

    def __str__(self) -> str:
        return "the end" if self.kind == "end" else repr(self.text[:40])


class TokenStream:
    """Tokens of a text, with one token of lookahead.

    Comments are those of IEC 61131-3, ``(* *)``, and of its implementations: ``/* */``, ``//``,
    ``#``, and lines that begin with ``%``.

    Attributes:
        next: The lookahead token.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._line = 1
        self._line_start = 0
        self._end = 0
        self.next = self._read()

    def take(self) -> Token:
        """Consume the next token and return it."""
        token = self.next
        self._end = token.offset + len(token.text)
        self.next = self._read()
        return token

    def accept(self, *keys: str) -> bool:
        """Consume the next token if it is one of these words or marks; return whether it is."""
        if self.next.key in keys and self.next.kind != "number":
            self.take()
            return True
        return False

    def expect(self, *keys: str) -> Token:
        """Consume one of these words or marks.

        Raises:
            InvalidFuzzyFile: Another token comes next.
        """
        if self.next.key not in keys or self.next.kind == "number":
            self.fail(" or ".join(keys[:12]))
        return self.take()

    def name(self, what: str) -> Token:
        """Consume a word that is the name of ``what``."""
        if self.next.kind != "word":
            self.fail(f"the name of {what}")
        return self.take()

    def number(self) -> float:
        """Consume a finite number."""
        if self.next.kind != "number":
            self.fail("a number")
        token = self.take()
        value = parse_number(token.text, token.position)
        if not isfinite(value):
            raise malformed(token.position, f"expected a finite number, got {token.text[:40]}")
        return value

    def rest_of_line(self, line: int, *stops: str) -> str:
        """Consume the rest of a line, up to the first of the words in ``stops``."""
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
        """Refuse the next token.

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
        """Skip blanks and comments."""
        text = self._text
        while True:
            at = self._at
            if space := _SPACE.match(text, at):
                self._skip_to(space.end())
            elif text.startswith(("(*", "/*"), at):
                end = text.find("*)" if text[at] == "(" else "*/", at + 2)
                if end < 0:
                    position = Position(self._line, at - self._line_start + 1)
                    raise malformed(position, "the comment is not closed")
                self._skip_to(end + 2)
            elif text.startswith(("//", "#"), at) or (
                text.startswith("%", at) and self._is_line_start
            ):
                end_of_line = _LINE_END.match(text, at)
                self._at = end_of_line.end() if end_of_line else len(text)
            else:
                return

    @property
    def _is_line_start(self) -> bool:
        return not self._text[self._line_start : self._at].strip()

    def _skip_to(self, end: int) -> None:
        lines = self._text.count("\n", self._at, end)
        if lines:
            self._line += lines
            self._line_start = self._text.rindex("\n", self._at, end) + 1
        self._at = end
