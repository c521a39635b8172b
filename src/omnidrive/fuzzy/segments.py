"""Conclusions of which the functions are polylines, cut into straight lines."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.consequents import Shape
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.sets import WHOLE, ZSlice
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import Footprint, FuzzySet, OutputVariable

MAX_LINES = 1_000_000
"""Most straight lines that the shapes of one output may be cut into."""


class Lines(NamedTuple):
    """The membership functions of the shapes of every output, cut into straight lines; flat.

    The range of an output is divided where any of its shapes has a corner, and where two of them
    cross. So over one piece every shape is one line, and the lines do not cross.
    """

    first_piece: Int[Array, " shape_edges"]
    """Where the pieces of each output begin."""
    ends: Float[Array, " piece_ends"]
    """Left and right end of each piece."""
    first_line: Int[Array, " line_edges"]
    """Where the lines over each piece begin; the highest line comes first."""
    shapes: Int[Array, " lines"]
    """To which shape each line belongs, counted within the output."""
    degrees: Float[Array, " line_ends"]
    """Of each line at the left and the right end of its piece."""


def why_not_exact(system: FuzzySystem) -> str | None:
    """Why the conclusions of a system are not polylines; None if they are."""
    for output in system.outputs:
        if output.aggregation != "max":
            return f"output {output.name!r} is aggregated by {output.aggregation}, not max"
        for each in output.sets:
            for function in (each.upper, each.lower) if isinstance(each, FuzzySet) else ():
                if isinstance(function, Membership) and not function.is_piecewise_linear:
                    return f"set {each.name!r} of {output.name!r} is a {function.shape}"
    return None


def lines_of(
    system: FuzzySystem,
    shapes: tuple[tuple[Shape, ...], ...],
    plane: ZSlice = WHOLE,
    *,
    of_lower: bool = False,
) -> Lines:
    """Upper (or lower) functions of the shapes of every output, which must be polylines.

    Raises:
        InvalidInput: There are too many lines.
    """
    first_piece, first_line = [0], [0]
    ends: list[float] = []
    owners: list[int] = []
    degrees: list[float] = []
    for output, own in zip(system.outputs, shapes, strict=True):
        for piece, over in _pieces(output, own, plane, of_lower):
            ends += piece
            for shape, left, right in over:
                owners.append(shape)
                degrees += [left, right]
            first_line.append(len(owners))
            if len(owners) > MAX_LINES:
                raise InvalidInput(
                    f"the sets of {output.name!r} overlap too much for exact conclusions: "
                    "ask for centroid matlab"
                )
        first_piece.append(len(ends) // 2)
    return Lines(
        np.array(first_piece),
        np.array(ends, dtype=np.float64),
        np.array(first_line),
        np.array(owners, dtype=np.int64),
        np.array(degrees, dtype=np.float64),
    )


_Piece = tuple[tuple[float, float], list[tuple[int, float, float]]]


def _pieces(
    output: OutputVariable, shapes: tuple[Shape, ...], plane: ZSlice, of_lower: bool
) -> list[_Piece]:
    """Pieces of one output's range, with the lines over each: shape, left and right degree."""

    def drawn(at: Float[Array, " points"]) -> Float[Array, "shapes points"]:
        """The lower, or the upper, function of every shape at these places."""
        pairs = [shape.membership_bounds(at, plane) for shape in shapes]
        return np.array([pair[0 if of_lower else 1] for pair in pairs]).reshape(-1, len(at))

    corners = _divided(output, shapes)
    left, right = _ends(drawn, corners[:-1], corners[1:])
    crossings = [corners]
    for a, b, y0, y1 in zip(corners[:-1], corners[1:], left.T, right.T, strict=True):
        crossings.append(a + (b - a) * _crossings(y0, y1))
        if sum(map(len, crossings)) > MAX_LINES:
            break  # too many lines: refused by the caller
    knots = np.unique(np.concatenate(crossings))
    left, right = _ends(drawn, knots[:-1], knots[1:])
    pieces: list[_Piece] = []
    for a, b, y0, y1 in zip(knots[:-1].tolist(), knots[1:].tolist(), left.T, right.T, strict=True):
        order = np.argsort(-(y0 + y1), kind="stable")
        over = [(int(k), float(y0[k]), float(y1[k])) for k in order if y0[k] + y1[k] > 0.0]
        if over:
            pieces.append(((a, b), over))
    return pieces


def _divided(output: OutputVariable, shapes: tuple[Shape, ...]) -> Float[Array, " corners"]:
    """Where any function of any shape may have a corner, with the ends of the range."""
    corners = [output.low, output.high]
    for each in {shape.of.name: shape.of for shape in shapes}.values():
        assert isinstance(each, FuzzySet)
        upper, lower = each.upper, each.lower
        corners += [x for x, _ in upper.vertices]
        if isinstance(lower, Membership):
            corners += [x for x, _ in lower.vertices]
        if isinstance(lower, Footprint):
            corners.append(upper.middle)
            for (x0, y0), (x1, y1) in zip(upper.vertices, upper.vertices[1:], strict=False):
                corners += [
                    x0 + (x1 - x0) * (lag - y0) / (y1 - y0)
                    for lag in lower.lags
                    if min(y0, y1) < lag < max(y0, y1)
                ]
    return np.unique([x for x in corners if isfinite(x) and output.low <= x <= output.high])


def _ends(
    drawn: Callable[[Array], Array], left: Float[Array, " pieces"], right: Float[Array, " pieces"]
) -> tuple[Float[Array, "shapes pieces"], Float[Array, "shapes pieces"]]:
    """Degrees at both ends of each piece, from within it: a shape may jump at an end."""
    near, far = drawn(0.75 * left + 0.25 * right), drawn(0.25 * left + 0.75 * right)
    slope = far - near
    return np.clip(near - 0.5 * slope, 0.0, 1.0), np.clip(far + 0.5 * slope, 0.0, 1.0)


def _crossings(
    left: Float[Array, " shapes"], right: Float[Array, " shapes"]
) -> Float[Array, " crossings"]:
    """Where lines cross within a piece, as parts of its width."""
    shown = (left > 0.0) | (right > 0.0)
    gap = np.subtract.outer(left[shown], left[shown])
    closing = gap - np.subtract.outer(right[shown], right[shown])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = gap / closing
    return np.unique(at[(at > 1e-12) & (at < 1.0 - 1e-12)])
