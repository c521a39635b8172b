"""Sets, functions and ranges of variables in the fuzzy control language."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from omnidrive.errors import InvalidInput, suggestion
from omnidrive.fuzzy.checks import MAX_NUMBER
from omnidrive.fuzzy.files.assembly import locate_errors, singleton, values_of
from omnidrive.fuzzy.files.fcl.lexer import TERMS
from omnidrive.fuzzy.files.fcl.linear_form import LinearForm
from omnidrive.fuzzy.files.fcl.parser import VariableEntry
from omnidrive.fuzzy.files.fcl.term_parser import (
    NamedShapeEntry,
    PointsEntry,
    SingletonsEntry,
    TermEntry,
)
from omnidrive.fuzzy.files.fll.term_semantics import read_term
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.variables import FuzzySet, InputVariable, LinearFunction

CORNERS: dict[str, tuple[float, ...]] = {
    "trimf": (0.0, 1.0, 0.0),
    "trapmf": (0.0, 1.0, 1.0, 0.0),
    "linsmf": (0.0, 1.0),
    "linzmf": (1.0, 0.0),
}
"""Degrees at the corners of the shapes that points can represent."""


def simplest_shape(function: Membership) -> Membership:
    """Return the triangle, trapezoid or ramp that equals a ``pointsmf``, or else ``function``.

    A point at either end that only continues the constant beyond it is ignored.
    """
    if function.shape != "pointsmf":
        return function
    x, y = function.parameters[::2], function.parameters[1::2]
    first, last = 0, len(x)
    while last - first > 1 and y[first] == y[first + 1]:
        first += 1
    while last - first > 1 and y[last - 1] == y[last - 2]:
        last -= 1
    x, y = x[first:last], y[first:last]
    for shape, degrees in CORNERS.items():
        if y == degrees:
            return Membership(shape, x)
    return function


def is_dsigm(a1: float, c1: float, a2: float, c2: float) -> bool:
    """Return whether jFuzzyLogic's DSIGM equals a ``dsigmf``: its difference is never negative."""
    return a1 == a2 and a1 * c1 <= a2 * c2


def sets_of(
    variable: VariableEntry, inputs: tuple[str, ...], *, is_input: bool
) -> list[FuzzySet | LinearFunction]:
    """Return the sets, or the functions of the ``inputs``, that the terms of a variable denote."""
    sets: list[FuzzySet | LinearFunction] = []
    are_singletons = is_input or any(
        isinstance(term.value, SingletonsEntry) for term in variable.terms
    )
    for term in variable.terms:
        with locate_errors(term.position):
            each = _set(term, inputs, are_singletons)
            if is_input and isinstance(each, LinearFunction):
                raise InvalidInput(f"{term.name!r}: the terms of an input must be fuzzy sets")
            if sets and type(each) is not type(sets[0]):
                raise InvalidInput(f"output {variable.name!r} mixes fuzzy sets and functions")
        sets.append(each)
    return sets


def _set(term: TermEntry, inputs: tuple[str, ...], is_singleton: bool) -> FuzzySet | LinearFunction:
    value = term.value
    if isinstance(value, float):
        return singleton(term.name, value) if is_singleton else LinearFunction(term.name, value)
    if isinstance(value, LinearForm):
        return _function(term.name, value, inputs)
    if isinstance(value, SingletonsEntry):
        return FuzzySet(term.name, _singletons(value))
    if isinstance(value, PointsEntry):
        with locate_errors(value.position):
            function = Membership("pointsmf", value.coordinates)
        return FuzzySet(term.name, function)
    if isinstance(value, NamedShapeEntry):
        return FuzzySet(term.name, _named_shape(value))
    return read_term(term.name, value.kind, value.parameters, value.inputs)


def _function(name: str, form: LinearForm, inputs: tuple[str, ...]) -> LinearFunction:
    for variable, position in form.positions.items():
        if variable not in inputs:
            hint = suggestion(variable, inputs)
            raise malformed(position, f"FUNCTION: there is no input {variable[:40]!r}{hint}")
    coefficients = tuple(form.coefficients.get(each, 0.0) for each in inputs)
    return LinearFunction(name, form.constant, coefficients if form.coefficients else ())


def _singletons(entry: SingletonsEntry) -> Membership:
    x, y = entry.coordinates[::2], entry.coordinates[1::2]
    if len(set(x)) < len(x):
        raise malformed(entry.position, "SINGLETONS: a point appears twice")
    points = [p for a, b in sorted(zip(x, y, strict=True)) for p in (a, 0.0, a, b, a, 0.0)]
    return Membership("pointsmf", tuple(points))


def _named_shape(entry: NamedShapeEntry) -> Membership:
    shape, order = TERMS[entry.keyword]
    values = entry.parameters
    if len(values) != len(order):
        raise malformed(
            entry.position, f"{entry.keyword}: expected {len(order)} numbers, got {len(values)}"
        )
    if entry.keyword == "DSIGM" and not is_dsigm(*values):
        raise malformed(
            entry.position,
            "DSIGM: its difference becomes negative, which jFuzzyLogic cuts off; supported are "
            "only equal slopes with the first sigmoid to the left",
        )
    with locate_errors(entry.position):
        return Membership(shape, tuple(values[k] for k in order))


def simplified(
    variable: VariableEntry, sets: list[FuzzySet | LinearFunction]
) -> tuple[FuzzySet, ...]:
    """Return the fuzzy sets, with points replaced by the shape that they form."""
    return tuple(
        FuzzySet(each.name, simplest_shape(each.upper))
        if isinstance(term.value, PointsEntry)
        else each
        for term, each in zip(variable.terms, sets, strict=True)
        if isinstance(each, FuzzySet)
    )


def limits_of(
    variable: VariableEntry,
    sets: list[FuzzySet | LinearFunction],
    inputs: Sequence[InputVariable],
) -> tuple[float, float]:
    """Return the range, or its default.

    It is that of jFuzzyLogic, the union of the supports of the sets; the range of the values of
    linear functions of the ``inputs``; or unlimited for an input without sets.
    """
    if variable.range is not None:
        return variable.range
    functions = [each for each in sets if isinstance(each, LinearFunction)]
    if functions:
        return values_of(functions, inputs)
    if not sets and not inputs:
        return -MAX_NUMBER, MAX_NUMBER
    supports = [_support(each) for each in sets if isinstance(each, FuzzySet)]
    known = [each for each in supports if each is not None]
    if not known or len(known) < len(supports):
        raise malformed(
            variable.position, f"{variable.name[:40]!r}: expected RANGE := (MIN .. MAX)"
        )
    low, high = min(low for low, _ in known), max(high for _, high in known)
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def _support(each: FuzzySet) -> tuple[float, float] | None:
    """Return the interval that jFuzzyLogic uses as the support of a set; None: unknown."""
    shape, p = each.upper.shape, each.upper.parameters
    if each.upper.is_piecewise_linear:
        return each.upper.vertices[0][0], each.upper.vertices[-1][0]
    if shape == "cosinemf":
        return p[1] - p[0], p[1] + p[0]
    if shape in {"gaussmf", "gauss2mf"}:
        ends = [c + side * abs(s) for s, c in zip(p[::2], p[1::2], strict=True) for side in (-4, 4)]
        return min(ends), max(ends)
    if shape == "sigmf" and p[0] != 0.0 and isfinite(9.0 / p[0]):
        half_width = 9.0 / abs(p[0])
        return p[1] - half_width, p[1] + half_width
    return None
