"""The centroid of a row of cut trapezoids, by horizontal strips: the common case, at once."""

from __future__ import annotations

from itertools import pairwise
from math import isinf
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.consequents import Shape
from omnidrive.fuzzy.membership import SHAPES, TRAPEZOID
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, OutputVariable

Corners = tuple[float, float, float, float]


class Strips(NamedTuple):
    """The shapes of outputs that are rows of trapezoids, flat."""

    rows: Int[Array, " outputs"]
    """Whether the shapes of each output are trapezoids whose corners all ascend."""
    corners: Float[Array, " corners"]
    """Left foot, both ends of the top and right foot of every shape; zeros where not."""


def strips_of(system: FuzzySystem, shapes: tuple[tuple[Shape, ...], ...]) -> Strips:
    """Rows of trapezoids among the outputs of a system of type 1."""
    rows, corners = [], []
    for output, own in zip(system.outputs, shapes, strict=True):
        found = [_corners(output, shape) for shape in own]
        known = [each for each in found if each is not None]
        ascend = all(
            a <= b for left, right in pairwise(known)
            for a, b in zip(left, right, strict=True)
        )  # fmt: skip
        is_row = ascend and len(known) == len(own) and system.implication == "min"
        rows.append(is_row and output.defuzzifier == "centroid" and system.type == 1)
        corners += [x for each in found for x in each or (0.0,) * 4]
    return Strips(np.array(rows, dtype=np.int64), np.array(corners, dtype=np.float64))


def _corners(output: OutputVariable, shape: Shape) -> Corners | None:
    """Corners of a shape within the output's range; None if it is no trapezoid there."""
    if shape.complemented or not isinstance(shape.of, FuzzySet):
        return None
    kind = SHAPES[shape.of.upper.shape]
    if kind.kernel != TRAPEZOID:
        return None
    a, b, c, d = kind.curve(*shape.of.upper.parameters)
    a, b = (output.low, output.low) if isinf(a) else (a, b)
    c, d = (output.high, output.high) if isinf(d) else (c, d)
    # a ramp may reach its top, or begin to fall, only beyond the range: no trapezoid within
    return (a, b, c, d) if output.low <= a <= b <= c <= d <= output.high else None


@compiled
def strips_centroid(
    corners: Float[Array, " corners"], first: int, heights: Float[Array, " shapes"]
) -> float:
    """Centroid of ``max_k min(heights_k, trapezoid_k)``, in closed form.

    At every height y the consequent is the union of the intervals [l_k(y), r_k(y)] of the shapes
    with heights_k >= y. Where the corners ascend with k, so do both ends, and the union's length is
    the sum of the lengths less the overlaps of neighbours (inclusion and exclusion: what i < k
    share, all between share too). Shapes i and k are neighbours between the greatest height of a
    shape between them and the lesser of theirs, and overlap up to where their sides cross. The ends
    are linear in y: every term is an area between two straight lines.

    Args:
        corners: Of all shapes, as in :class:`Strips`.
        first: First shape of the output.
        heights: Where each shape of the output is cut, 0 to 1; where none is, the result is nan.
    """
    area, moment = 0.0, 0.0
    for k in range(len(heights)):
        height: float = heights[k]
        if height <= 0.0:
            continue
        at = 4 * (first + k)
        a: float = corners[at]
        rise: float = corners[at + 1] - a
        d: float = corners[at + 3]
        da, dm = _strip(a, rise, d, corners[at + 2] - d, 0.0, height)
        area, moment = area + da, moment + dm
        between = 0.0
        for i in range(k - 1, -1, -1):
            other = 4 * (first + i)
            end: float = corners[other + 3]
            if end <= a or between >= height:
                break  # nor does any shape further left overlap, or show above those between
            fall: float = corners[other + 2] - end
            closing = rise - fall
            crossing = (end - a) / closing if closing > 0.0 else 1.0
            top = min(heights[i], height, crossing)
            if top > between:
                da, dm = _strip(a, rise, end, fall, between, top)
                area, moment = area - da, moment - dm
            between = max(between, heights[i])
    return moment / area if area > 0.0 else np.nan


@compiled
def _strip(  # noqa: PLR0917
    left: float, rise: float, right: float, fall: float, low: float, high: float
) -> tuple[float, float]:
    """Area and first moment about x = 0 between two lines, for low <= y <= high.

    The lines are x = left + rise y and x = right + fall y. Their distance w and middle m are linear
    in y, so the integral of w m is its value at half height times the height, plus
    w' m' height^3 / 12.
    """
    height, y = high - low, 0.5 * (low + high)
    widening, drift = fall - rise, 0.5 * (rise + fall)
    area = (right - left + widening * y) * height
    middle = 0.5 * (left + right) + drift * y
    return area, middle * area + drift * widening * height * height * height / 12.0
