"""Consequents without area: fuzzy singletons, which have degrees at isolated points only.

A centroid of sets is one of areas, to which a singleton contributes nothing. Where only singletons
fire, the centroid is the mean of their points weighted by their aggregated degrees: the limit of
equally narrow sets, and the sum of Matlab if all points are among its samples.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import unsafe_slice
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.consequents import Consequent, Consequents
from omnidrive.fuzzy.reduction import type_reduce
from omnidrive.fuzzy.sampled import aggregate_bound, defuzzify_samples
from omnidrive.fuzzy.segments import MAX_SEGMENTS
from omnidrive.fuzzy.sets import FULL_FOOTPRINT, ZSlice
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, OutputVariable


class Spikes(NamedTuple):
    """Isolated points of the consequents without area, as flat arrays.

    Every output has the same number of points, ascending; the last ones of some have degree 0. If
    no consequent of the system has such points, there are none.
    """

    at: Float[Array, " points_of_outputs"]
    degrees: Float[Array, " bounds_of_points"]
    """Lower degrees of all consequents at the points of their output, then the upper ones."""
    has_area: Int[Array, " consequents"]
    """Whether each consequent has an area within the range of its output."""


NO_SPIKES = Spikes(np.empty(0), np.empty(0), np.empty(0, dtype=np.int64))
"""The arrays of a system whose outputs are no aggregated sets."""


def spikes_of(
    system: FuzzySystem,
    consequents: tuple[tuple[Consequent, ...], ...],
    z_slice: ZSlice = FULL_FOOTPRINT,
) -> Spikes:
    """Return the isolated points of the consequents of a Mamdani system.

    Raises:
        InvalidInput: There are more than :data:`~omnidrive.fuzzy.segments.MAX_SEGMENTS` degrees.
    """
    has_area, points = [], []
    for output, own in zip(system.outputs, consequents, strict=True):
        areas = [_has_area(output, each) for each in own]
        found = {
            x
            for each, area in zip(own, areas, strict=True)
            if not area and isinstance(each.definition, FuzzySet)
            for x, _ in each.definition.upper.vertices
            if output.low <= x <= output.high and each.definition.upper(x) > 0.0
        }
        has_area += areas
        points.append(sorted(found))
    count = max(map(len, points))
    if count * len(has_area) > MAX_SEGMENTS:
        raise InvalidInput("the outputs have too many singletons")
    if not count:
        return Spikes(np.empty(0), np.empty(0), np.array(has_area, dtype=np.int64))
    at, degrees = [], []
    for output, own, each in zip(system.outputs, consequents, points, strict=True):
        padded = np.array([*each, *[output.high] * (count - len(each))])
        at.append(padded)
        for consequent in own:
            bounds = np.array(consequent.membership_bounds(padded, z_slice))
            bounds[:, len(each) :] = 0.0
            degrees.append(bounds)
    return Spikes(
        np.concatenate(at),
        np.array(degrees, dtype=np.float64).reshape(-1, 2, count).transpose(1, 0, 2).ravel(),
        np.array(has_area, dtype=np.int64),
    )


def _has_area(output: OutputVariable, consequent: Consequent) -> bool:
    """Return whether a consequent is positive on an interval within the range of its output."""
    assert isinstance(consequent.definition, FuzzySet)
    function = consequent.definition.upper
    if consequent.complemented or not function.is_piecewise_linear:
        return True
    corners = function.vertices
    ends = (output.low, corners[0][1]), (output.high, corners[-1][1])
    return any(
        min(right, output.high) > max(left, output.low) and max(at_left, at_right) > 0.0
        for (left, at_left), (right, at_right) in pairwise((ends[0], *corners, ends[1]))
    )


@compiled
def only_spikes(s: Spikes, heights: Float[Array, " consequents"], first: int, last: int) -> bool:
    """Return whether no consequent from ``first`` to before ``last`` with a height has an area."""
    if len(s.at) == 0:
        return False
    areas = 0
    for k in range(first, last):
        areas += heights[k] > 0.0 and s.has_area[k] == 1
    return areas == 0


@compiled
def points_in(s: Spikes, c: Consequents, output: int) -> Float[Array, " points"]:
    """Return the isolated points of one output."""
    count = len(s.at) // len(c.aggregations)
    return unsafe_slice(s.at, output * count, (output + 1) * count)


@compiled
def aggregate_spikes(
    s: Spikes,
    c: Consequents,
    output: int,
    strengths: Float[Array, "2 rules"],
    heights: Float[Array, "2 consequents"],
) -> Float[Array, "2 points"]:
    """Return the lower and the upper aggregated degrees at the isolated points of one output."""
    count = len(s.at) // len(c.aggregations)
    size = c.first[-1] * count
    aggregated = np.empty((2, count))
    for bound in range(2):
        degrees = unsafe_slice(s.degrees, bound * size, (bound + 1) * size)
        aggregate_bound(c, output, strengths[bound], heights[bound], degrees, aggregated[bound])
    return aggregated


@compiled
def defuzzify_spikes(  # noqa: PLR0917
    s: Spikes,
    c: Consequents,
    output: int,
    uncertain: bool,
    algorithm: int,
    strengths: Float[Array, "2 rules"],
    heights: Float[Array, "2 consequents"],
) -> tuple[float, float]:
    """Return the least and the greatest value of an output for which only singletons fire.

    Both are nan if no rule fires for it, and equal if the system is not ``uncertain``.
    """
    at, degrees = points_in(s, c, output), aggregate_spikes(s, c, output, strengths, heights)
    if uncertain:
        return type_reduce(algorithm, at, degrees[0], degrees[1])
    value = defuzzify_samples(c.defuzzifiers[output], at, degrees[1])
    return value, value


@compiled
def with_spikes(
    polyline: Float[Array, "4 pieces"],
    at: Float[Array, " points"],
    degrees: Float[Array, " points"],
) -> Float[Array, "4 pieces"]:
    """Return a polyline of straight parts with parts of width 0 at points of positive degree.

    Args:
        polyline: As from :func:`~omnidrive.fuzzy.segment_centroid.aggregate_segments`.
        at: Ascending points; each is an end of a part, or lies between two.
        degrees: Degree at each point.
    """
    pieces = polyline.shape[1]
    merged = np.empty((4, pieces + len(at)))
    count, k = 0, 0
    for i in range(pieces + 1):
        while k < len(at) and (i == pieces or at[k] <= polyline[0, i]):
            if degrees[k] > 0.0:
                merged[0, count] = merged[1, count] = at[k]
                merged[2, count] = merged[3, count] = degrees[k]
                count += 1
            k += 1
        if i < pieces:
            merged[:, count] = polyline[:, i]
            count += 1
    return merged[:, :count]
