"""Fuzzy sets as flat arrays, and the degrees of membership of a value in many sets."""

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


class FlatSets(NamedTuple):
    """Sets of several variables as flat arrays for the kernels."""

    first_set: Int[Array, " set_edges"]
    """First set of each variable, then the number of all sets."""
    kernels: Int[Array, " functions"]
    parameters: Float[Array, " parameters"]
    points: Float[Array, " coordinates"]
    """:class:`Curves`: the upper function of each set, then the lower functions that are given."""
    lower: Int[Array, " sets"]
    """Function from which the lower function of each set is derived."""
    footprints: Float[Array, " footprint_numbers"]
    """Five numbers per set: scale, left lag, right lag and core midpoint of the footprint, and the
    relative width of the z-slice, 0 to 1."""


class ZSlice(NamedTuple):
    """Horizontal slice of the secondary membership functions of a type-3 system (a zSlice)."""

    level: float
    """Secondary membership of the slice, 0 to 1."""
    of_lower: bool
    """Whether the slice is one of the lower secondary functions, not of the upper ones."""


FULL_FOOTPRINT = ZSlice(0.0, of_lower=False)
"""The footprint of uncertainty itself, at secondary membership 0."""


def slice_width(each: FuzzySet, z_slice: ZSlice) -> float:
    """Return the width of a z-slice of a set, relative to the width of its footprint, 0 to 1.

    The half width of a Gaussian with standard deviation s at level a is s sqrt(-2 ln a). A lower
    function scale max(0, (upper - lag)/(1 - lag)) has level a where the upper one has
    lag + (1 - lag) a/scale. A lower function below the level has width 0.
    """
    secondary, level = each.secondary, z_slice.level
    if secondary is None or level <= 0.0:
        return 1.0
    if z_slice.of_lower:
        if level > secondary.scale:
            return 0.0
        level = secondary.lag + (1.0 - secondary.lag) * level / secondary.scale
    half = secondary.spread * sqrt(-2.0 * log(level)) if level < 1.0 else 0.0
    return min(1.0, half / sqrt(3.0))


def flatten_sets(
    variables: Sequence[Sequence[FuzzySet]], z_slice: ZSlice = FULL_FOOTPRINT
) -> FlatSets:
    """Return the sets of several variables as flat arrays; for type 3, one z-slice of them."""
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
        footprints += [
            footprint.scale,
            *footprint.lags,
            each.upper.core_midpoint,
            slice_width(each, z_slice),
        ]
    return FlatSets(
        np.cumsum([0, *map(len, variables)]),
        *Curves.of(functions),
        np.array(lower, dtype=np.int64),
        np.array(footprints, dtype=np.float64),
    )


def membership_bounds(
    sets: Sequence[FuzzySet], at: Float[Array, " points"], z_slice: ZSlice = FULL_FOOTPRINT
) -> tuple[Float[Array, "sets points"], Float[Array, "sets points"]]:
    """Return the lower and the upper degree of every point in every set; equal for type-1 sets.

    Args:
        sets: The sets.
        at: The points, in the unit of the variable.
        z_slice: For type-3 sets, the slice whose bounds are returned.
    """
    return _membership_bounds(flatten_sets([sets], z_slice), at)


@compiled
def _membership_bounds(
    s: FlatSets, at: Float[Array, " points"]
) -> tuple[Float[Array, "sets points"], Float[Array, "sets points"]]:
    lower, upper = np.empty((len(s.lower), len(at))), np.empty((len(s.lower), len(at)))
    x, degrees = np.empty(1), np.empty((2, len(s.lower)))
    for i in range(len(at)):
        x[0] = at[i]
        fuzzify(s, x, True, degrees)
        for k in range(len(s.lower)):
            lower[k, i], upper[k, i] = degrees[0, k], degrees[1, k]
    return lower, upper


@compiled
def fuzzify(
    s: FlatSets, x: Float[Array, " variables"], uncertain: bool, degrees: Float[Array, "2 degrees"]
) -> None:
    """Fill in the lower and the upper degree of every set.

    Args:
        s: The sets.
        x: Value of each variable.
        uncertain: Whether lower degrees are computed; otherwise they equal the upper ones.
        degrees: Result.
    """
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
                slice_width = footprints[5 * k + 4]
                if slice_width < 1.0:
                    centre, half = 0.5 * (low + high), 0.5 * slice_width * (high - low)
                    low, high = centre - half, centre + half
            degrees[0, k], degrees[1, k] = low, high
