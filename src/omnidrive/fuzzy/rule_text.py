"""Rules as text: ``if error is PB and derror is not PB then kp is NB with 0.5``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple, NoReturn

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.position import Position, malformed, parse_number
from omnidrive.fuzzy.rules import (
    HEDGES,
    MAX_DEPTH,
    And,
    Antecedent,
    Hedge,
    Is,
    Or,
    Rule,
    propositions,
)

MAX_LENGTH = 10_000
"""Most characters of one rule."""

MAX_NAME = 200
"""Most characters of a name."""

RESERVED = frozenset({"if", "then", "is", "and", "or", "with", *HEDGES})
"""Words that are names only in quotes; in any case, upper or lower."""

_PLAIN = r"""[^\s,():;'"]+"""
_TOKEN = re.compile(rf"\s*(?:(?P<quoted>'(?:[^']|'')*')|(?P<mark>[,()])|(?P<word>{_PLAIN}))")


def parse_rule(text: str, position: Position | None = None) -> Rule:
    """Rule that a text says.

    ``if CONDITION then CONCLUSIONS [with WEIGHT]``, where

    - a antecedent joins ``VARIABLE is [HEDGES] SET`` by ``and``, ``or`` and parentheses; ``and``
      binds tighter;
    - hedges are not, very, somewhat, extremely, seldom, and apply from the right; ``any`` stands
      for them and the set: ``x is any`` always holds, and is ``Is("x", "", ("any",))``;
    - ``not`` may also stand before the variable, though not before a group of several;
    - consequents, ``VARIABLE is [not] SET``, are joined by ``and`` or a comma;
    - the weight may also be written as Matlab does, ``(0.5)``.

    Keywords are read in any case. A name is made of any characters but spaces, commas,
    parentheses, colons, semicolons and quotes; other names, and those that are keywords, are
    written in single quotes, with ``''`` for a quote.

    What is nested in its own kind is joined: "a and (b and c)" is one :class:`And` of three.

    Args:
        text: At most :data:`MAX_LENGTH` characters; may have several lines.
        position: Of its first character, for messages; None: line 1, column 1.

    Raises:
        InvalidFuzzyFile: The text is no rule; the message says where, and what was expected.
    """
    start = position or Position(1, 1)
    if len(text) > MAX_LENGTH:
        raise malformed(start, f"a rule has at most {MAX_LENGTH} characters, got {len(text)}")
    return _Parser(text, start).rule()


def rule_text(rule: Rule) -> str:
    """Text of a rule, from which :func:`parse_rule` makes the same rule, :func:`normalised`.

    Raises:
        InvalidInput: It is longer than :data:`MAX_LENGTH`, or nested too deeply.
    """
    consequents = " and ".join(map(_is_text, rule.consequents))
    text = f"if {_text(normalised(rule.antecedent))} then {consequents}"
    if rule.weight != 1.0:
        text += f" with {float(rule.weight)!r}"
    if len(text) > MAX_LENGTH:
        raise InvalidInput(
            f"the rule {text[:40]!r}... has {len(text)} characters, more than the {MAX_LENGTH} "
            "that are read; split it at an 'or'"
        )
    return text


def normalised(antecedent: Antecedent) -> Antecedent:
    """The same antecedent with what is nested in its own kind joined, and no group of one.

    Raises:
        InvalidInput: It is nested more than ``MAX_DEPTH`` deep, or a group is empty.
    """
    for _ in propositions(antecedent):
        pass
    return _flat(antecedent)


def _flat(antecedent: Antecedent) -> Antecedent:
    if isinstance(antecedent, Is):
        return antecedent
    kind = type(antecedent)
    parts: list[Antecedent] = []
    for part in map(_flat, antecedent.parts):
        parts += part.parts if isinstance(part, kind) else (part,)
    return parts[0] if len(parts) == 1 else kind(tuple(parts))


def _text(antecedent: Antecedent) -> str:
    if isinstance(antecedent, Is):
        return _is_text(antecedent)
    if isinstance(antecedent, Or):
        return " or ".join(map(_text, antecedent.parts))
    return " and ".join(
        f"({_text(p)})" if isinstance(p, Or) else _text(p) for p in antecedent.parts
    )


def _is_text(term: Is) -> str:
    named = (_name_text(term.set),) if term.set else ()
    return " ".join((_name_text(term.variable), "is", *term.hedges, *named))


def _name_text(name: str) -> str:
    if re.fullmatch(_PLAIN, name) and name.lower() not in RESERVED:
        return name
    return "'" + name.replace("'", "''") + "'"


class _Token(NamedTuple):
    key: str
    """Keyword in lower case, mark, or ``end``; empty: a name."""
    text: str
    """As written; of a quoted name what is in the quotes."""
    offset: int

    def __str__(self) -> str:
        return "the end" if self.key == "end" else repr(self.text[:40])


class _Parser:
    """Recursive descent; parentheses bound its depth."""

    def __init__(self, text: str, start: Position) -> None:
        self._text = text
        self._start = start
        self._tokens = list(self._split())
        self._next = 0

    def rule(self) -> Rule:
        """The rule that the text is, to its end."""
        self._expect("if", "'if'")
        antecedent = self._any_of(0)
        if not self._accept("then"):
            self._refuse("'and', 'or' or 'then'")
        consequents = [self._term("an output")]
        while self._accept("and", ","):
            consequents.append(self._term("an output"))
        weight = self._weight()
        self._expect("end", "the end of the rule")
        try:
            return Rule(normalised(antecedent), tuple(consequents), weight)
        except InvalidInput as error:
            raise malformed(self._start, str(error)) from None

    def _any_of(self, depth: int) -> Antecedent:
        parts = [self._all_of(depth)]
        while self._accept("or"):
            parts.append(self._all_of(depth))
        return parts[0] if len(parts) == 1 else Or(tuple(parts))

    def _all_of(self, depth: int) -> Antecedent:
        parts = [self._part(depth)]
        while self._accept("and"):
            parts.append(self._part(depth))
        return parts[0] if len(parts) == 1 else And(tuple(parts))

    def _part(self, depth: int) -> Antecedent:
        negation: tuple[Hedge, ...] = ()
        while self._accept("not"):
            negation += ("not",)
        opening = self._tokens[self._next]
        if not self._accept("("):
            term = self._term("an input")
            return Is(term.variable, term.set, negation + term.hedges)
        if depth >= MAX_DEPTH:
            self._fail(opening, f"parentheses are nested more than {MAX_DEPTH} deep")
        inner = self._any_of(depth + 1)
        if not self._accept(")"):
            self._refuse("'and', 'or' or ')'")
        if not negation:
            return inner
        if not isinstance(inner, Is):
            self._fail(
                opening,
                "'not' before a group cannot be read, since it would need the 'or' to be the dual "
                "of the 'and'; write it before each set: not (A and B) is not A or not B",
            )
        return Is(inner.variable, inner.set, negation + inner.hedges)

    def _term(self, what: str) -> Is:
        variable = self._name(what)
        self._expect("is", f"'is' after {variable[:40]!r}")
        hedges: list[Hedge] = []
        while (key := self._tokens[self._next].key) in HEDGES:
            self._next += 1
            hedges.append(key)
            if key == "any":
                if self._tokens[self._next].key == "":
                    self._refuse("no set after 'any'")
                return Is(variable, "", tuple(hedges))
        return Is(variable, self._name(f"a set of {variable[:40]!r}"), tuple(hedges))

    def _name(self, what: str) -> str:
        token = self._expect("", f"the name of {what}")
        if not 1 <= len(token.text) <= MAX_NAME or not token.text.isprintable():
            self._fail(
                token,
                f"a name has 1 to {MAX_NAME} printable characters, got {token.text[:40]!r}",
            )
        return token.text

    def _weight(self) -> float:
        opened = self._accept("(")
        if not (opened or self._accept("with")):
            if self._tokens[self._next].key != "end":
                self._refuse("'and', 'with' or the end of the rule")
            return 1.0
        token = self._expect("", "a weight")
        weight = parse_number(token.text, self._position(token))
        if not 0.0 <= weight <= 1.0:
            self._fail(token, f"the weight of a rule must lie in [0, 1], got {weight:g}")
        if opened:
            self._expect(")", "')'")
        return weight

    def _accept(self, *keys: str) -> bool:
        found = self._tokens[self._next].key in keys
        self._next += found
        return found

    def _expect(self, key: str, what: str) -> _Token:
        token = self._tokens[self._next]
        if not self._accept(key):
            self._refuse(what)
        return token

    def _refuse(self, expected: str) -> NoReturn:
        token = self._tokens[self._next]
        hint = ""
        if token.key in RESERVED and expected.startswith("the name"):
            hint = "; a name that is a keyword is written in single quotes"
        self._fail(token, f"expected {expected}, got {token}{hint}")

    def _fail(self, token: _Token, what: str) -> NoReturn:
        raise malformed(self._position(token), what)

    def _position(self, token: _Token) -> Position:
        return self._start.after(self._text[: token.offset])

    def _split(self) -> Iterator[_Token]:
        text = self._text.rstrip()
        at = 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                at += len(text[at:]) - len(text[at:].lstrip())
                token = _Token("", text[at], at)
                if text[at] == "'":
                    self._fail(token, 'a quoted name does not end: expected another "\'"')
                self._fail(token, f"expected a name or keyword, got {token}")
            at = match.end()
            offset = match.start(match.lastgroup or 0)
            if match["quoted"]:
                yield _Token("", match["quoted"][1:-1].replace("''", "'"), offset)
            else:
                word = match["mark"] or match["word"]
                key = word.lower() if match["mark"] or word.lower() in RESERVED else ""
                yield _Token(key, word, offset)
        yield _Token("end", "", len(text))
