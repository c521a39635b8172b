"""Expressions after FUNCTION in the fuzzy control language, reduced to linear functions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, NoReturn

from omnidrive.files.position import Position
from omnidrive.fuzzy.files.fcl.lexer import Token, TokenStream
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.rules import MAX_DEPTH
from omnidrive.fuzzy.system import MAX_VARIABLES

_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "EXP": math.exp,
    "LN": math.log,
    "LOG": math.log10,
    "SIN": math.sin,
    "COS": math.cos,
    "TAN": math.tan,
    "ABS": abs,
}
_READ = "only linear functions of the inputs are read, such as 2*x - y + 1"


class LinearForm(NamedTuple):
    """The sum of a constant and of coefficients times variables."""

    constant: float
    coefficients: dict[str, float]
    """By the name of the variable."""
    positions: dict[str, Position]
    """First position of each variable."""


def linear_form(tokens: TokenStream) -> LinearForm:
    """Consume an expression and return the linear function that it equals.

    The grammar is jFuzzyLogic's: ``+ - * / ^ %``, parentheses, and EXP, LN, LOG (to base 10), SIN,
    COS, TAN and ABS; the last six and ``^ %`` are evaluated for constants.

    Raises:
        InvalidFuzzyFile: The syntax is wrong, the expression is not linear, or undefined.
    """
    return _Parser(tokens).sum(0)


class _Parser:
    """Recursive descent parser; the nesting of parentheses is bounded."""

    def __init__(self, tokens: TokenStream) -> None:
        self._tokens = tokens

    def sum(self, depth: int) -> LinearForm:
        """Parse terms joined by ``+`` and ``-``."""
        tokens = self._tokens
        total = self._product(depth)
        # in "x -1" the sign belongs to the number
        while tokens.next.key in {"+", "-"} or (
            tokens.next.kind == "number" and tokens.next.text[0] in "+-"
        ):
            sign = -1.0 if tokens.accept("-") else 1.0
            tokens.accept("+")
            term = self._product(depth)
            total = LinearForm(total.constant + sign * term.constant, *total[1:])
            for name, value in term.coefficients.items():
                total.coefficients[name] = total.coefficients.get(name, 0.0) + sign * value
                total.positions.setdefault(name, term.positions[name])
            if len(total.coefficients) > MAX_VARIABLES:
                tokens.fail(f"at most {MAX_VARIABLES} variables in a function")
        return total

    def _product(self, depth: int) -> LinearForm:
        left = self._power(depth)
        while self._tokens.next.key in {"*", "/"}:
            operator = self._tokens.take()
            right = self._power(depth)
            if operator.key == "*" and left.coefficients and not right.coefficients:
                left, right = right, left
            if right.coefficients and (operator.key == "/" or left.coefficients):
                self._refuse_nonlinear(operator)
            if operator.key == "*":
                left = _scaled(right, left.constant)
            elif right.constant == 0.0:
                raise malformed(operator.position, "FUNCTION: division by 0")
            else:
                left = LinearForm(
                    left.constant / right.constant,
                    {name: each / right.constant for name, each in left.coefficients.items()},
                    left.positions,
                )
        return left

    def _power(self, depth: int) -> LinearForm:
        left = self._atom(depth)
        while self._tokens.next.key in {"^", "%"}:
            operator = self._tokens.take()
            right = self._atom(depth)
            if left.coefficients or right.coefficients:
                self._refuse_nonlinear(operator)
            compute = math.pow if operator.key == "^" else math.fmod
            left = _constant(operator, compute, left.constant, right.constant)
        return left

    def _atom(self, depth: int) -> LinearForm:
        tokens = self._tokens
        if tokens.next.kind == "number":
            return LinearForm(tokens.number(), {}, {})
        start = tokens.next
        if tokens.accept("-", "+"):
            if depth >= MAX_DEPTH:
                raise malformed(start.position, f"FUNCTION is nested more than {MAX_DEPTH} deep")
            return _scaled(self._atom(depth + 1), -1.0 if start.key == "-" else 1.0)
        if start.key in _FUNCTIONS:
            tokens.take()
            if tokens.next.key != "(":
                tokens.fail("'('")
            argument = self._atom(depth)
            if argument.coefficients:
                self._refuse_nonlinear(start)
            return _constant(start, _FUNCTIONS[start.key], argument.constant)
        if tokens.accept("("):
            if depth >= MAX_DEPTH:
                raise malformed(start.position, f"FUNCTION is nested more than {MAX_DEPTH} deep")
            inner = self.sum(depth + 1)
            tokens.expect(")")
            return inner
        name = tokens.name("an input, a number or '('")
        return LinearForm(0.0, {name.text: 1.0}, {name.text: name.position})

    def _refuse_nonlinear(self, operator: Token) -> NoReturn:
        raise malformed(
            operator.position, f"FUNCTION: {operator} makes this function nonlinear; {_READ}"
        )


def _scaled(form: LinearForm, factor: float) -> LinearForm:
    return LinearForm(
        factor * form.constant,
        {name: factor * each for name, each in form.coefficients.items()},
        form.positions,
    )


def _constant(operator: Token, compute: Callable[..., float], *arguments: float) -> LinearForm:
    """Return the value of a function of constants."""
    try:
        return LinearForm(compute(*arguments), {}, {})
    except (ValueError, OverflowError):
        raise malformed(operator.position, f"FUNCTION: {operator} has no finite value") from None
