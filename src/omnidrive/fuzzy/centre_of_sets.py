"""Centre-of-sets type reduction: a weighted mean of the centroids of the consequents."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import unsafe_slice
from omnidrive.fuzzy.consequents import Consequent
from omnidrive.fuzzy.reduction import KM, left_end, nie_tan, right_end, type_reduce
from omnidrive.fuzzy.sampled import samples_of
from omnidrive.fuzzy.segment_centroid import aggregate_segments, centroid_interval
from omnidrive.fuzzy.segments import segments_of
from omnidrive.fuzzy.sets import FULL_FOOTPRINT, ZSlice
from omnidrive.fuzzy.spikes import Spikes
from omnidrive.fuzzy.system import FuzzySystem


class Centroids(NamedTuple):
    """Left and right ends of the centroids of the consequents, each ascending per output."""

    left: Float[Array, " consequents"]
    left_index: Int[Array, " consequents"]
    """Consequent of each left end, numbered within the output."""
    right: Float[Array, " consequents"]
    right_index: Int[Array, " consequents"]
    """Consequent of each right end, numbered within the output."""


def centroids_of(
    system: FuzzySystem,
    consequents: tuple[tuple[Consequent, ...], ...],
    samples: int | None,
    spikes: Spikes,
    z_slice: ZSlice = FULL_FOOTPRINT,
) -> Centroids:
    """Return the centroid interval of every consequent.

    The intervals are exact if ``samples`` is None, otherwise computed on that number of samples.
    That of a consequent without area follows from its isolated points, ``spikes``; without such
    points, it is the range.
    """
    pairs = (
        _exact(system, consequents, spikes, z_slice)
        if samples is None
        else _sampled(system, consequents, samples, z_slice)
    )
    owners = [(output, k) for output, own in enumerate(pairs) for k in range(len(own))]
    for number in np.flatnonzero(spikes.has_area == 0).tolist():
        output, k = owners[number]
        pairs[output][k] = _spikes_interval(system, spikes, output, number)
    columns: list[Array] = []
    for side in range(2):
        ends = [np.array([pair[side] for pair in own]) for own in pairs]
        orders = [np.argsort(each, kind="stable") for each in ends]
        ordered = [each[order] for each, order in zip(ends, orders, strict=True)]
        columns += [np.concatenate(ordered), np.concatenate(orders)]
    return Centroids(*columns)


_Pairs = list[list[tuple[float, float]]]


def _spikes_interval(
    system: FuzzySystem, spikes: Spikes, output: int, number: int
) -> tuple[float, float]:
    count = len(spikes.at) // len(system.outputs)
    lower, upper = spikes.degrees.reshape(2, len(spikes.has_area), count)[:, number]
    if not upper.any():
        return system.outputs[output].low, system.outputs[output].high
    return type_reduce(KM, spikes.at[output * count : (output + 1) * count], lower, upper)


def _exact(
    system: FuzzySystem,
    consequents: tuple[tuple[Consequent, ...], ...],
    spikes: Spikes,
    z_slice: ZSlice,
) -> _Pairs:
    upper = segments_of(system, consequents, z_slice)
    lower = segments_of(system, consequents, z_slice, of_lower=True)
    pairs: _Pairs = []
    number = -1
    for output, own in enumerate(consequents):
        pairs.append([])
        for k in range(len(own)):
            number += 1
            if not spikes.has_area[number]:
                pairs[-1].append((0.0, 0.0))  # replaced by the caller
                continue
            alone = np.zeros(len(own))
            alone[k] = 1.0
            functions = [
                aggregate_segments(segments, output, True, alone) for segments in (lower, upper)
            ]
            pairs[-1].append(centroid_interval(KM, *functions))
    return pairs


def _sampled(
    system: FuzzySystem,
    consequents: tuple[tuple[Consequent, ...], ...],
    count: int,
    z_slice: ZSlice,
) -> _Pairs:
    s = samples_of(system, consequents, count, z_slice)
    at = s.at.reshape(-1, count)
    lower, upper = s.degrees.reshape(2, -1, count)
    owners = [output for output, own in enumerate(consequents) for _ in own]
    pairs: _Pairs = [[] for _ in consequents]
    for k, output in enumerate(owners):
        if not upper[k].any():
            upper[k] = 1.0  # a set between two samples: its centroid may be anywhere in the range
        pairs[output].append(type_reduce(KM, at[output], lower[k], upper[k]))
    return pairs


@compiled
def centre_of_sets(  # noqa: PLR0917
    s: Centroids,
    first: int,
    last: int,
    algorithm: int,
    weights: Float[Array, "2 consequents"],
    points: Float[Array, "2 points"],
) -> tuple[float, float]:
    """Return the least and the greatest weighted mean of the centroids of the consequents.

    The weights lie between the lower and the upper firing strengths of the rules (Mendel,
    "Uncertain Rule-Based Fuzzy Systems", 2nd ed. 2017).

    Args:
        s: Centroids of the consequents.
        first: First consequent of the output.
        last: The one after its last consequent.
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        weights: Sums of the lower and of the upper strengths of the rules with each consequent; if
            the upper sums are all zero, the result is nan.
        points: Workspace for the weights in the order of the centroids.
    """
    low, high = unsafe_slice(points[0], 0, last - first), unsafe_slice(points[1], 0, last - first)
    for k in range(first, last):
        consequent = first + s.left_index[k]
        low[k - first], high[k - first] = weights[0, consequent], weights[1, consequent]
    at = unsafe_slice(s.left, first, last)
    left = left_end(nie_tan(at, low, high), algorithm, at, low, high)
    for k in range(first, last):
        consequent = first + s.right_index[k]
        low[k - first], high[k - first] = weights[0, consequent], weights[1, consequent]
    at = unsafe_slice(s.right, first, last)
    return left, right_end(nie_tan(at, low, high), algorithm, at, low, high)
