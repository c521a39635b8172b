"""Triangular fuzzy sets, and the footprints that make them interval type-2."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled

Array = np.ndarray

INPUT_SETS = np.array(
    [
        (-1.0, -1.0, -0.6667),
        (-1.0, -0.6667, 0.0),
        (-1.0, -0.3333, 0.3333),
        (-0.6667, 0.0, 0.6667),
        (-0.3333, 0.3333, 1.0),
        (0.0, 0.6667, 1.0),
        (0.6667, 1.0, 1.0),
    ]
)
"""Left foot, peak and right foot of the sets of the scaled error and of its scaled change, NB to
PB; four decimals, as published."""

OUTPUT_SETS = np.array(
    [
        (-0.1, -0.1, -0.06667),
        (-0.1, -0.06667, 0.0),
        (-0.1, -0.03333, 0.03333),
        (-0.06667, 0.0, 0.06667),
        (-0.03333, 0.03333, 0.1),
        (0.0, 0.06667, 0.1),
        (0.06667, 0.1, 0.1),
    ]
)
"""The same for the change of each gain."""


class Footprint(NamedTuple):
    """How far the lower membership function lies within the upper one, a triangle (a, b, c).

    The lower function is ``scale`` times the triangle (a + lag (b - a), b, c - lag (c - b)).
    """

    scale: float
    """Peak of the lower function; 0 to 1, without unit."""
    lag: float
    """Part of each side over which the lower function stays zero; 0 to 1, without unit."""


CRISP = Footprint(scale=1.0, lag=0.0)
"""No uncertainty: a type-2 set with this footprint is a type-1 set."""


def lagged(sets: Float[Array, "sets 3"], footprint: Footprint) -> Float[Array, "sets 3"]:
    """Triangles of the lower membership functions, before they are scaled."""
    a, b, c = sets.T
    return np.column_stack([a + footprint.lag * (b - a), b, c - footprint.lag * (c - b)])


@compiled
def membership(x: float, a: float, b: float, c: float) -> float:
    """Degree to which ``x`` belongs to the triangle with feet a, c and peak b; a <= b <= c.

    Closed at the feet of a vertical side, so that ``x = a = b`` belongs wholly.
    """
    if x < a or x > c:
        return 0.0
    if x < b:
        return (x - a) / (b - a)
    if x > b:
        return (c - x) / (c - b)
    return 1.0


def sampled(
    sets: Float[Array, "sets 3"], at: Float[Array, " samples"], scale: float
) -> Float[Array, "sets samples"]:
    """Membership of every sample in every set, times ``scale``."""
    return np.array([[scale * membership(x, *abc) for x in at.tolist()] for abc in sets.tolist()])
