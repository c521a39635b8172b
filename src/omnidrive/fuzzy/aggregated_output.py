"""The joined conclusions of a Mamdani system, as curves to look at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.compilation import slices
from omnidrive.fuzzy.consequents import Consequents, Shape, consequents_of, strongest
from omnidrive.fuzzy.inference import FiredRule, Inference
from omnidrive.fuzzy.norms import AGGREGATIONS
from omnidrive.fuzzy.sampled import MAX, joined_by_max, joined_by_rule, samples_of
from omnidrive.fuzzy.segment_centroid import polyline
from omnidrive.fuzzy.segments import lines_of
from omnidrive.fuzzy.sets import WHOLE, ZSlice


class AggregatedOutput(NamedTuple):
    """What all rules together conclude about one output, before it is made one number."""

    lower: Float[Array, "2 points"]
    """Corners of the lower function: x ascending, degree. The same as the upper one in type 1."""
    upper: Float[Array, "2 points"]
    """Corners of the upper function; degree 0 everywhere where no rule fires."""


def widest_slice(inference: Inference) -> ZSlice:
    """Slice of a type-3 system of which rules and conclusions are shown; all of a type-2 system."""
    return slices(inference.options.slices)[0] if inference.system.type == 3 else WHOLE


def aggregated_outputs(inference: Inference, *inputs: float) -> tuple[AggregatedOutput, ...]:
    """Joined conclusions about each output, made by the kernels that the inference itself uses.

    Exact polylines where the inference is exact, straight lines between its samples where not; of
    a type-3 system the :func:`widest_slice` slice.

    Raises:
        InvalidInput: The system is Sugeno's, or the inputs are refused as by a call.
    """
    system, options, plane = inference.system, inference.options, widest_slice(inference)
    if system.is_sugeno:
        raise InvalidInput("a Sugeno system has no aggregated output")
    c, shapes = consequents_of(system)
    strengths = _strengths(inference, inputs)
    heights = np.empty((2, sum(map(len, shapes))))
    strongest(c, strengths, heights)
    if options.centroid == "exact":
        curves = [
            _pieces(inference, c, shapes, heights[bound], plane, of_lower=bound == 0)
            for bound in (0, 1)
        ]
    else:
        curves = [
            _sampled(inference, c, shapes, strengths, heights, plane=plane, bound=b) for b in (0, 1)
        ]
    return tuple(map(AggregatedOutput, *curves))


def implied_consequent(
    inference: Inference, output: int, fired: FiredRule, at: Float[Array, " points"]
) -> tuple[Float[Array, " points"], Float[Array, " points"]] | None:
    """Lower and upper degree of the conclusion of one rule, cut or scaled by its strength.

    None: the rule says nothing of the output.
    """
    system = inference.system
    variable = system.outputs[output]
    term = next((t for t in fired.rule.consequents if t.variable == variable.name), None)
    if term is None:
        return None
    named = next(each for each in variable.sets if each.name == term.set)
    degrees = np.array(
        Shape(named, bool(term.hedges)).membership_bounds(at, widest_slice(inference))
    )
    found = np.empty_like(degrees)
    for bound, strength in enumerate((fired.lower, fired.upper)):
        joined_by_max(np.array([strength]), degrees[bound], _cuts(inference), found[bound])
    return found[0], found[1]


def _strengths(inference: Inference, inputs: tuple[float, ...]) -> Float[Array, "2 rules"]:
    found = np.zeros((2, len(inference.system.rules)))
    for each in inference.fired_rules(*inputs):
        found[:, each.number - 1] = each.lower, each.upper
    return found


def _cuts(inference: Inference) -> bool:
    return inference.system.implication == "min"


def _pieces(
    inference: Inference,
    c: Consequents,
    shapes: tuple[tuple[Shape, ...], ...],
    heights: Float[Array, " shapes"],
    plane: ZSlice,
    *,
    of_lower: bool,
) -> list[Float[Array, "2 points"]]:
    """Exact polyline of each output."""
    system = inference.system
    lines = lines_of(system, shapes, plane, of_lower=of_lower and system.type > 1)
    curves = []
    for o, output in enumerate(system.outputs):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        left, right, y0, y1 = polyline(lines, o, _cuts(inference), heights[first:last])
        # before each piece, and at the end, down to zero and up again where there is a gap
        starts, ends = np.r_[left, output.high], np.r_[output.low, right]
        zero = np.zeros_like(starts)
        x = np.column_stack([ends, starts, starts, np.r_[right, output.high]])
        y = np.column_stack([zero, zero, np.r_[y0, 0.0], np.r_[y1, 0.0]])
        touching = ends >= starts - 1e-12 * (output.high - output.low)
        shown = np.ones_like(x, dtype=bool)
        shown[:, :2] = ~touching[:, None]
        curves.append(np.array([x[shown], y[shown]]))
    return curves


def _sampled(
    inference: Inference,
    c: Consequents,
    shapes: tuple[tuple[Shape, ...], ...],
    strengths: Float[Array, "2 rules"],
    heights: Float[Array, "2 shapes"],
    *,
    plane: ZSlice,
    bound: int,
) -> list[Float[Array, "2 points"]]:
    """Each output on samples."""
    system, count = inference.system, inference.options.samples
    samples = samples_of(system, shapes, count, plane)
    at = samples.at.reshape(-1, count)
    degrees = samples.degrees.reshape(2, -1)[bound]
    curves = []
    for o, output in enumerate(system.outputs):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        joined = np.empty(count)
        if AGGREGATIONS[output.aggregation] == MAX:
            own = degrees[first * count : last * count]
            joined_by_max(heights[bound, first:last], own, _cuts(inference), joined)
        else:
            joined_by_rule(c, o, strengths[bound], degrees, joined)
        curves.append(np.array([at[o], joined]))
    return curves
