"""Conclusions on samples, as Matlab draws them, and their defuzzification."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.consequents import Consequents, Shape
from omnidrive.fuzzy.norms import AGGREGATIONS, IMPLICATIONS, t_conorm
from omnidrive.fuzzy.reduction import moments
from omnidrive.fuzzy.sets import WHOLE, ZSlice
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.unsafe_views import part

MIN, MAX = IMPLICATIONS["min"], AGGREGATIONS["max"]
CENTROID, BISECTOR, MOM, SOM, LOM, LM, RM, _, WTSUM = range(9)  # the order of system.DEFUZZIFIERS


class Samples(NamedTuple):
    """Membership of every sample of an output in each of its shapes, flat."""

    at: Float[Array, " samples_of_outputs"]
    """The samples of each output, from its low to its high."""
    degrees: Float[Array, " bounds_of_samples"]
    """Lower functions of all shapes, then the upper ones."""


def samples_of(
    system: FuzzySystem, shapes: tuple[tuple[Shape, ...], ...], count: int, plane: ZSlice = WHOLE
) -> Samples:
    """``count`` samples of each output of a system."""
    at = [_even(output.low, output.high, count) for output in system.outputs]
    pairs = [
        shape.membership_bounds(at[o], plane)
        for o in range(len(system.outputs))
        for shape in shapes[o]
    ]
    return Samples(np.concatenate(at), np.array(pairs).transpose(1, 0, 2).ravel())


def _even(low: float, high: float, count: int) -> Float[Array, " samples"]:
    """Even samples, as far from the middle on either side to the last digit.

    So a symmetric system is odd even where a set begins with a step at the middle.
    """
    part = np.arange(1 - count, count, 2) / (count - 1)
    at: Array = 0.5 * (low + high) + 0.5 * (high - low) * part
    at[0], at[-1] = low, high
    return at


@compiled
def joined_by_max(
    heights: Float[Array, " shapes"],
    degrees: Float[Array, " shapes_of_samples"],
    cuts: bool,
    joined: Float[Array, " samples"],
) -> None:
    """Fill in the greatest of the cut (or scaled) shapes."""
    joined[:] = 0.0
    for k in range(len(heights)):
        height, shape = heights[k], part(degrees, k * len(joined), (k + 1) * len(joined))
        if height > 0.0:
            if cuts:
                for i in range(len(joined)):
                    joined[i] = max(joined[i], min(height, shape[i]))
            else:
                for i in range(len(joined)):
                    joined[i] = max(joined[i], height * shape[i])


@compiled
def joined_by_rule(
    c: Consequents,
    output: int,
    strengths: Float[Array, " rules"],
    degrees: Float[Array, " shapes_of_samples"],
    joined: Float[Array, " samples"],
) -> None:
    """As :func:`joined_by_max`, by another aggregation, to which every rule adds its conclusion."""
    outputs, aggregation, cuts = (
        len(c.aggregations),
        c.aggregations[output],
        c.implication[0] == MIN,
    )
    joined[:] = 0.0
    for r in range(len(strengths)):
        k, strength = c.shapes[r * outputs + output], strengths[r]
        if k >= 0 and strength > 0.0:
            shape = part(degrees, k * len(joined), (k + 1) * len(joined))
            for i in range(len(joined)):
                each = min(strength, shape[i]) if cuts else strength * shape[i]
                joined[i] = t_conorm(aggregation, joined[i], each)


@compiled
def sampled_value(
    defuzzifier: int, at: Float[Array, " samples"], degrees: Float[Array, " samples"]
) -> float:
    """One number for a conclusion on samples, by Matlab's rules (its ``defuzz``); nan for none.

    The centroid is ``sum(degree x)/sum(degree)``; the bisector is the first sample at which half
    of the sum is reached; maxima are the samples of the greatest degree.
    """
    if defuzzifier == CENTROID:
        area, moment = moments(at, degrees, 0, len(at))
        return moment / area if area > 0.0 else np.nan
    top = degrees.max()
    if top <= 0.0:
        return np.nan
    if defuzzifier == BISECTOR:
        half, running = 0.5 * degrees.sum(), 0.0
        for i in range(len(at)):
            running += degrees[i]
            if running >= half:
                return float(at[i])
    return of_maxima(defuzzifier, at[degrees == top])


@compiled
def of_maxima(defuzzifier: int, maxima: Float[Array, " maxima"]) -> float:
    """One of the points, in ascending order, at which a conclusion is greatest; or their mean."""
    if defuzzifier == MOM:
        return float(maxima.mean())
    if defuzzifier == LM:
        return float(maxima[0])
    if defuzzifier == RM:
        return float(maxima[-1])
    sizes = np.abs(maxima)
    return float(maxima[sizes.argmin() if defuzzifier == SOM else sizes.argmax()])
