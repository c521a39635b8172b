"""Conclusions on samples, as Matlab draws them, and their defuzzification."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.fuzzy.conclusions import Conclusions, Shape, strongest
from omnidrive.fuzzy.norms import disjoin
from omnidrive.fuzzy.sets import WHOLE, Plane
from omnidrive.fuzzy.system import FuzzySystem

Array = np.ndarray

_MIN = 0
_MAX = 0
CENTROID, BISECTOR, MOM, SOM, LOM, LM, RM = range(7)  # the order of system.DEFUZZIFIERS


class Samples(NamedTuple):
    """Membership of every sample of an output in each of its shapes; flat arrays."""

    at: Float[Array, " outputs*samples"]
    """The samples of each output, from its low to its high."""
    upper: Float[Array, " shapes*samples"]
    lower: Float[Array, " shapes*samples"]
    support: Int[Array, " 2*shapes"]
    """First sample at which the upper function is not zero, and the one after the last."""


def samples_of(
    system: FuzzySystem, shapes: tuple[tuple[Shape, ...], ...], count: int, plane: Plane = WHOLE
) -> Samples:
    """``count`` samples of each output of a system."""
    at = [np.linspace(output.low, output.high, count) for output in system.outputs]
    pairs = [shape.bounds(at[o], plane) for o in range(len(system.outputs)) for shape in shapes[o]]
    lower = np.array([pair[0] for pair in pairs]).reshape(-1, count)
    upper = np.array([pair[1] for pair in pairs]).reshape(-1, count)
    inside = upper > 0.0
    first = inside.argmax(axis=1)
    last = np.where(inside.any(axis=1), count - inside[:, ::-1].argmax(axis=1), first)
    support = np.column_stack([first, last])
    return Samples(np.concatenate(at), upper.ravel(), lower.ravel(), support.ravel())


@compiled
def aggregated(
    c: Conclusions,
    s: Samples,
    output: int,
    strengths: Float[Array, " rules"],
    degrees: Float[Array, " shapes*samples"],
) -> Float[Array, " samples"]:
    """The joined conclusions of all rules about one output, at its samples.

    Args:
        c: What each rule concludes.
        s: Samples of the shapes.
        output: Which output.
        strengths: Of the rules.
        degrees: Lower or upper functions of the shapes, as in ``s``.
    """
    outputs = len(c.aggregations)
    count = len(s.at) // outputs
    first, cuts = c.first_shape[output], c.implication[0] == _MIN
    joined = np.zeros(count)
    if c.aggregations[output] == _MAX:  # of conclusions of one shape, the strongest counts
        heights = strongest(c, output, strengths)
        for k in range(len(heights)):
            height = heights[k]
            if height > 0.0:
                begin, end = s.support[2 * (first + k)], s.support[2 * (first + k) + 1]
                shape = degrees[(first + k) * count + begin : (first + k) * count + end]
                part = joined[begin:end]
                if cuts:
                    for i in range(len(part)):
                        part[i] = max(part[i], min(height, shape[i]))
                else:
                    for i in range(len(part)):
                        part[i] = max(part[i], height * shape[i])
        return joined
    for r in range(len(strengths)):
        k = c.shapes[r * outputs + output]
        if k >= 0 and strengths[r] > 0.0:
            for i in range(s.support[2 * k], s.support[2 * k + 1]):
                each = degrees[k * count + i]
                each = min(strengths[r], each) if cuts else strengths[r] * each
                joined[i] = disjoin(c.aggregations[output], joined[i], each)
    return joined


@compiled
def sampled_value(
    defuzzifier: int, at: Float[Array, " samples"], degrees: Float[Array, " samples"]
) -> float:
    """One number for a conclusion on samples, by Matlab's rules (its ``defuzz``).

    The centroid is ``sum(degree x)/sum(degree)``; the bisector is the first sample at which half
    of the sum is reached; maxima are the samples of the greatest degree.
    """
    if defuzzifier == CENTROID:
        area, moment = 0.0, 0.0
        for i in range(len(at)):
            area += degrees[i]
            moment += degrees[i] * at[i]
        return moment / area
    if defuzzifier == BISECTOR:
        half, running = 0.5 * degrees.sum(), 0.0
        for i in range(len(at)):
            running += degrees[i]
            if running >= half:
                return float(at[i])
    return of_maxima(defuzzifier, at[degrees == degrees.max()])


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
