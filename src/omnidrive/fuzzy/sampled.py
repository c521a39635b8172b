"""Aggregated outputs on samples, as Matlab computes them, and their defuzzification."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import unsafe_slice
from omnidrive.fuzzy.consequents import Consequent, Consequents
from omnidrive.fuzzy.norms import AGGREGATIONS, IMPLICATIONS, t_conorm
from omnidrive.fuzzy.reduction import moments
from omnidrive.fuzzy.sets import FULL_FOOTPRINT, ZSlice
from omnidrive.fuzzy.system import FuzzySystem

MIN, MAX = IMPLICATIONS["min"], AGGREGATIONS["max"]
CENTROID, BISECTOR, MOM, SOM, LOM, LM, RM, _, WTSUM = range(9)  # order of DEFUZZIFIERS


class Samples(NamedTuple):
    """Degrees of membership of the samples of every output in its consequents, as flat arrays."""

    at: Float[Array, " samples_of_outputs"]
    """Samples of each output, from its low to its high."""
    degrees: Float[Array, " bounds_of_samples"]
    """Lower degrees of all consequents, then the upper ones."""


def samples_of(
    system: FuzzySystem,
    consequents: tuple[tuple[Consequent, ...], ...],
    count: int,
    z_slice: ZSlice = FULL_FOOTPRINT,
) -> Samples:
    """Return ``count`` samples of each output and their degrees of membership."""
    at = [_symmetric_samples(output.low, output.high, count) for output in system.outputs]
    pairs = [
        consequent.membership_bounds(at[o], z_slice)
        for o in range(len(system.outputs))
        for consequent in consequents[o]
    ]
    return Samples(np.concatenate(at), np.array(pairs).transpose(1, 0, 2).ravel())


def _symmetric_samples(low: float, high: float, count: int) -> Float[Array, " samples"]:
    """Return evenly spaced samples, symmetric about the middle to the last digit.

    A symmetric system then has odd outputs even if a set begins with a step at the middle.
    """
    fraction = np.arange(1 - count, count, 2) / (count - 1)
    at: Array = 0.5 * (low + high) + 0.5 * (high - low) * fraction
    at[0], at[-1] = low, high
    return at


@compiled
def aggregate_max(
    heights: Float[Array, " consequents"],
    degrees: Float[Array, " consequents_of_samples"],
    clips: bool,
    aggregated: Float[Array, " samples"],
) -> None:
    """Fill in the maximum of the clipped (or scaled) consequents."""
    aggregated[:] = 0.0
    for k in range(len(heights)):
        height = heights[k]
        consequent = unsafe_slice(degrees, k * len(aggregated), (k + 1) * len(aggregated))
        if height > 0.0:
            if clips:
                for i in range(len(aggregated)):
                    aggregated[i] = max(aggregated[i], min(height, consequent[i]))
            else:
                for i in range(len(aggregated)):
                    aggregated[i] = max(aggregated[i], height * consequent[i])


@compiled
def aggregate_bound(  # noqa: PLR0917
    c: Consequents,
    output: int,
    strengths: Float[Array, " rules"],
    heights: Float[Array, " consequents"],
    degrees: Float[Array, " consequents_of_samples"],
    aggregated: Float[Array, " samples"],
) -> None:
    """Fill in the aggregation of one output, of the lower or of the upper functions.

    Args:
        c: The consequents.
        output: Number of the output.
        strengths: Firing strength of every rule.
        heights: Greatest firing strength per consequent, from :func:`.max_strengths`.
        degrees: Degrees of all consequents at the samples of their output.
        aggregated: Result.
    """
    if c.aggregations[output] == MAX:
        first, last, count = c.first[output], c.first[output + 1], len(aggregated)
        own = unsafe_slice(degrees, first * count, last * count)
        clips = c.implication[0] == MIN
        aggregate_max(unsafe_slice(heights, first, last), own, clips, aggregated)
    else:
        aggregate_rules(c, output, strengths, degrees, aggregated)


@compiled
def aggregate_rules(
    c: Consequents,
    output: int,
    strengths: Float[Array, " rules"],
    degrees: Float[Array, " consequents_of_samples"],
    aggregated: Float[Array, " samples"],
) -> None:
    """Fill in the aggregation of the clipped (or scaled) consequents of all rules.

    For operators other than max, where each rule counts, also if two share a consequent.
    """
    outputs, aggregation = len(c.aggregations), c.aggregations[output]
    clips = c.implication[0] == MIN
    aggregated[:] = 0.0
    for r in range(len(strengths)):
        k, strength = c.indices[r * outputs + output], strengths[r]
        if k >= 0 and strength > 0.0:
            consequent = unsafe_slice(degrees, k * len(aggregated), (k + 1) * len(aggregated))
            for i in range(len(aggregated)):
                each = min(strength, consequent[i]) if clips else strength * consequent[i]
                aggregated[i] = t_conorm(aggregation, aggregated[i], each)


@compiled
def defuzzify_samples(
    defuzzifier: int, at: Float[Array, " samples"], degrees: Float[Array, " samples"]
) -> float:
    """Return the defuzzified value of samples by the rules of Matlab's ``defuzz``.

    The centroid is ``sum(degree x)/sum(degree)``; the bisector is the first sample at which half
    of the sum is reached; maxima are the samples of the greatest degree. The value is nan if all
    degrees are 0.
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
    maxima, count = np.empty(len(at)), 0
    for i in range(len(at)):
        if degrees[i] == top:
            maxima[count] = at[i]
            count += 1
    return select_maximum(defuzzifier, maxima[:count])


@compiled
def select_maximum(defuzzifier: int, maxima: Float[Array, " maxima"]) -> float:
    """Return the maximum that the defuzzifier selects from ascending maxima, or their mean."""
    if defuzzifier == LM:
        return float(maxima[0])
    if defuzzifier == RM:
        return float(maxima[len(maxima) - 1])
    total, selected = 0.0, maxima[0]
    for each in maxima:
        total += each
        size, best = abs(each), abs(selected)
        if size < best if defuzzifier == SOM else size > best:
            selected = each
    return float(total / len(maxima) if defuzzifier == MOM else selected)
