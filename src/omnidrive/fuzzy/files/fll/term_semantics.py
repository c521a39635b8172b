"""Fuzzy set or function that a term in the fuzzylite language describes."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from omnidrive.fuzzy.files.assembly import locate_errors
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.position import LocatedText, malformed, parse_number
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction


class TermClass(NamedTuple):
    """Membership function of a class of terms in fuzzylite."""

    shape: str
    order: tuple[int, ...]
    """For each parameter of the shape, the index of fuzzylite's parameter."""


TERMS: dict[str, TermClass] = {
    "Bell": TermClass("gbellmf", (1, 2, 0)),
    "Gaussian": TermClass("gaussmf", (1, 0)),
    "GaussianProduct": TermClass("gauss2mf", (1, 0, 3, 2)),
    "PiShape": TermClass("pimf", (0, 1, 2, 3)),
    "Sigmoid": TermClass("sigmf", (1, 0)),
    "SigmoidDifference": TermClass("dsigmf", (1, 0, 2, 3)),
    "SigmoidProduct": TermClass("psigmf", (1, 0, 2, 3)),
    "SShape": TermClass("smf", (0, 1)),
    "Trapezoid": TermClass("trapmf", (0, 1, 2, 3)),
    "Triangle": TermClass("trimf", (0, 1, 2)),
    "ZShape": TermClass("zmf", (0, 1)),
}
"""Classes of terms that have a shape of their own, by their names in fuzzylite."""

TERM_CLASSES = (
    *TERMS,
    *("Binary", "Ramp", "Rectangle", "Cosine", "Discrete", "Constant", "Linear"),
)
"""All supported classes of terms; fuzzylite's others have no equivalent."""


def read_term(
    name: str, kind: LocatedText, parameters: Sequence[LocatedText], inputs: int
) -> FuzzySet | LinearFunction:
    """Return the fuzzy set or the function of a term.

    Args:
        name: Name of the term.
        kind: Its class in fuzzylite.
        parameters: The tokens after the class.
        inputs: Number of inputs of the system.

    Raises:
        InvalidFuzzyFile: The class is not supported, or the parameters are wrong.
    """
    if kind.text not in TERM_CLASSES:
        supported = ", ".join(TERM_CLASSES)
        raise malformed(
            kind.position, f"a term {kind.text[:40]!r} is not supported, only {supported}"
        )
    values = [parse_number(each.text, each.position) for each in parameters]
    with locate_errors(kind.position):
        if kind.text in {"Constant", "Linear"}:
            return _function(name, kind, values, inputs)
        return FuzzySet(name, _membership(kind, _without_height(kind, values)))


def _function(name: str, kind: LocatedText, values: list[float], inputs: int) -> LinearFunction:
    if kind.text == "Constant":
        if len(values) != 1:
            raise malformed(kind.position, f"Constant: expected one number, got {len(values)}")
        return LinearFunction(name, values[0])
    if len(values) not in {inputs, inputs + 1}:
        raise malformed(
            kind.position,
            f"Linear: expected {inputs} coefficients, one per input, and a constant, "
            f"got {len(values)} numbers",
        )
    constant = values[inputs] if len(values) > inputs else 0.0
    return LinearFunction(name, constant, tuple(values[:inputs]))


def _without_height(kind: LocatedText, values: list[float]) -> list[float]:
    if kind.text == "Discrete":
        count = len(values) - len(values) % 2
    else:
        count = len(TERMS[kind.text].order) if kind.text in TERMS else 2
    if len(values) not in {count, count + 1}:
        raise malformed(
            kind.position, f"{kind.text}: expected {count} parameters, got {len(values)}"
        )
    if len(values) > count and values[count] != 1.0:
        raise malformed(
            kind.position,
            f"{kind.text}: a height of {values[count]:g} is not supported, only 1",
        )
    return values[:count]


def _membership(kind: LocatedText, p: list[float]) -> Membership:
    if kind.text in {"Discrete", "Rectangle", "Cosine"}:
        return _unlisted(kind.text, p)
    if kind.text in {"Binary", "Ramp"}:
        return _edge(kind, *p)
    if kind.text == "Trapezoid" and p[0] == -inf < p[2]:
        return Membership("linzmf", (p[2], p[3]))
    if kind.text == "Trapezoid" and p[3] == inf > p[1]:
        return Membership("linsmf", (p[0], p[1]))
    shape, order = TERMS[kind.text]
    if kind.text in {"SShape", "ZShape", "PiShape"}:  # a step where the side begins
        p = [x for k in range(0, len(p), 2) for x in (p[k], max(p[k], p[k + 1]))]
    return Membership(shape, tuple(p[k] for k in order))


def _unlisted(kind: str, p: list[float]) -> Membership:
    if kind == "Discrete":
        return Membership("pointsmf", tuple(p))
    if kind == "Cosine":
        return Membership("cosinemf", (0.5 * p[1], p[0]))
    low, high = sorted(p)
    return Membership("trapmf", (low, low, high, high))


def _edge(kind: LocatedText, start: float, end: float) -> Membership:
    if start == end:
        raise malformed(kind.position, f"{kind.text}: the numbers are equal and give no direction")
    low, high = (start, start) if kind.text == "Binary" else sorted((start, end))
    return Membership("linsmf" if end > start else "linzmf", (low, high))
