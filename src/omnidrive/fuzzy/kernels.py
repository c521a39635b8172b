"""Compiled inference: one entry point for systems of every kind and type."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import uncounted, unsafe_slice
from omnidrive.fuzzy.antecedents import fire
from omnidrive.fuzzy.centre_of_sets import centre_of_sets
from omnidrive.fuzzy.checks import MAX_NUMBER
from omnidrive.fuzzy.consequents import max_strengths, sum_strengths
from omnidrive.fuzzy.packed_arrays import PackedArrays
from omnidrive.fuzzy.reduction import type_reduce
from omnidrive.fuzzy.sampled import (
    BISECTOR,
    CENTROID,
    MIN,
    WTSUM,
    aggregate_bound,
    defuzzify_samples,
)
from omnidrive.fuzzy.segment_centroid import aggregate_segments, centroid_interval, defuzzify_exact
from omnidrive.fuzzy.sets import fuzzify
from omnidrive.fuzzy.spikes import (
    aggregate_spikes,
    defuzzify_spikes,
    only_spikes,
    points_in,
    with_spikes,
)
from omnidrive.fuzzy.sugeno import sugeno_interval
from omnidrive.fuzzy.system_arrays import (
    Workspace,
    antecedents_in,
    arguments_in,
    centroids_in,
    consequents_in,
    functions_in,
    header_in,
    samples_in,
    segments_in,
    sets_in,
    spikes_in,
    trapezoids_in,
    workspace_in,
    workspace_size,
)
from omnidrive.fuzzy.trapezoid_centroid import trapezoid_centroid

SAMPLED, EXACT, CENTRE_OF_SETS, SUGENO = range(4)
CLAMP, AS_IS, RAISE = range(3)
OK, NOT_FINITE, OUT_OF_RANGE, NO_RULE = range(4)


@compiled
def check_inputs(p: PackedArrays, x: Float[Array, " inputs"]) -> int:
    """Check the inputs, clamp them in place if the policy is to clamp, and return a status.

    Values that are not finite are refused under every policy. Without clamping to the range, they
    are clamped to the largest number of a system.
    """
    header, status = header_in(p), OK
    ranges, policy = header.ranges, header.options.out_of_range
    for i in range(len(x)):
        low, high = ranges[2 * i], ranges[2 * i + 1]
        if not np.isfinite(x[i]):
            return NOT_FINITE
        if x[i] < low or x[i] > high:
            if policy == RAISE:
                status = OUT_OF_RANGE
            elif policy == CLAMP:
                x[i] = min(max(x[i], low), high)
            else:
                x[i] = min(max(x[i], -MAX_NUMBER), MAX_NUMBER)
    return status


@compiled
def compute_strengths(p: PackedArrays, workspace: Workspace, x: Float[Array, " inputs"]) -> None:
    """Fill in the lower and upper firing strength of every rule."""
    fuzzify(sets_in(p), x, header_in(p).options.uncertain == 1, workspace.degrees)
    fire(antecedents_in(p), workspace.degrees, workspace.strengths)


@compiled
def infer(
    p: PackedArrays,
    workspace: Workspace,
    x: Float[Array, " inputs"],
    results: Float[Array, "3 outputs"],
) -> int:
    """Fill in value, least and greatest of every output; return a status.

    Inputs are clamped in place if the policy is to clamp. The value of a type-2 system is the
    midpoint of its type-reduced interval.
    """
    status = check_inputs(p, x)
    if status != OK:
        return status
    header = header_in(p)
    compute_strengths(p, workspace, x)
    if header.options.method == SAMPLED:
        _infer_sampled(p, workspace, results)
    elif header.options.method == EXACT:
        _infer_exact(p, workspace, results)
    else:
        _infer_averaged(p, workspace, x, results)
    for o in range(results.shape[1]):
        if np.isnan(results[1, o]):
            results[0, o] = results[1, o] = results[2, o] = header.fallbacks[o]
            status = NO_RULE if header.options.no_rule == RAISE else status
        else:
            results[0, o] = 0.5 * (results[1, o] + results[2, o])
    return status


@compiled
def _infer_sampled(
    p: PackedArrays, workspace: Workspace, results: Float[Array, "3 outputs"]
) -> None:
    """Fill in least and greatest of every output on samples; nan if no rule fires for it."""
    c, s, options = consequents_in(p), samples_in(p), header_in(p).options
    uncertain, count, spikes = options.uncertain == 1, options.points, spikes_in(p)
    size, heights, points = c.first[-1] * count, workspace.heights, workspace.points
    max_strengths(c, workspace.strengths, heights)
    for o in range(results.shape[1]):
        if only_spikes(spikes, heights[1], c.first[o], c.first[o + 1]):
            results[1, o], results[2, o] = defuzzify_spikes(
                spikes, c, o, uncertain, options.algorithm, workspace.strengths, heights
            )
            continue
        for bound in range(0 if uncertain else 1, 2):
            degrees = unsafe_slice(s.degrees, bound * size, (bound + 1) * size)
            strengths = workspace.strengths[bound]
            aggregate_bound(c, o, strengths, heights[bound], degrees, points[bound])
        at = unsafe_slice(s.at, o * count, (o + 1) * count)
        if uncertain:
            results[1, o], results[2, o] = type_reduce(options.algorithm, at, points[0], points[1])
        else:
            results[1, o] = results[2, o] = defuzzify_samples(c.defuzzifiers[o], at, points[1])


@compiled
def _infer_exact(p: PackedArrays, workspace: Workspace, results: Float[Array, "3 outputs"]) -> None:
    """Fill in least and greatest of every output on polylines; nan if no rule fires for it."""
    c, options, heights = consequents_in(p), header_in(p).options, workspace.heights
    clips, spikes, trapezoids = c.implication[0] == MIN, spikes_in(p), trapezoids_in(p)
    max_strengths(c, workspace.strengths, heights)
    for o in range(results.shape[1]):
        first, last = c.first[o], c.first[o + 1]
        if only_spikes(spikes, heights[1], first, last):
            results[1, o], results[2, o] = defuzzify_spikes(
                spikes, c, o, options.uncertain == 1, options.algorithm, workspace.strengths,
                heights,
            )  # fmt: skip
            continue
        if trapezoids.ordered[o] == 1:
            results[1, o] = results[2, o] = trapezoid_centroid(
                trapezoids.corners, first, unsafe_slice(heights[1], first, last)
            )
            continue
        high = aggregate_segments(
            segments_in(p, False), o, clips, unsafe_slice(heights[1], first, last)
        )
        if high.shape[1] == 0:
            results[1, o] = np.nan
        elif options.uncertain == 1:
            low = aggregate_segments(
                segments_in(p, True), o, clips, unsafe_slice(heights[0], first, last)
            )
            results[1, o], results[2, o] = centroid_interval(options.algorithm, low, high)
        else:
            if len(spikes.at) > 0 and c.defuzzifiers[o] not in (CENTROID, BISECTOR):
                degrees = aggregate_spikes(spikes, c, o, workspace.strengths, heights)[1]
                high = with_spikes(high, points_in(spikes, c, o), degrees)
            results[1, o] = results[2, o] = defuzzify_exact(c.defuzzifiers[o], high)


@compiled
def _infer_averaged(
    p: PackedArrays,
    workspace: Workspace,
    x: Float[Array, " inputs"],
    results: Float[Array, "3 outputs"],
) -> None:
    """Fill in least and greatest of every output as means over rules; nan if no rule fires."""
    c, options, weights = consequents_in(p), header_in(p).options, workspace.heights
    sum_strengths(c, workspace.strengths, weights)
    for o in range(results.shape[1]):
        first, last = c.first[o], c.first[o + 1]
        if options.method == SUGENO:
            is_sum = c.defuzzifiers[o] == WTSUM
            low, high = unsafe_slice(weights[0], first, last), unsafe_slice(weights[1], first, last)
            ends = sugeno_interval(functions_in(p), first, is_sum, options.algorithm, x, low, high)
        else:
            ends = centre_of_sets(
                centroids_in(p), first, last, options.algorithm, weights, workspace.points
            )
        results[1, o], results[2, o] = ends


@compiled
def rule_strengths(
    floats: Float[Array, " floats"],
    integers: Int[Array, " integers"],
    x: Float[Array, " inputs"],
) -> Float[Array, "2 rules"]:
    """Return the lower and upper firing strength of every rule; ``x`` is clamped in place."""
    p = PackedArrays(floats, integers)
    return _rule_strengths_in(p, np.empty(workspace_size(p)), x)


@compiled
def _rule_strengths_in(
    p: PackedArrays, buffer: Float[Array, " floats"], x: Float[Array, " inputs"]
) -> Float[Array, "2 rules"]:
    workspace = workspace_in(p, buffer)
    check_inputs(p, x)
    compute_strengths(p, workspace, x)
    return workspace.strengths.copy()


@compiled
def infer_one(
    floats: Float[Array, " floats"],
    integers: Int[Array, " integers"],
    x: tuple[float, ...],
    values: Float[Array, " outputs"],
) -> int:
    """Fill in the value of every output of a type-1 or type-2 system; return a status."""
    p = PackedArrays(uncounted(floats), uncounted(integers))
    buffer = np.empty(workspace_size(p) + len(x) + 3 * len(values))
    return _infer_one_in(p, buffer, x, uncounted(values))


@compiled
def _infer_one_in(
    p: PackedArrays,
    buffer: Float[Array, " floats"],
    x: tuple[float, ...],
    values: Float[Array, " outputs"],
) -> int:
    inputs, results = arguments_in(p, buffer, len(x), len(values))
    for i in range(len(x)):
        inputs[i] = x[i]
    status = infer(p, workspace_in(p, buffer), inputs, results)
    for o in range(len(values)):
        values[o] = results[0, o]
    return status


@compiled
def infer_rows(
    floats: Float[Array, " floats"],
    integers: Int[Array, " integers"],
    slices: Int[Array, "slices 4"],
    rows: Float[Array, "rows inputs"],
    results: Float[Array, "rows 3 outputs"],
) -> tuple[int, int]:
    """Fill in value, least and greatest of every output for each row.

    The values of a type-3 system are the mean over its z-slices, weighted by their levels
    (Castillo, Castro & Melin 2022).

    Args:
        floats: Floats of all slices, concatenated.
        integers: Integers of all slices, concatenated.
        slices: Begin and end of the floats, begin and end of the integers of each slice.
        rows: Inputs, one row per evaluation.
        results: Value, least and greatest of every output per row.

    Returns:
        A status, and the number of the first row with another status than OK, or of rows.
    """
    levels, inputs, outputs = 0.0, rows.shape[1], results.shape[2]
    for k in range(len(slices)):
        p = PackedArrays(
            uncounted(floats)[slices[k, 0] : slices[k, 1]],
            uncounted(integers)[slices[k, 2] : slices[k, 3]],
        )
        levels += header_in(p).level
        buffer = np.empty(workspace_size(p) + inputs + 3 * outputs)
        status, row = _infer_slice(p, buffer, rows, k > 0, results)
        if status != OK:
            return status, row
    if len(slices) > 1:
        results /= levels
    return OK, len(rows)


@compiled
def _infer_slice(
    p: PackedArrays,
    buffer: Float[Array, " floats"],
    rows: Float[Array, "rows inputs"],
    accumulate: bool,
    results: Float[Array, "rows 3 outputs"],
) -> tuple[int, int]:
    """Fill in, or add, the results of one z-slice times its level.

    Returns:
        A status and a row, as for :func:`infer_rows`.
    """
    level, inputs, outputs = header_in(p).level, rows.shape[1], results.shape[2]
    x, each = arguments_in(p, buffer, inputs, outputs)
    workspace = workspace_in(p, buffer)
    for r in range(len(rows)):
        for i in range(inputs):
            x[i] = rows[r, i]
        status = infer(p, workspace, x, each)
        if status != OK:
            return status, r
        for i in range(3):
            for o in range(outputs):
                before = results[r, i, o] if accumulate else 0.0
                results[r, i, o] = before + level * each[i, o]
    return OK, len(rows)
