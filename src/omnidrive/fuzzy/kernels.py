"""The compiled heart of inference: one function for systems of every kind and type."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.fuzzy.centres import Centres, centre_of_sets
from omnidrive.fuzzy.conclusions import Conclusions, strongest, summed
from omnidrive.fuzzy.conditions import Conditions, fire, room
from omnidrive.fuzzy.exact import Lines, exact_interval, exact_value, polyline
from omnidrive.fuzzy.packed import Packed, integers_of, numbers_of
from omnidrive.fuzzy.reduction import reduced
from omnidrive.fuzzy.sampled import (
    MAX,
    MIN,
    WTSUM,
    Samples,
    joined_by_max,
    joined_by_rule,
    sampled_value,
)
from omnidrive.fuzzy.sets import Sets, fuzzify
from omnidrive.fuzzy.strips import strips_centroid
from omnidrive.fuzzy.sugeno import Functions, sugeno_interval

Array = np.ndarray

SAMPLED, EXACT, CENTRE_OF_SETS, SUGENO = range(4)
CLAMP, AS_IS, REFUSE = range(3)
FINE, NOT_FINITE, OUT_OF_RANGE, NO_RULE = range(4)


class Frame(NamedTuple):
    """What surrounds the inference proper."""

    ranges: Float[Array, " range_ends"]
    """Low and high of each input."""
    fallbacks: Float[Array, " outputs"]
    """Value of each output where no rule fires."""
    levels: Float[Array, " 1"]
    """Weight of this plane in a system of type 3; 1 otherwise."""
    switches: Int[Array, " 5"]
    """How conclusions are found, whether the system is uncertain, the algorithm of type reduction,
    what happens to inputs out of range, and where no rule fires."""


_SETS, _CONDITIONS, _CONCLUSIONS, _REST = 4, 10, 15, 20
"""Where the arrays of :class:`Sets` and so on begin among those of a packed system."""


def parts(
    frame: Frame,
    sets: Sets,
    conditions: Conditions,
    conclusions: Conclusions,
    *rest: tuple[Array, ...],
) -> list[Array]:
    """The arrays of a system in the order in which the kernels unpack them."""
    return [*frame, *sets, *conditions, *conclusions, *(a for each in rest for a in each)]


@compiled
def _sets(p: Packed) -> Sets:
    return Sets(
        integers_of(p, _SETS),
        integers_of(p, _SETS + 1),
        numbers_of(p, _SETS + 2),
        numbers_of(p, _SETS + 3),
        integers_of(p, _SETS + 4),
        numbers_of(p, _SETS + 5),
    )


@compiled
def _conditions(p: Packed) -> Conditions:
    return Conditions(
        integers_of(p, _CONDITIONS),
        integers_of(p, _CONDITIONS + 1),
        integers_of(p, _CONDITIONS + 2),
        integers_of(p, _CONDITIONS + 3),
        numbers_of(p, _CONDITIONS + 4),
    )


@compiled
def _conclusions(p: Packed) -> Conclusions:
    return Conclusions(
        integers_of(p, _CONCLUSIONS),
        integers_of(p, _CONCLUSIONS + 1),
        integers_of(p, _CONCLUSIONS + 2),
        integers_of(p, _CONCLUSIONS + 3),
        integers_of(p, _CONCLUSIONS + 4),
    )


@compiled
def _samples(p: Packed) -> Samples:
    return Samples(numbers_of(p, _REST), numbers_of(p, _REST + 1))


@compiled
def _lines(p: Packed, begin: int) -> Lines:
    return Lines(
        integers_of(p, begin),
        numbers_of(p, begin + 1),
        integers_of(p, begin + 2),
        integers_of(p, begin + 3),
        numbers_of(p, begin + 4),
    )


@compiled
def _centres(p: Packed) -> Centres:
    return Centres(
        numbers_of(p, _REST),
        integers_of(p, _REST + 1),
        numbers_of(p, _REST + 2),
        integers_of(p, _REST + 3),
    )


@compiled
def admitted(p: Packed, x: Float[Array, " inputs"]) -> int:
    """Bring inputs into their range, in place, if that is what happens to them; returns a status.

    What is not finite is refused always.
    """
    ranges, switches = numbers_of(p, 0), integers_of(p, 3)
    status = FINE
    for i in range(len(x)):
        low, high = ranges[2 * i], ranges[2 * i + 1]
        if not np.isfinite(x[i]):
            return NOT_FINITE
        if x[i] < low or x[i] > high:
            if switches[3] == REFUSE:
                status = OUT_OF_RANGE
            elif switches[3] == CLAMP:
                x[i] = min(max(x[i], low), high)
    return status


@compiled
def strengths_of(p: Packed, x: Float[Array, " inputs"]) -> Float[Array, "2 rules"]:
    """Least and greatest strength of every rule; only the greatest where they are equal."""
    conditions = _conditions(p)
    uncertain = integers_of(p, 3)[1] == 1
    return fire(conditions, fuzzify(_sets(p), x, room(conditions), uncertain), uncertain)


@compiled
def infer(p: Packed, x: Float[Array, " inputs"], found: Float[Array, "3 outputs"]) -> int:
    """Value, least and greatest of every output, for inputs that are admitted; returns a status.

    The value of a system of type 2 is the middle of its interval.
    """
    conclusions, switches = _conclusions(p), integers_of(p, 3)
    strengths = strengths_of(p, x)
    found[0, :] = np.nan
    if switches[0] == SAMPLED:
        _infer_sampled(p, conclusions, strengths, found)
    elif switches[0] == EXACT:
        _infer_exact(p, conclusions, strengths, found)
    else:
        _infer_weighted(p, conclusions, strengths, x, found)
    status, fallbacks = FINE, numbers_of(p, 1)
    for o in range(found.shape[1]):
        if np.isnan(found[0, o]):
            found[:, o] = fallbacks[o]
            status = NO_RULE if switches[4] == REFUSE else status
    return status


@compiled
def _infer_sampled(
    p: Packed, c: Conclusions, strengths: Float[Array, "2 rules"], found: Float[Array, "3 outputs"]
) -> None:
    """Outputs by way of samples; those of which no rule speaks are left alone."""
    s, switches = _samples(p), integers_of(p, 3)
    outputs, cuts = found.shape[1], c.implication[0] == MIN
    count, shapes = len(s.at) // outputs, c.first_shape[-1]
    heights = strongest(c, strengths)
    degrees = s.degrees.reshape((2, shapes, count))
    both = np.empty((2, count))
    for o in range(outputs):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        some = False
        for bound in range(0 if switches[1] == 1 else 1, 2):
            if c.aggregations[o] == MAX:
                some = joined_by_max(
                    heights[bound, first:last], degrees[bound, first:last], cuts, both[bound]
                )
            else:
                some = joined_by_rule(c, o, strengths[bound], degrees[bound], both[bound])
        if some:
            at = s.at[o * count : (o + 1) * count]
            if switches[1] == 1:
                found[1, o], found[2, o] = reduced(switches[2], at, both[0], both[1])
            else:
                found[1, o] = found[2, o] = sampled_value(c.defuzzifiers[o], at, both[1])
            found[0, o] = 0.5 * (found[1, o] + found[2, o])


@compiled
def _infer_exact(
    p: Packed, c: Conclusions, strengths: Float[Array, "2 rules"], found: Float[Array, "3 outputs"]
) -> None:
    """Outputs by way of polylines; those of which no rule speaks are left alone."""
    switches, cuts = integers_of(p, 3), c.implication[0] == MIN
    upper, lower = _lines(p, _REST), _lines(p, _REST + 5)
    rows, corners = integers_of(p, _REST + 10), numbers_of(p, _REST + 11)
    heights = strongest(c, strengths)
    for o in range(found.shape[1]):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        if rows[o] == 1:
            if last > first and heights[1, first:last].max() > 0.0:
                value = strips_centroid(corners, first, heights[1, first:last])
                found[0, o] = found[1, o] = found[2, o] = value
            continue
        high = polyline(upper, o, cuts, heights[1, first:last])
        if high.shape[1] > 0:
            if switches[1] == 1:
                low = polyline(lower, o, cuts, heights[0, first:last])
                found[1, o], found[2, o] = exact_interval(switches[2], low, high)
            else:
                found[1, o] = found[2, o] = exact_value(c.defuzzifiers[o], high)
            found[0, o] = 0.5 * (found[1, o] + found[2, o])


@compiled
def _infer_weighted(
    p: Packed,
    c: Conclusions,
    strengths: Float[Array, "2 rules"],
    x: Float[Array, " inputs"],
    found: Float[Array, "3 outputs"],
) -> None:
    """Outputs as weighted means over rules; those of which no rule speaks are left alone."""
    switches = integers_of(p, 3)
    weights = summed(c, strengths, switches[1] == 1)
    for o in range(found.shape[1]):
        first, last = c.first_shape[o], c.first_shape[o + 1]
        low, high = weights[0, first:last], weights[1, first:last]
        if high.sum() > 0.0:
            if switches[0] == SUGENO:
                is_sum, functions = c.defuzzifiers[o] == WTSUM, Functions(numbers_of(p, _REST))
                ends = sugeno_interval(functions, first, is_sum, switches[2], x, low, high)
            else:
                ends = centre_of_sets(_centres(p), first, last, switches[2], weights)
            found[1, o], found[2, o] = ends
            found[0, o] = 0.5 * (found[1, o] + found[2, o])


@compiled
def rule_strengths(
    numbers: Float[Array, " numbers"],
    integers: Int[Array, " integers"],
    x: Float[Array, " inputs"],
) -> Float[Array, "2 rules"]:
    """Least and greatest strength of every rule, for inputs that are brought into their range."""
    p = Packed(numbers, integers)
    admitted(p, x)
    strengths = strengths_of(p, x)
    if integers_of(p, 3)[1] == 0:
        strengths[0] = strengths[1]
    return strengths


@compiled
def infer_one(
    numbers: Float[Array, " numbers"], integers: Int[Array, " integers"], x: tuple[float, ...]
) -> tuple[int, Float[Array, "3 outputs"]]:
    """Status, and value, least and greatest of every output, of a system of type 1 or 2."""
    p = Packed(numbers, integers)
    inputs = np.empty(len(x))
    for i in range(len(x)):
        inputs[i] = x[i]
    found = np.empty((3, len(numbers_of(p, 1))))
    status = admitted(p, inputs)
    if status == FINE:
        status = infer(p, inputs, found)
    return status, found


@compiled
def value_of_one(
    numbers: Float[Array, " numbers"], integers: Int[Array, " integers"], x: tuple[float, ...]
) -> tuple[int, Float[Array, " outputs"]]:
    """As :func:`infer_one`, but only the values: a view less to make for Python."""
    status, found = infer_one(numbers, integers, x)
    return status, found[0]


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
    each, x, levels = np.empty(found.shape[1:]), np.empty(rows.shape[1]), 0.0
    found[:] = 0.0
    for k in range(len(planes)):
        p = Packed(numbers[planes[k, 0] : planes[k, 1]], integers[planes[k, 2] : planes[k, 3]])
        level = numbers_of(p, 2)[0]
        levels += level
        for r in range(len(rows)):
            x[:] = rows[r]
            status = admitted(p, x)
            if status == FINE:
                status = infer(p, x, each)
            if status != FINE:
                return status, r
            found[r] += level * each
    if len(planes) > 1:
        found /= levels
    return FINE, len(rows)
