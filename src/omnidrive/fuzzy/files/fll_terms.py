"""Terms of the fuzzylite language: ``Triangle 0.0 0.5 1.0``."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import locate_errors
from omnidrive.fuzzy.files.source import Position, malformed, parse_number
from omnidrive.fuzzy.files.writable import real
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction


class Word(NamedTuple):
    """A word of a file, and where it stands."""

    text: str
    position: Position


class _Term(NamedTuple):
    shape: str
    order: tuple[int, ...]
    """Which of fuzzylite's parameters each of the shape's is."""


TERMS: dict[str, _Term] = {
    "Bell": _Term("gbellmf", (1, 2, 0)),
    "Gaussian": _Term("gaussmf", (1, 0)),
    "GaussianProduct": _Term("gauss2mf", (1, 0, 3, 2)),
    "PiShape": _Term("pimf", (0, 1, 2, 3)),
    "Sigmoid": _Term("sigmf", (1, 0)),
    "SigmoidDifference": _Term("dsigmf", (1, 0, 2, 3)),
    "SigmoidProduct": _Term("psigmf", (1, 0, 2, 3)),
    "SShape": _Term("smf", (0, 1)),
    "Trapezoid": _Term("trapmf", (0, 1, 2, 3)),
    "Triangle": _Term("trimf", (0, 1, 2)),
    "ZShape": _Term("zmf", (0, 1)),
}
"""Terms that are one of our shapes, perhaps with the parameters in another order."""

FUNCTIONS = frozenset(
    {
        *("abs", "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh"),
        *("ceil", "cos", "cosh", "eq", "exp", "fabs", "floor", "fmod"),
        *("ge", "gt", "le", "log", "log10", "log1p", "lt", "max"),
        *("min", "neq", "pi", "pow", "round", "sin", "sinh", "sqrt"),
        *("tan", "tanh"),
    }
)
"""What fuzzylite takes for functions, even in a rule: no names there."""

_TWO = ("Binary", "Ramp", "Rectangle")
READ = (*TERMS, *_TWO, "Discrete", "Constant", "Linear")
"""Every term that can be read; fuzzylite's others are no shape of ours."""


def read_term(
    name: str, kind: Word, parameters: Sequence[Word], inputs: int
) -> FuzzySet | LinearFunction:
    """Set or function of a term.

    Args:
        name: Of the term.
        kind: Its class in fuzzylite.
        parameters: What follows the class.
        inputs: How many inputs the system has.

    Raises:
        InvalidFuzzyFile: It is none, or none that can be expressed.
    """
    if kind.text not in READ:
        raise malformed(
            kind.position, f"a term {kind.text[:40]!r} cannot be read, only {', '.join(READ)}"
        )
    values = [parse_number(each.text, each.position) for each in parameters]
    with locate_errors(kind.position):
        if kind.text in {"Constant", "Linear"}:
            return _function(name, kind, values, inputs)
        return FuzzySet(name, _membership(kind, _without_height(kind, values)))


def _function(name: str, kind: Word, values: list[float], inputs: int) -> LinearFunction:
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


def _without_height(kind: Word, values: list[float]) -> list[float]:
    if kind.text == "Discrete":
        wanted = len(values) - len(values) % 2
    else:
        wanted = len(TERMS[kind.text].order) if kind.text in TERMS else 2
    if len(values) not in {wanted, wanted + 1}:
        raise malformed(
            kind.position, f"{kind.text}: expected {wanted} parameters, got {len(values)}"
        )
    if len(values) > wanted and values[wanted] != 1.0:
        raise malformed(
            kind.position,
            f"{kind.text}: a height of {values[wanted]:g} cannot be expressed, only 1",
        )
    return values[:wanted]


def _membership(kind: Word, p: list[float]) -> Membership:
    if kind.text == "Discrete":
        return Membership("pointsmf", tuple(p))
    if kind.text == "Rectangle":
        low, high = sorted(p)
        return Membership("trapmf", (low, low, high, high))
    if kind.text in {"Binary", "Ramp"}:
        return _edge(kind, *p)
    if kind.text == "Trapezoid" and p[0] == -inf < p[2]:
        return Membership("linzmf", (p[2], p[3]))
    if kind.text == "Trapezoid" and p[3] == inf > p[1]:
        return Membership("linsmf", (p[0], p[1]))
    shape, order = TERMS[kind.text]
    return Membership(shape, tuple(p[k] for k in order))


def _edge(kind: Word, start: float, end: float) -> Membership:
    if start == end:
        raise malformed(kind.position, f"{kind.text}: has no direction: its numbers are equal")
    low, high = (start, start) if kind.text == "Binary" else sorted((start, end))
    return Membership("linsmf" if end > start else "linzmf", (low, high))


def term_text(each: FuzzySet | LinearFunction) -> str:
    """Class and parameters of a set or function, as fuzzylite writes them.

    Raises:
        InvalidInput: fuzzylite has no such set.
    """
    if isinstance(each, LinearFunction):
        kind = "Linear" if each.coefficients else "Constant"
        return _text(kind, (*each.coefficients, each.constant))
    shape, p = each.upper.shape, each.upper.parameters
    if shape == "pointsmf":
        return _text("Discrete", p)
    if shape in {"linsmf", "linzmf"}:
        rises = shape == "linsmf"
        if p[0] == p[1]:
            return _text("Binary", (p[0], inf if rises else -inf))
        return _text("Ramp", p if rises else p[::-1])
    for kind, term in TERMS.items():
        if term.shape == shape:
            return _text(kind, tuple(p[term.order.index(k)] for k in range(len(p))))
    raise InvalidInput(f"the fuzzylite language has no {shape} (set {each.name!r})")


def _text(kind: str, parameters: tuple[float, ...]) -> str:
    return " ".join((kind, *map(real, parameters)))
