"""Rules as text: ``if error is PB and derror is not PB then kp is NB with 0.5``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple, NoReturn

from omnidrive.errors import InvalidInput
from omnidrive.files.position import Position
from omnidrive.fuzzy.checks import MAX_NAME
from omnidrive.fuzzy.position import malformed, parse_number
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
"""Maximum number of characters of a rule."""

RESERVED = frozenset({"if", "then", "is", "and", "or", "with", *HEDGES})
"""Keywords, in lower case; as names they must be quoted."""

_PLAIN = r"""[^\s,():;'"]+"""
_TOKEN = re.compile(rf"\s*(?:(?P<quoted>'(?:[^']|'')*')|(?P<mark>[,()])|(?P<word>{_PLAIN}))")


def parse_rule(text: str, position: Position | None = None) -> Rule:
    """Return the rule that a text denotes.

    The grammar is ``if ANTECEDENT then CONSEQUENTS [with WEIGHT]``, where

    - the antecedent combines propositions ``VARIABLE is [HEDGES] SET`` by ``and``, ``or`` and
      parentheses; ``and`` binds tighter than ``or``;
    - hedges are not, very, somewhat, extremely and seldom, and apply from the right; ``any``
      replaces the set: ``x is any`` is always true, and is read as ``Is("x", "", ("any",))``;
    - ``not`` may also precede the variable, but not a group of several propositions;
    - consequents, ``VARIABLE is [not] SET``, are separated by ``and`` or a comma;
    - the weight may also be written in Matlab's notation, ``(0.5)``.

    Keywords are accepted in any case. A name consists of any characters except spaces, commas,
    parentheses, colons, semicolons and quotes; other names, and names equal to keywords, are
    written in single quotes, with ``''`` for a quote.

    Nested groups with the same connective are merged: "a and (b and c)" is one :class:`And` of
    three parts.

    Args:
        text: At most :data:`MAX_LENGTH` characters, on one or several lines.
        position: Position of the first character in its file, for messages; None: line 1,
            column 1.

    Raises:
        InvalidFuzzyFile: The text is not a rule; the message names the position and what was
            expected.
    """
    start = position or Position(1, 1)
    if len(text) > MAX_LENGTH:
        raise malformed(start, f"a rule has at most {MAX_LENGTH} characters, got {len(text)}")
    return _Parser(text, start).rule()


def rule_text(rule: Rule) -> str:
    """Return the text of a rule, which :func:`parse_rule` reads as the same rule.

    The antecedent is :func:`normalised`.

    Raises:
        InvalidInput: The text is longer than :data:`MAX_LENGTH`, or the antecedent is nested too
            deeply.
    """
    consequents = " and ".join(map(_proposition_text, rule.consequents))
    text = f"if {_text(normalised(rule.antecedent))} then {consequents}"
    if rule.weight != 1.0:
        text += f" with {float(rule.weight)!r}"
    if len(text) > MAX_LENGTH:
        raise InvalidInput(
            f"the rule {text[:40]!r}... has {len(text)} characters, more than the maximum of "
            f"{MAX_LENGTH}; split it at an 'or'"
        )
    return text


def normalised(antecedent: Antecedent) -> Antecedent:
    """Return the equivalent antecedent without groups of one and nested equal connectives.

    Raises:
        InvalidInput: The antecedent is nested more than ``MAX_DEPTH`` deep, or a group is empty.
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
        return _proposition_text(antecedent)
    if isinstance(antecedent, Or):
        return " or ".join(map(_text, antecedent.parts))
    return " and ".join(
        f"({_text(p)})" if isinstance(p, Or) else _text(p) for p in antecedent.parts
    )


def _proposition_text(proposition: Is) -> str:
    name = (_name_text(proposition.set),) if proposition.set else ()
    return " ".join((_name_text(proposition.variable), "is", *proposition.hedges, *name))


def _name_text(name: str) -> str:
    if re.fullmatch(_PLAIN, name) and name.lower() not in RESERVED:
        return name
    return "'" + name.replace("'", "''") + "'"


class _Token(NamedTuple):
    key: str
    """Keyword in lower case, punctuation mark or ``end``; empty for a name."""
    text: str
    """Text as written; for a quoted name, without the quotes."""
    offset: int

    def __str__(self) -> str:
        return "the end" if self.key == "end" else repr(self.text[:40])


class _Parser:
    """Recursive descent parser; the nesting of parentheses is bounded."""

    def __init__(self, text: str, start: Position) -> None:
        self._text = text
        self._start = start
        self._tokens = list(self._tokenize())
        self._next = 0

    def rule(self) -> Rule:
        """Parse the whole text."""
        self._expect("if", "'if'")
        antecedent = self._disjunction(0)
        if not self._accept("then"):
            self._fail_at_next("'and', 'or' or 'then'")
        consequents = [self._proposition("an output")]
        while self._accept("and", ","):
            consequents.append(self._proposition("an output"))
        weight = self._weight()
        self._expect("end", "the end of the rule")
        try:
            return Rule(normalised(antecedent), tuple(consequents), weight)
        except InvalidInput as error:
            raise malformed(self._start, str(error)) from None

    def _disjunction(self, depth: int) -> Antecedent:
        parts = [self._conjunction(depth)]
        while self._accept("or"):
            parts.append(self._conjunction(depth))
        return parts[0] if len(parts) == 1 else Or(tuple(parts))

    def _conjunction(self, depth: int) -> Antecedent:
        parts = [self._operand(depth)]
        while self._accept("and"):
            parts.append(self._operand(depth))
        return parts[0] if len(parts) == 1 else And(tuple(parts))

    def _operand(self, depth: int) -> Antecedent:
        negation: tuple[Hedge, ...] = ()
        while self._accept("not"):
            negation += ("not",)
        opening = self._tokens[self._next]
        if not self._accept("("):
            return self._proposition("an input").hedged(negation)
        if depth >= MAX_DEPTH:
            self._fail(opening, f"parentheses are nested more than {MAX_DEPTH} deep")
        inner = self._disjunction(depth + 1)
        if not self._accept(")"):
            self._fail_at_next("'and', 'or' or ')'")
        if not negation:
            return inner
        if not isinstance(inner, Is):
            self._fail(
                opening,
                "'not' before a group is not supported, because 'or' may differ from the dual of "
                "'and'; write it before each set: not (A and B) is not A or not B",
            )
        return inner.hedged(negation)

    def _proposition(self, what: str) -> Is:
        variable = self._name(what)
        self._expect("is", f"'is' after {variable[:40]!r}")
        hedges: list[Hedge] = []
        while (key := self._tokens[self._next].key) in HEDGES:
            self._next += 1
            hedges.append(key)
            if key == "any":
                if self._tokens[self._next].key == "":
                    self._fail_at_next("no set after 'any'")
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
                self._fail_at_next("'and', 'with' or the end of the rule")
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
            self._fail_at_next(what)
        return token

    def _fail_at_next(self, expected: str) -> NoReturn:
        token = self._tokens[self._next]
        hint = ""
        if token.key in RESERVED and expected.startswith("the name"):
            hint = "; quote a name that is a keyword"
        self._fail(token, f"expected {expected}, got {token}{hint}")

    def _fail(self, token: _Token, what: str) -> NoReturn:
        raise malformed(self._position(token), what)

    def _position(self, token: _Token) -> Position:
        return self._start.after(self._text[: token.offset])

    def _tokenize(self) -> Iterator[_Token]:
        text = self._text.rstrip()
        at = 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                at += len(text[at:]) - len(text[at:].lstrip())
                token = _Token("", text[at], at)
                if text[at] == "'":
                    self._fail(token, 'the quoted name is not closed: expected another "\'"')
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
