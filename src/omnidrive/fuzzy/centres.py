"""Centre-of-sets type reduction: a weighted mean of the centroids of what rules conclude."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.fuzzy.conclusions import Conclusions, Shape
from omnidrive.fuzzy.exact import exact_interval, lines_of, polyline
from omnidrive.fuzzy.reduction import KM, greatest, least, reduced
from omnidrive.fuzzy.sampled import samples_of
from omnidrive.fuzzy.sets import WHOLE, Plane
from omnidrive.fuzzy.system import FuzzySystem

Array = np.ndarray


class Centres(NamedTuple):
    """Least and greatest centroid of every shape of every output, each in ascending order."""

    least: Float[Array, " shapes"]
    least_shape: Int[Array, " shapes"]
    """To which shape each belongs, counted within the output."""
    greatest: Float[Array, " shapes"]
    greatest_shape: Int[Array, " shapes"]


def centres_of(
    system: FuzzySystem,
    conclusions: Conclusions,
    shapes: tuple[tuple[Shape, ...], ...],
    samples: int | None,
    plane: Plane = WHOLE,
) -> Centres:
    """Centroid interval of every shape; exact, or on ``samples`` samples of the range."""
    pairs = (
        _exact(system, conclusions, shapes, plane)
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


def _exact(
    system: FuzzySystem, c: Conclusions, shapes: tuple[tuple[Shape, ...], ...], plane: Plane
) -> _Pairs:
    upper = lines_of(system, shapes, plane)
    lower = lines_of(system, shapes, plane, of_lower=True)
    pairs: _Pairs = []
    for output, own in enumerate(shapes):
        pairs.append([])
        for k in range(len(own)):
            alone = np.zeros(len(own))
            alone[k] = 1.0
            functions = [polyline(c, lines, output, alone) for lines in (lower, upper)]
            pairs[-1].append(exact_interval(KM, *functions))
    return pairs


def _sampled(
    system: FuzzySystem, shapes: tuple[tuple[Shape, ...], ...], count: int, plane: Plane
) -> _Pairs:
    s = samples_of(system, shapes, count, plane)
    at = s.at.reshape(-1, count)
    lower, upper = s.lower.reshape(-1, count), s.upper.reshape(-1, count)
    owners = [output for output, own in enumerate(shapes) for _ in own]
    pairs: _Pairs = [[] for _ in shapes]
    for k, output in enumerate(owners):
        if not upper[k].any():
            upper[k] = 1.0  # a set between two samples: no more is known than the range
        pairs[output].append(reduced(KM, at[output], lower[k], upper[k]))
    return pairs


@compiled
def centre_of_sets(  # noqa: PLR0917
    c: Conclusions,
    s: Centres,
    output: int,
    algorithm: int,
    lower: Float[Array, " shapes"],
    upper: Float[Array, " shapes"],
) -> tuple[float, float]:
    """Least and greatest mean of the centroids of the shapes, by the strengths of their rules.

    Mendel, "Uncertain Rule-Based Fuzzy Systems", 2nd ed. 2017.

    Args:
        c: What each rule concludes.
        s: Centroids of the shapes.
        output: Which output.
        algorithm: Place in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        lower: Sum of the least strengths of the rules that conclude each shape.
        upper: Sum of their greatest strengths; not all zero.
    """
    first, count = c.first_shape[output], len(lower)
    low, high = np.empty(count), np.empty(count)
    for k in range(count):
        shape = s.least_shape[first + k]
        low[k], high[k] = lower[shape], upper[shape]
    left = least(algorithm, s.least[first : first + count], low, high)
    for k in range(count):
        shape = s.greatest_shape[first + k]
        low[k], high[k] = lower[shape], upper[shape]
    return left, greatest(algorithm, s.greatest[first : first + count], low, high)
