"""Terms of the fuzzy control language: ``(0, 0) (1, 1) (2, 0)``, or by a word."""

from __future__ import annotations

from math import isfinite

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import locate_errors
from omnidrive.fuzzy.files.fcl_text import FclText, Token
from omnidrive.fuzzy.files.polyline import CORNERS
from omnidrive.fuzzy.files.source import malformed
from omnidrive.fuzzy.files.writable import real
from omnidrive.fuzzy.membership import MAX_POINTS, Membership
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction

TERMS: dict[str, tuple[str, tuple[int, ...]]] = {
    "TRIAN": ("trimf", (0, 1, 2)),
    "TRAPE": ("trapmf", (0, 1, 2, 3)),
    "GAUSS": ("gaussmf", (1, 0)),
    "GAUSS2": ("gauss2mf", (1, 0, 3, 2)),
    "GBELL": ("gbellmf", (0, 1, 2)),
    "SIGM": ("sigmf", (0, 1)),
    "DSIGM": ("dsigmf", (0, 1, 2, 3)),
}
"""jFuzzyLogic's: our shape, and which of its parameters each of ours is."""


def read_points(text: FclText) -> Membership:
    """Membership function through points.

    Raises:
        InvalidFuzzyFile: There are none, or they are malformed.
    """
    points: list[float] = []
    start = text.next.position
    while text.accept("("):
        points.append(text.number())
        text.expect(",")
        points.append(text.number())
        text.expect(")")
        if len(points) > 2 * MAX_POINTS:
            raise malformed(start, f"more than {MAX_POINTS} points")
    with locate_errors(start):
        return Membership("pointsmf", tuple(points))


def read_named(kind: Token, values: list[float]) -> Membership:
    """Membership function that jFuzzyLogic has a word for.

    Raises:
        InvalidFuzzyFile: Its parameters are wrong, or it cannot be expressed.
    """
    shape, order = TERMS[kind.key]
    if len(values) != len(order):
        raise malformed(
            kind.position, f"{kind.key}: expected {len(order)} numbers, got {len(values)}"
        )
    if kind.key == "DSIGM" and not _never_negative(*values):
        raise malformed(
            kind.position,
            "DSIGM: its difference becomes negative, which jFuzzyLogic cuts off; that cannot be "
            "expressed, only equal gains with the first sigmoid to the left",
        )
    with locate_errors(kind.position):
        return Membership(shape, tuple(values[k] for k in order))


def _never_negative(a1: float, c1: float, a2: float, c2: float) -> bool:
    return a1 == a2 and a1 * c1 <= a2 * c2


def term_text(each: FuzzySet | LinearFunction) -> str:
    """A set or constant, as IEC 61131-7 and jFuzzyLogic write them.

    Raises:
        InvalidInput: They cannot.
    """
    if isinstance(each, LinearFunction):
        if each.coefficients:
            raise InvalidInput(
                f"IEC 61131-7 has constants, but no linear functions ({each.name!r}); fuzzylite's "
                "dialect has: write_fcl(system, 'fuzzylite')"
            )
        return real(each.constant)
    shape, p = each.upper.shape, each.upper.parameters
    if shape in CORNERS:
        return points_text(p, CORNERS[shape])
    if shape == "pointsmf":
        return points_text(p[::2], p[1::2])
    for word, (ours, order) in TERMS.items():
        if ours == shape and (shape != "dsigmf" or _never_negative(*p)):
            return " ".join((word, *(real(p[order.index(k)]) for k in range(len(p)))))
    raise InvalidInput(
        f"IEC 61131-7 and jFuzzyLogic have no such {shape} (set {each.name!r}); fuzzylite's "
        "dialect has: write_fcl(system, 'fuzzylite')"
    )


def points_text(x: tuple[float, ...], degrees: tuple[float, ...]) -> str:
    """Points in brackets."""
    return " ".join(f"({real(a)}, {real(b)})" for a, b in zip(x, degrees, strict=True))


def support(each: FuzzySet | LinearFunction) -> tuple[float, float] | None:
    """Where jFuzzyLogic takes the range of a variable to be that says none; None: unknown."""
    if isinstance(each, LinearFunction):
        return (each.constant, each.constant) if not each.coefficients else None
    shape, p = each.upper.shape, each.upper.parameters
    if each.upper.is_piecewise_linear:
        x = p[::2] if shape == "pointsmf" else p
        return x[0], x[-1]
    if shape in {"gaussmf", "gauss2mf"}:
        ends = [c + side * abs(s) for s, c in zip(p[::2], p[1::2], strict=True) for side in (-4, 4)]
        return min(ends), max(ends)
    if shape == "sigmf" and p[0] != 0.0 and isfinite(9.0 / p[0]):
        reach = 9.0 / abs(p[0])
        return p[1] - reach, p[1] + reach
    return None
