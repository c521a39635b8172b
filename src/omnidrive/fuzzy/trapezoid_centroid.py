"""Centroid of clipped trapezoids in closed form, by integration over the degree."""

from __future__ import annotations

from itertools import pairwise
from math import isinf
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.consequents import Consequent
from omnidrive.fuzzy.membership import SHAPES, TRAPEZOID
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, OutputVariable

Corners = tuple[float, float, float, float]


class Trapezoids(NamedTuple):
    """Outputs whose consequents are ordered trapezoids, as flat arrays."""

    ordered: Int[Array, " outputs"]
    """Whether the consequents of each output are trapezoids whose corners all ascend."""
    corners: Float[Array, " corners"]
    """Left foot, both ends of the top and right foot of every consequent; zeros for others."""


def trapezoids_of(
    system: FuzzySystem, consequents: tuple[tuple[Consequent, ...], ...]
) -> Trapezoids:
    """Return the outputs of a type-1 system to which :func:`trapezoid_centroid` applies."""
    ordered, corners = [], []
    for output, own in zip(system.outputs, consequents, strict=True):
        found = [_corners(output, consequent) for consequent in own]
        known = [each for each in found if each is not None]
        ascend = all(
            a <= b for left, right in pairwise(known)
            for a, b in zip(left, right, strict=True)
        )  # fmt: skip
        applies = ascend and len(known) == len(own) and system.implication == "min"
        ordered.append(applies and output.defuzzifier == "centroid" and system.type == 1)
        corners += [x for each in found for x in each or (0.0,) * 4]
    return Trapezoids(np.array(ordered, dtype=np.int64), np.array(corners, dtype=np.float64))


def _corners(output: OutputVariable, consequent: Consequent) -> Corners | None:
    """Return the corners of a trapezoid within the output's range; None for other consequents."""
    if consequent.complemented or not isinstance(consequent.definition, FuzzySet):
        return None
    kind = SHAPES[consequent.definition.upper.shape]
    if kind.kernel != TRAPEZOID:
        return None
    a, b, c, d = kind.curve(*consequent.definition.upper.parameters)
    a, b = (output.low, output.low) if isinf(a) else (a, b)
    c, d = (output.high, output.high) if isinf(d) else (c, d)
    # a ramp that reaches its top beyond the range is no trapezoid within it
    return (a, b, c, d) if output.low <= a <= b <= c <= d <= output.high else None


@compiled
def trapezoid_centroid(
    corners: Float[Array, " corners"], first: int, heights: Float[Array, " consequents"]
) -> float:
    """Return the centroid of ``max_k min(heights_k, trapezoid_k)`` in closed form.

    At degree y, the aggregated output is the union of the intervals [l_k(y), r_k(y)] of the
    consequents with heights_k >= y. If the corners ascend with k, so do both ends, and the length
    of the union is the sum of all lengths minus the overlaps of neighbours (inclusion-exclusion:
    what i < k share, all consequents between them share too). Consequents i and k are neighbours
    from the greatest height of a consequent between them up to the lesser of their own heights,
    and overlap up to the crossing of their sides. The ends are linear in y, so every term is an
    area between two straight lines.

    Args:
        corners: Corners of all consequents, as in :class:`Trapezoids`.
        first: First consequent of the output.
        heights: Height at which each consequent of the output is clipped, 0 to 1.

    Returns:
        The centroid; nan if all heights are 0.
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
        da, dm = _strip_moments(a, rise, d, corners[at + 2] - d, 0.0, height)
        area, moment = area + da, moment + dm
        between = 0.0
        for i in range(k - 1, -1, -1):
            other = 4 * (first + i)
            end: float = corners[other + 3]
            if end <= a or between >= height:
                break  # consequents further left neither overlap nor exceed those between
            fall: float = corners[other + 2] - end
            closing = rise - fall
            crossing = (end - a) / closing if closing > 0.0 else 1.0
            top = min(heights[i], height, crossing)
            if top > between:
                da, dm = _strip_moments(a, rise, end, fall, between, top)
                area, moment = area - da, moment - dm
            between = max(between, heights[i])
    return moment / area if area > 0.0 else np.nan


@compiled
def _strip_moments(  # noqa: PLR0917
    left: float, rise: float, right: float, fall: float, low: float, high: float
) -> tuple[float, float]:
    """Return area and first moment about x = 0 between two lines, for low <= y <= high.

    The lines are x = left + rise y and x = right + fall y. Their distance w and midpoint m are
    linear in y, so the integral of w m is its value at half height times the height, plus
    w' m' height^3 / 12.
    """
    height, y = high - low, 0.5 * (low + high)
    widening, drift = fall - rise, 0.5 * (rise + fall)
    area = (right - left + widening * y) * height
    middle = 0.5 * (left + right) + drift * y
    return area, middle * area + drift * widening * height * height * height / 12.0
