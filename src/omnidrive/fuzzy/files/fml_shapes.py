"""Shapes of the fuzzy markup language: ``<triangularShape param1="0" param2="1" param3="2"/>``."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import locate_errors
from omnidrive.fuzzy.files.writer_checks import number_text
from omnidrive.fuzzy.files.xml_tree import Element
from omnidrive.fuzzy.membership import MAX_POINTS, Membership
from omnidrive.fuzzy.position import malformed, parse_number

FAR = sys.float_info.max
"""Where the centre lies of a side that a number never reaches."""

SHAPES: dict[str, tuple[str, tuple[int, ...]]] = {
    "triangularShape": ("trimf", (0, 1, 2)),
    "trapezoidShape": ("trapmf", (0, 1, 2, 3)),
    "rightLinearShape": ("linsmf", (0, 1)),
    "leftLinearShape": ("linzmf", (0, 1)),
    "gaussianShape": ("gaussmf", (1, 0)),
    "sShape": ("smf", (0, 1)),
    "zShape": ("zmf", (0, 1)),
}
"""Our shape, and which of its parameters each of ours is; a Gaussian has its centre first."""

_TWO = ("leftGaussianShape", "rightGaussianShape", "rectangularShape", "piShape")
READ = (*SHAPES, *_TWO, "pointSetShape")


def read_shape(term: Element) -> Membership:
    """Membership function of a ``fuzzyTerm``.

    A left Gaussian, 1 up to its centre, is a ``gauss2mf`` whose left side lies beyond every number,
    a right one likewise. A piShape rises from its first parameter to its second and falls as far,
    as JFML has it.

    Raises:
        InvalidFuzzyFile: There is none, or none that can be expressed.
    """
    if len(term.children) != 1:
        raise malformed(term.position, f"fuzzyTerm: expected one shape, got {len(term.children)}")
    shape = term.children[0]
    if shape.tag not in READ:
        raise malformed(
            shape.position, f"{shape.tag[:40]!r} cannot be read, only {', '.join(READ)}"
        )
    with locate_errors(shape.position):
        if shape.tag == "pointSetShape":
            return _points(shape)
        if shape.tag in SHAPES:
            name, order = SHAPES[shape.tag]
            p = _parameters(shape, len(order))
            return Membership(name, tuple(p[k] for k in order))
        return _from_two(shape.tag, *_parameters(shape, 2))


def _from_two(tag: str, a: float, b: float) -> Membership:
    if tag == "leftGaussianShape":
        return Membership("gauss2mf", (1.0, -FAR, b, a))
    if tag == "rightGaussianShape":
        return Membership("gauss2mf", (b, a, 1.0, FAR))
    if tag == "rectangularShape":
        return Membership("trapmf", (a, a, b, b))
    return Membership("pimf", (a, b, b, b + (b - a)))


def _parameters(shape: Element, count: int) -> list[float]:
    wanted = [f"param{k}" for k in range(1, count + 1)]
    if set(shape.attributes) - set(wanted):
        extra = min(set(shape.attributes) - set(wanted))
        raise malformed(
            shape.position, f"{shape.tag}: expected {', '.join(wanted)}, got {extra[:40]!r} too"
        )
    return [parse_number(shape.get(name), shape.position) for name in wanted]


def _points(shape: Element) -> Membership:
    method = shape.attributes.get("interpolationMethod", "linear")
    if method != "linear":
        raise malformed(
            shape.position,
            f"pointSetShape: {method[:40]!r} interpolation cannot be expressed, only linear",
        )
    points = list(shape.all("point"))
    if len(points) > MAX_POINTS:
        raise malformed(points[MAX_POINTS].position, f"more than {MAX_POINTS} points")
    each = [
        (parse_number(p.get("x"), p.position), parse_number(p.get("y"), p.position)) for p in points
    ]
    return Membership("pointsmf", tuple(v for pair in each for v in pair))


def shape_lines(name: str, function: Membership) -> Iterator[str]:
    """Lines of the shape of a set.

    Raises:
        InvalidInput: The language has none.
    """
    p = function.parameters
    if function.shape == "pointsmf":
        yield '<pointSetShape interpolationMethod="linear">'
        for x, y in zip(p[::2], p[1::2], strict=True):
            yield f'  <point x="{number_text(x)}" y="{number_text(y)}"/>'
        yield "</pointSetShape>"
        return
    for tag, (shape, order) in SHAPES.items():
        if shape == function.shape:
            yield _element(tag, tuple(p[order.index(k)] for k in range(len(p))))
            return
    yield _special(name, function)


def _special(name: str, function: Membership) -> str:
    p = function.parameters
    if function.shape == "gauss2mf" and p[:2] == (1.0, -FAR):
        return _element("leftGaussianShape", (p[3], p[2]))
    if function.shape == "gauss2mf" and p[2:] == (1.0, FAR):
        return _element("rightGaussianShape", (p[1], p[0]))
    if function.shape == "pimf" and p[1] == p[2] and p[3] == p[1] + (p[1] - p[0]):
        return _element("piShape", p[:2])
    raise InvalidInput(f"FML has no such {function.shape} (set {name!r}: {function})")


def _element(tag: str, parameters: tuple[float, ...]) -> str:
    each = " ".join(f'param{k}="{number_text(p)}"' for k, p in enumerate(parameters, 1))
    return f"<{tag} {each}/>"
