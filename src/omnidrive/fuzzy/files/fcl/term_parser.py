"""Terms of a text in the fuzzy control language."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from omnidrive.files.position import Position
from omnidrive.fuzzy.files.fcl.lexer import TERMS, Token, TokenStream
from omnidrive.fuzzy.files.fcl.linear_form import LinearForm, linear_form
from omnidrive.fuzzy.files.fll.term_semantics import TERM_CLASSES
from omnidrive.fuzzy.membership import MAX_POINTS
from omnidrive.fuzzy.position import LocatedText, malformed


class PointsEntry(NamedTuple):
    """Points ``(x, degree) (x, degree) ...``, flat."""

    coordinates: tuple[float, ...]
    position: Position


class SingletonsEntry(NamedTuple):
    """Points ``SINGLETONS (x, degree) ...`` of a set that is 0 elsewhere, flat."""

    coordinates: tuple[float, ...]
    position: Position


class NamedShapeEntry(NamedTuple):
    """Shape of jFuzzyLogic: a keyword and parameters."""

    keyword: str
    parameters: tuple[float, ...]
    position: Position


class FllTermEntry(NamedTuple):
    """Class and parameters of fuzzylite."""

    kind: LocatedText
    parameters: tuple[LocatedText, ...]
    inputs: int
    """Number of inputs declared before the term."""


TermValue = float | PointsEntry | SingletonsEntry | NamedShapeEntry | FllTermEntry | LinearForm


class TermEntry(NamedTuple):
    """Statement ``TERM name := value``; a number is the value of a singleton."""

    name: str
    position: Position
    value: TermValue


def term_value(tokens: TokenStream, inputs: Collection[str]) -> TermValue:
    """Consume the value of a term.

    Args:
        tokens: The tokens.
        inputs: Names of the inputs declared before the term.

    Raises:
        InvalidFuzzyFile: The syntax is wrong, or the kind of value is not supported.
    """
    if tokens.next.kind == "number":
        return tokens.number()
    if tokens.next.key == "(":
        start = tokens.next.position
        return PointsEntry(_points(tokens), start)
    kind = tokens.name("a number, points, or a shape")
    if kind.key in TERMS and kind.text not in TERM_CLASSES:  # Cosine is one of fuzzylite
        values = []
        while tokens.next.key != ";" and (tokens.next.kind in {"number", "word"}):
            values.append(_number(tokens))
        return NamedShapeEntry(kind.key, tuple(values), kind.position)
    if kind.key == "SINGLETONS":
        return SingletonsEntry(_points(tokens), kind.position)
    if kind.key == "FUNCTION" or kind.text in inputs:
        variable = LinearForm(0.0, {kind.text: 1.0}, {kind.text: kind.position})
        return linear_form(tokens) if kind.key == "FUNCTION" else variable
    return _fll_term(tokens, kind, len(inputs))


def _number(tokens: TokenStream) -> float:
    """Consume a number; refuse a variable, on which the set would depend."""
    token = tokens.next
    if token.kind == "word":
        raise malformed(
            token.position,
            f"the variable {token.text[:40]!r} in a set is not supported, because the set "
            "would change with it; write a number",
        )
    return tokens.number()


def _points(tokens: TokenStream) -> tuple[float, ...]:
    coordinates: list[float] = []
    start = tokens.next.position
    while tokens.accept("("):
        coordinates.append(_number(tokens))
        tokens.expect(",")
        coordinates.append(_number(tokens))
        tokens.expect(")")
        if len(coordinates) > 2 * MAX_POINTS:
            raise malformed(start, f"more than {MAX_POINTS} points")
    return tuple(coordinates)


def _fll_term(tokens: TokenStream, kind: Token, inputs: int) -> FllTermEntry:
    if kind.text not in TERM_CLASSES:
        known = ", ".join((*TERMS, "SINGLETONS", "FUNCTION", *TERM_CLASSES))
        raise malformed(
            kind.position, f"a term {kind.text[:40]!r} is not supported, only points, {known}"
        )
    parameters = []
    while tokens.next.kind == "number" or tokens.next.key in {"INF", "+", "-"}:
        sign = tokens.take() if tokens.next.key in {"+", "-"} else None
        if sign is not None and tokens.next.key != "INF":
            tokens.fail("a number")
        token = tokens.take()
        parameters.append(LocatedText((sign.text if sign else "") + token.text, token.position))
    return FllTermEntry(LocatedText(kind.text, kind.position), tuple(parameters), inputs)
