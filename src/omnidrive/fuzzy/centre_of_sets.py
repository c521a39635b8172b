"""Centre-of-sets type reduction: a weighted mean of the centroids of what rules conclude."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.consequents import Shape
from omnidrive.fuzzy.reduction import KM, greatest_from, least_from, middle, reduced
from omnidrive.fuzzy.sampled import samples_of
from omnidrive.fuzzy.segment_centroid import exact_interval, polyline
from omnidrive.fuzzy.segments import lines_of
from omnidrive.fuzzy.sets import WHOLE, ZSlice
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.unsafe_views import part


class Centres(NamedTuple):
    """Least and greatest centroid of every shape of every output, each in ascending order."""

    least: Float[Array, " shapes"]
    least_shape: Int[Array, " shapes"]
    """To which shape each belongs, counted within the output."""
    greatest: Float[Array, " shapes"]
    greatest_shape: Int[Array, " shapes"]


def centres_of(
    system: FuzzySystem,
    shapes: tuple[tuple[Shape, ...], ...],
    samples: int | None,
    plane: ZSlice = WHOLE,
) -> Centres:
    """Centroid interval of every shape; exact, or on ``samples`` samples of the range."""
    pairs = (
        _exact(system, shapes, plane)
        if samples is None
        else _sampled(system, shapes, samples, plane)
    )
    columns: list[Array] = []
    for side in range(2):
        ends = [np.array([pair[side] for pair in own]) for own in pairs]
        orders = [np.argsort(each, kind="stable") for each in ends]
        ordered = [each[order] for each, order in zip(ends, orders, strict=True)]
        columns += [np.concatenate(ordered), np.concatenate(orders)]
    return Centres(*columns)


_Pairs = list[list[tuple[float, float]]]


def _exact(system: FuzzySystem, shapes: tuple[tuple[Shape, ...], ...], plane: ZSlice) -> _Pairs:
    upper = lines_of(system, shapes, plane)
    lower = lines_of(system, shapes, plane, of_lower=True)
    pairs: _Pairs = []
    for output, own in enumerate(shapes):
        pairs.append([])
        for k in range(len(own)):
            alone = np.zeros(len(own))
            alone[k] = 1.0
            functions = [polyline(lines, output, True, alone) for lines in (lower, upper)]
            pairs[-1].append(exact_interval(KM, *functions))
    return pairs


def _sampled(
    system: FuzzySystem, shapes: tuple[tuple[Shape, ...], ...], count: int, plane: ZSlice
) -> _Pairs:
    s = samples_of(system, shapes, count, plane)
    at = s.at.reshape(-1, count)
    lower, upper = s.degrees.reshape(2, -1, count)
    owners = [output for output, own in enumerate(shapes) for _ in own]
    pairs: _Pairs = [[] for _ in shapes]
    for k, output in enumerate(owners):
        if not upper[k].any():
            upper[k] = 1.0  # a set between two samples: no more is known than the range
        pairs[output].append(reduced(KM, at[output], lower[k], upper[k]))
    return pairs


@compiled
def centre_of_sets(  # noqa: PLR0917
    s: Centres,
    first: int,
    last: int,
    algorithm: int,
    weights: Float[Array, "2 shapes"],
    points: Float[Array, "2 points"],
) -> tuple[float, float]:
    """Least and greatest mean of the centroids of the shapes, by the strengths of their rules.

    Mendel, "Uncertain Rule-Based Fuzzy Systems", 2nd ed. 2017.

    Args:
        s: Centroids of the shapes.
        first: First shape of the output.
        last: The one after its last.
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        weights: Sums of the least and the greatest strengths of the rules that conclude each
            shape; where the latter are all zero, the mean is nan.
        points: Room for the weights in the order of the centroids.
    """
    low, high = part(points[0], 0, last - first), part(points[1], 0, last - first)
    for k in range(first, last):
        shape = first + s.least_shape[k]
        low[k - first], high[k - first] = weights[0, shape], weights[1, shape]
    at = part(s.least, first, last)
    left = least_from(middle(at, low, high), algorithm, at, low, high)
    for k in range(first, last):
        shape = first + s.greatest_shape[k]
        low[k - first], high[k - first] = weights[0, shape], weights[1, shape]
    at = part(s.greatest, first, last)
    return left, greatest_from(middle(at, low, high), algorithm, at, low, high)
