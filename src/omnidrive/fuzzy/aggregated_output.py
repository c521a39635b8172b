"""Aggregated outputs of a Mamdani system as curves for figures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.compilation import z_slices
from omnidrive.fuzzy.consequents import Consequent, Consequents, consequents_of, max_strengths
from omnidrive.fuzzy.inference import FiredRule, Inference
from omnidrive.fuzzy.sampled import aggregate_bound, aggregate_max, samples_of
from omnidrive.fuzzy.segment_centroid import aggregate_segments
from omnidrive.fuzzy.segments import segments_of
from omnidrive.fuzzy.sets import FULL_FOOTPRINT, ZSlice
from omnidrive.fuzzy.spikes import (
    Spikes,
    aggregate_spikes,
    only_spikes,
    points_in,
    spikes_of,
    with_spikes,
)
from omnidrive.fuzzy.variables import OutputVariable


class AggregatedOutput(NamedTuple):
    """Aggregated fuzzy set of one output before defuzzification, as two polylines."""

    lower: Float[Array, "2 points"]
    """Corners of the lower membership function: x, ascending, in the unit of the output; degrees.

    Equal to ``upper`` in a type-1 system.
    """
    upper: Float[Array, "2 points"]
    """Corners of the upper membership function; degree 0 where no rule fires."""


def widest_slice(inference: Inference) -> ZSlice:
    """Return the lowest, hence widest, z-slice of a type-3 inference, which figures show.

    For type 1 or 2, return the full footprint.
    """
    return z_slices(inference.options.slices)[0] if inference.system.type == 3 else FULL_FOOTPRINT


def aggregated_outputs(inference: Inference, *inputs: float) -> tuple[AggregatedOutput, ...]:
    """Return the aggregated fuzzy set of every output, computed by the kernels of the inference.

    The polylines are exact if the option ``centroid`` of the inference is; otherwise they connect
    its samples. In a type-3 system, the consequents are those of the :func:`widest_slice`, and the
    firing strengths those of the full footprints.

    Raises:
        InvalidInput: The system is a Sugeno system, or as for a call of the inference.
    """
    system, options, z_slice = inference.system, inference.options, widest_slice(inference)
    if system.is_sugeno:
        raise InvalidInput("a Sugeno system has no aggregated output")
    c, consequents = consequents_of(system)
    strengths = _strengths(inference, inputs)
    heights = np.empty((2, sum(map(len, consequents))))
    max_strengths(c, strengths, heights)
    fired = _Fired(c, consequents, strengths, heights, spikes_of(system, consequents, z_slice))
    curves_of = _exact_curves if options.centroid == "exact" else _sampled_curves
    curves = [curves_of(inference, fired, z_slice, bound) for bound in (0, 1)]
    return tuple(map(AggregatedOutput, *curves))


def implied_consequent(
    inference: Inference, output: int, fired: FiredRule, at: Float[Array, " points"]
) -> tuple[Float[Array, " points"], Float[Array, " points"]] | None:
    """Return lower and upper degrees of a rule's consequent, clipped or scaled by its strengths.

    None: the rule has no consequent for this output.

    Args:
        inference: The inference of a Mamdani system.
        output: Index of the output.
        fired: The rule with its firing strengths.
        at: Points in the unit of the output.
    """
    system = inference.system
    variable = system.outputs[output]
    proposition = next((t for t in fired.rule.consequents if t.variable == variable.name), None)
    if proposition is None:
        return None
    definition = next(each for each in variable.sets if each.name == proposition.set)
    degrees = np.array(
        Consequent(definition, bool(proposition.hedges)).membership_bounds(
            at, widest_slice(inference)
        )
    )
    implied = np.empty_like(degrees)
    for bound, strength in enumerate((fired.lower, fired.upper)):
        aggregate_max(np.array([strength]), degrees[bound], _clips(inference), implied[bound])
    return implied[0], implied[1]


def _strengths(inference: Inference, inputs: tuple[float, ...]) -> Float[Array, "2 rules"]:
    """Return lower and upper firing strength of every rule; 0 where it does not fire."""
    strengths = np.zeros((2, len(inference.system.rules)))
    for each in inference.fired_rules(*inputs):
        strengths[:, each.number - 1] = each.lower, each.upper
    return strengths


def _clips(inference: Inference) -> bool:
    """Return whether the implication clips consequents; otherwise it scales them."""
    return inference.system.implication == "min"


class _Fired(NamedTuple):
    """Consequents of a system and the strengths with which its rules fire."""

    c: Consequents
    consequents: tuple[tuple[Consequent, ...], ...]
    strengths: Float[Array, "2 rules"]
    heights: Float[Array, "2 consequents"]
    spikes: Spikes

    def add_spikes(
        self, polyline: Float[Array, "4 pieces"], output: int, bound: int
    ) -> Float[Array, "4 all"]:
        """Return the polyline of an output with the isolated points of its singletons."""
        if len(self.spikes.at) == 0:
            return polyline
        degrees = aggregate_spikes(self.spikes, self.c, output, self.strengths, self.heights)
        return with_spikes(polyline, points_in(self.spikes, self.c, output), degrees[bound])


def _exact_curves(
    inference: Inference, fired: _Fired, z_slice: ZSlice, bound: int
) -> list[Float[Array, "2 points"]]:
    """Return the exact polyline of each output; ``bound`` 0: lower, 1: upper."""
    system, c = inference.system, fired.c
    of_lower = bound == 0 and system.type > 1
    segments = segments_of(system, fired.consequents, z_slice, of_lower=of_lower)
    curves = []
    for o, output in enumerate(system.outputs):
        heights = fired.heights[bound, c.first[o] : c.first[o + 1]]
        polyline = aggregate_segments(segments, o, _clips(inference), heights)
        curves.append(_curve(fired.add_spikes(polyline, o, bound), output))
    return curves


def _curve(polyline: Float[Array, "4 pieces"], output: OutputVariable) -> Float[Array, "2 points"]:
    """Return the corners of a polyline over the whole range of an output."""
    left, right, y0, y1 = polyline
    # one row per piece, and one for the end of the range: the end of the previous piece and the
    # start of this one at degree 0, unless they touch, then the start and end of this one
    starts, ends = np.r_[left, output.high], np.r_[output.low, right]
    zero = np.zeros_like(starts)
    x = np.column_stack([ends, starts, starts, np.r_[right, output.high]])
    y = np.column_stack([zero, zero, np.r_[y0, 0.0], np.r_[y1, 0.0]])
    touching = ends >= starts - 1e-12 * (output.high - output.low)
    shown = np.ones_like(x, dtype=bool)
    shown[:, :2] = ~touching[:, None]
    return np.array([x[shown], y[shown]])


def _sampled_curves(
    inference: Inference, fired: _Fired, z_slice: ZSlice, bound: int
) -> list[Float[Array, "2 points"]]:
    """Return the polyline of each output through its samples; ``bound`` 0: lower, 1: upper.

    Singletons that fire alone, which may lie between samples, are shown at their points.
    """
    system, count, c = inference.system, inference.options.samples, fired.c
    samples = samples_of(system, fired.consequents, count, z_slice)
    at = samples.at.reshape(-1, count)
    degrees = samples.degrees.reshape(2, -1)[bound]
    strengths, heights = fired.strengths[bound], fired.heights[bound]
    curves = []
    for o, output in enumerate(system.outputs):
        if only_spikes(fired.spikes, fired.heights[1], c.first[o], c.first[o + 1]):
            curves.append(_curve(fired.add_spikes(np.empty((4, 0)), o, bound), output))
            continue
        aggregated = np.empty(count)
        aggregate_bound(c, o, strengths, heights, degrees, aggregated)
        curves.append(np.array([at[o], aggregated]))
    return curves
