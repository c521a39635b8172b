"""The compiled heart of inference: one function for systems of every kind and type."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.antecedents import fire
from omnidrive.fuzzy.centre_of_sets import centre_of_sets
from omnidrive.fuzzy.consequents import strongest, summed
from omnidrive.fuzzy.packed_arrays import Packed, integers_of, numbers_of
from omnidrive.fuzzy.reduction import reduced
from omnidrive.fuzzy.sampled import (
    MAX,
    MIN,
    WTSUM,
    joined_by_max,
    joined_by_rule,
    sampled_value,
)
from omnidrive.fuzzy.segment_centroid import exact_interval, exact_value, polyline
from omnidrive.fuzzy.sets import fuzzify
from omnidrive.fuzzy.sugeno import Functions, sugeno_interval
from omnidrive.fuzzy.system_arrays import (
    ALGORITHM,
    BEYOND,
    FALLBACKS,
    HOW,
    LEVELS,
    POINTS,
    RANGES,
    REST,
    SILENT,
    SWITCHES,
    UNCERTAIN,
    Room,
    antecedents_in,
    centres_in,
    consequents_in,
    ends_in,
    lines_in,
    room_in,
    room_size,
    samples_in,
    sets_in,
)
from omnidrive.fuzzy.trapezoid_centroid import strips_centroid
from omnidrive.fuzzy.unsafe_views import borrowed, part

SAMPLED, EXACT, CENTRE_OF_SETS, SUGENO = range(4)
CLAMP, AS_IS, REFUSE = range(3)
FINE, NOT_FINITE, OUT_OF_RANGE, NO_RULE = range(4)


@compiled
def admitted(p: Packed, x: Float[Array, " inputs"]) -> int:
    """Bring inputs into their range, in place, if that is what happens to them; returns a status.

    What is not finite is refused always.
    """
    ranges, switches = numbers_of(p, RANGES), integers_of(p, SWITCHES)
    status = FINE
    for i in range(len(x)):
        low, high = ranges[2 * i], ranges[2 * i + 1]
        if not np.isfinite(x[i]):
            return NOT_FINITE
        if x[i] < low or x[i] > high:
            if switches[BEYOND] == REFUSE:
                status = OUT_OF_RANGE
            elif switches[BEYOND] == CLAMP:
                x[i] = min(max(x[i], low), high)
    return status


@compiled
def strengths_of(p: Packed, room: Room, x: Float[Array, " inputs"]) -> None:
    """Fill in the least and greatest strength of every rule."""
    fuzzify(sets_in(p), x, integers_of(p, SWITCHES)[UNCERTAIN] == 1, room.degrees)
    fire(antecedents_in(p), room.degrees, room.strengths)


@compiled
def infer(
    p: Packed, room: Room, x: Float[Array, " inputs"], found: Float[Array, "3 outputs"]
) -> int:
    """Value, least and greatest of every output; brings inputs into range; returns a status.

    The value of a system of type 2 is the middle of its interval.
    """
    status = admitted(p, x)
    if status != FINE:
        return status
    switches = integers_of(p, SWITCHES)
    strengths_of(p, room, x)
    if switches[HOW] == SAMPLED:
        _infer_sampled(p, room, found)
    elif switches[HOW] == EXACT:
        _infer_exact(p, room, found)
    else:
        _infer_weighted(p, room, x, found)
    fallbacks = numbers_of(p, FALLBACKS)
    for o in range(found.shape[1]):
        if np.isnan(found[1, o]):
            found[0, o] = found[1, o] = found[2, o] = fallbacks[o]
            status = NO_RULE if switches[SILENT] == REFUSE else status
        else:
            found[0, o] = 0.5 * (found[1, o] + found[2, o])
    return status


@compiled
def _infer_sampled(p: Packed, room: Room, found: Float[Array, "3 outputs"]) -> None:
    """Least and greatest of every output by way of samples; nan if no rule speaks of it."""
    c, s, switches = consequents_in(p), samples_in(p), integers_of(p, SWITCHES)
    cuts, uncertain, count = c.implication[0] == MIN, switches[UNCERTAIN] == 1, switches[POINTS]
    shapes, heights, points = c.first_shape[-1], room.heights, room.points
    strongest(c, room.strengths, heights)
    for o in range(found.shape[1]):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        for bound in range(0 if uncertain else 1, 2):
            degrees = part(s.degrees, bound * shapes * count, (bound + 1) * shapes * count)
            joined = points[bound]
            if c.aggregations[o] == MAX:
                own = part(degrees, first * count, last * count)
                joined_by_max(part(heights[bound], first, last), own, cuts, joined)
            else:
                joined_by_rule(c, o, room.strengths[bound], degrees, joined)
        at = part(s.at, o * count, (o + 1) * count)
        if uncertain:
            found[1, o], found[2, o] = reduced(switches[ALGORITHM], at, points[0], points[1])
        else:
            found[1, o] = found[2, o] = sampled_value(c.defuzzifiers[o], at, points[1])


@compiled
def _infer_exact(p: Packed, room: Room, found: Float[Array, "3 outputs"]) -> None:
    """Least and greatest of every output by way of polylines; nan if no rule speaks of it."""
    c, switches, heights = consequents_in(p), integers_of(p, SWITCHES), room.heights
    rows, corners = integers_of(p, REST + 10), numbers_of(p, REST + 11)
    cuts = c.implication[0] == MIN
    strongest(c, room.strengths, heights)
    for o in range(found.shape[1]):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        if rows[o] == 1:
            found[1, o] = found[2, o] = strips_centroid(
                corners, first, part(heights[1], first, last)
            )
            continue
        high = polyline(lines_in(p, REST), o, cuts, part(heights[1], first, last))
        if high.shape[1] == 0:
            found[1, o] = np.nan
        elif switches[UNCERTAIN] == 1:
            low = polyline(lines_in(p, REST + 5), o, cuts, part(heights[0], first, last))
            found[1, o], found[2, o] = exact_interval(switches[ALGORITHM], low, high)
        else:
            found[1, o] = found[2, o] = exact_value(c.defuzzifiers[o], high)


@compiled
def _infer_weighted(
    p: Packed, room: Room, x: Float[Array, " inputs"], found: Float[Array, "3 outputs"]
) -> None:
    """Least and greatest of every output as means over rules; nan if no rule speaks of it."""
    c, switches, weights = consequents_in(p), integers_of(p, SWITCHES), room.heights
    summed(c, room.strengths, weights)
    for o in range(found.shape[1]):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        if switches[HOW] == SUGENO:
            is_sum, functions = c.defuzzifiers[o] == WTSUM, Functions(numbers_of(p, REST))
            low, high = part(weights[0], first, last), part(weights[1], first, last)
            ends = sugeno_interval(functions, first, is_sum, switches[ALGORITHM], x, low, high)
        else:
            ends = centre_of_sets(
                centres_in(p), first, last, switches[ALGORITHM], weights, room.points
            )
        found[1, o], found[2, o] = ends


@compiled
def rule_strengths(
    numbers: Float[Array, " numbers"],
    integers: Int[Array, " integers"],
    x: Float[Array, " inputs"],
) -> Float[Array, "2 rules"]:
    """Least and greatest strength of every rule, for inputs that are brought into their range."""
    p = Packed(numbers, integers)
    return _strengths_in(p, np.empty(room_size(p)), x)


@compiled
def _strengths_in(
    p: Packed, space: Float[Array, " numbers"], x: Float[Array, " inputs"]
) -> Float[Array, "2 rules"]:
    room = room_in(p, space)
    admitted(p, x)
    strengths_of(p, room, x)
    return room.strengths.copy()


@compiled
def value_of_one(
    numbers: Float[Array, " numbers"],
    integers: Int[Array, " integers"],
    x: tuple[float, ...],
    values: Float[Array, " outputs"],
) -> int:
    """Fill in the value of every output of a system of type 1 or 2; returns a status."""
    p = Packed(borrowed(numbers), borrowed(integers))
    space = np.empty(room_size(p) + len(x) + 3 * len(values))
    return _value_in(p, space, x, borrowed(values))


@compiled
def _value_in(
    p: Packed,
    space: Float[Array, " numbers"],
    x: tuple[float, ...],
    values: Float[Array, " outputs"],
) -> int:
    inputs, found = ends_in(p, space, len(x), len(values))
    for i in range(len(x)):
        inputs[i] = x[i]
    status = infer(p, room_in(p, space), inputs, found)
    for o in range(len(values)):
        values[o] = found[0, o]
    return status


@compiled
def infer_rows(
    numbers: Float[Array, " numbers"],
    integers: Int[Array, " integers"],
    planes: Int[Array, "planes 4"],
    rows: Float[Array, "rows inputs"],
    found: Float[Array, "rows 3 outputs"],
) -> tuple[int, int]:
    """Fill in value, least and greatest of every output for each row.

    A system of type 3 has several planes; its values are the mean of theirs, weighted by their
    levels (Castillo, Castro & Melin 2022).

    Args:
        numbers: Of all planes, one after the other.
        integers: The same.
        planes: Where the numbers and the integers of each plane begin and end.
        rows: The inputs.
        found: The outputs.

    Returns:
        A status; the first row that is not fine, or the number of rows.
    """
    levels, inputs, outputs = 0.0, rows.shape[1], found.shape[2]
    for k in range(len(planes)):
        p = Packed(
            borrowed(numbers)[planes[k, 0] : planes[k, 1]],
            borrowed(integers)[planes[k, 2] : planes[k, 3]],
        )
        levels += numbers_of(p, LEVELS)[0]
        space = np.empty(room_size(p) + inputs + 3 * outputs)
        status, row = _infer_plane(p, space, rows, k > 0, found)
        if status != FINE:
            return status, row
    if len(planes) > 1:
        found /= levels
    return FINE, len(rows)


@compiled
def _infer_plane(
    p: Packed,
    space: Float[Array, " numbers"],
    rows: Float[Array, "rows inputs"],
    further: bool,
    found: Float[Array, "rows 3 outputs"],
) -> tuple[int, int]:
    """Fill in, or add to what is there, what one plane finds, times its level; status and row."""
    level, inputs, outputs = numbers_of(p, LEVELS)[0], rows.shape[1], found.shape[2]
    x, each = ends_in(p, space, inputs, outputs)
    room = room_in(p, space)
    for r in range(len(rows)):
        for i in range(inputs):
            x[i] = rows[r, i]
        status = infer(p, room, x, each)
        if status != FINE:
            return status, r
        for i in range(3):
            for o in range(outputs):
                before = found[r, i, o] if further else 0.0
                found[r, i, o] = before + level * each[i, o]
    return FINE, len(rows)
