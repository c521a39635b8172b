"""Fuzzy sets as the kernels read them: from a value to its degree in each of many sets."""

from __future__ import annotations

from collections.abc import Sequence
from math import log, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.membership import Curves, Membership, degree
from omnidrive.fuzzy.variables import Footprint, FuzzySet


class Sets(NamedTuple):
    """The sets of some variables, flat."""

    first_set: Int[Array, " set_edges"]
    """Where the sets of each variable begin, and the number of all."""
    kernels: Int[Array, " functions"]
    parameters: Float[Array, " parameters"]
    points: Float[Array, " coordinates"]
    """:class:`Curves`: the upper function of each set, then those of lower functions."""
    lower: Int[Array, " sets"]
    """From which function the lower one of each set follows."""
    footprints: Float[Array, " footprint_numbers"]
    """How it follows: scale, left lag, right lag, middle; then the width of the plane, 0 to 1."""


class ZSlice(NamedTuple):
    """One horizontal slice of the secondary functions of a type-3 system."""

    level: float
    """Secondary membership at which it cuts, 0 to 1."""
    of_lower: bool
    """Whether it cuts the lower secondary functions, not the upper ones."""


WHOLE = ZSlice(0.0, of_lower=False)
"""The whole footprint: all that a type-2 system knows."""


def width(each: FuzzySet, plane: ZSlice) -> float:
    """Width of the plane of a set over the width of its footprint, 0 to 1.

    The half width of a Gaussian with standard deviation s at level a is s sqrt(-2 ln a). Where the
    lower function is scale max(0, (upper - lag)/(1 - lag)), it is at level a where the upper one
    is at lag + (1 - lag) a/scale. A lower function that does not reach the level has width 0.
    """
    secondary, level = each.secondary, plane.level
    if secondary is None or level <= 0.0:
        return 1.0
    if plane.of_lower:
        if level > secondary.scale:
            return 0.0
        level = secondary.lag + (1.0 - secondary.lag) * level / secondary.scale
    half = secondary.spread * sqrt(-2.0 * log(level)) if level < 1.0 else 0.0
    return min(1.0, half / sqrt(3.0))


def sets_of(variables: Sequence[Sequence[FuzzySet]], plane: ZSlice = WHOLE) -> Sets:
    """Sets of each of some variables; one plane of them, if they are of type 3."""
    sets = [each for variable in variables for each in variable]
    functions = [each.upper for each in sets]
    lower, footprints = [], []
    for k, each in enumerate(sets):
        source, footprint = k, Footprint()
        if isinstance(each.lower, Membership):
            source = len(functions)
            functions.append(each.lower)
        elif each.lower is not None:
            footprint = each.lower
        lower.append(source)
        footprints += [footprint.scale, *footprint.lags, each.upper.middle, width(each, plane)]
    return Sets(
        np.cumsum([0, *map(len, variables)]),
        *Curves.of(functions),
        np.array(lower, dtype=np.int64),
        np.array(footprints, dtype=np.float64),
    )


def membership_bounds(
    sets: Sequence[FuzzySet], at: Float[Array, " points"], plane: ZSlice = WHOLE
) -> tuple[Float[Array, "sets points"], Float[Array, "sets points"]]:
    """Lower and upper degree of every point in every set; equal for sets of type 1."""
    return _bounds(sets_of([sets], plane), at)


@compiled
def _bounds(
    s: Sets, at: Float[Array, " points"]
) -> tuple[Float[Array, "sets points"], Float[Array, "sets points"]]:
    lower, upper = np.empty((len(s.lower), len(at))), np.empty((len(s.lower), len(at)))
    x, degrees = np.empty(1), np.empty((2, len(s.lower)))
    for i in range(len(at)):
        x[0] = at[i]
        fuzzify(s, x, True, degrees)
        lower[:, i], upper[:, i] = degrees[0], degrees[1]
    return lower, upper


@compiled
def fuzzify(
    s: Sets, x: Float[Array, " variables"], uncertain: bool, degrees: Float[Array, "2 degrees"]
) -> None:
    """Fill in the lower and upper degree of every set; they are equal unless ``uncertain``."""
    curves = Curves(s.kernels, s.parameters, s.points)
    first_set, lower, footprints = s.first_set, s.lower, s.footprints
    for i in range(len(x)):
        for k in range(first_set[i], first_set[i + 1]):
            high = degree(curves, k, x[i])
            low = high
            if uncertain and (high > 0.0 or lower[k] != k):
                base = high if lower[k] == k else degree(curves, lower[k], x[i])
                lag, right, middle = (
                    footprints[5 * k + 1], footprints[5 * k + 2], footprints[5 * k + 3]
                )  # fmt: skip
                if x[i] >= middle:
                    lag = right if x[i] > middle else min(lag, right)
                low = footprints[5 * k] * max(0.0, (base - lag) / (1.0 - lag))
                width = footprints[5 * k + 4]
                if width < 1.0:
                    centre, half = 0.5 * (low + high), 0.5 * width * (high - low)
                    low, high = centre - half, centre + half
            degrees[0, k], degrees[1, k] = low, high
