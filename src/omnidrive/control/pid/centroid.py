"""Centroids of a type-1 conclusion: the union of triangles cut at given heights."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled

Array = np.ndarray


_Line = tuple[float, float]
"""x = first + second * y."""


@compiled
def _strip(left: _Line, right: _Line, low: float, high: float) -> tuple[float, float]:
    """Area and first moment about x = 0 of the strip between two lines, for low <= y <= high.

    The distance w and the middle m of the lines are linear in y, so the integral of w m is its
    value at half height times the height, plus w' m' height^3 / 12.
    """
    height, y = high - low, 0.5 * (low + high)
    widening, drift = right[1] - left[1], 0.5 * (left[1] + right[1])
    area = (right[0] - left[0] + widening * y) * height
    middle = 0.5 * (left[0] + right[0]) + drift * y
    return area, middle * area + drift * widening * height**3 / 12.0


@compiled
def exact_centroid(heights: Float[Array, " sets"], sets: Float[Array, "sets 3"]) -> float:
    """Centroid of ``max_k min(heights_k, triangle_k)``, in closed form.

    At every height y the conclusion is the union of the intervals [l_k(y), r_k(y)] of the sets
    with heights_k >= y. Where feet and peaks all ascend with k, so do both ends, and the union's
    length is the sum of the lengths less the overlaps of neighbours (inclusion and exclusion: what
    i < k share, all between share too). Sets i and k are neighbours between the greatest height
    of a set between them and the lesser of theirs, and overlap up to where their sides cross. The
    ends are linear in y: every term is an area between two straight lines.

    Args:
        heights: Where each set is cut, 0 to 1.
        sets: Left foot, peak, right foot; each column ascending.

    Returns:
        The centroid; the middle of the range if every height is zero.
    """
    area, moment = 0.0, 0.0
    for k in range(len(sets)):
        if heights[k] <= 0.0:
            continue
        a, b, c = sets[k]
        side = (a, b - a)
        da, dm = _strip(side, (c, b - c), 0.0, heights[k])
        area, moment = area + da, moment + dm
        between = 0.0
        for i in range(k - 1, -1, -1):
            other = (sets[i, 2], sets[i, 1] - sets[i, 2])
            if other[0] <= a or between >= heights[k]:
                break  # nor does any set further left overlap, or show above those between
            closing = side[1] - other[1]
            crossing = (other[0] - a) / closing if closing > 0.0 else 1.0
            top = min(heights[i], heights[k], crossing)
            if top > between:
                da, dm = _strip(side, other, between, top)
                area, moment = area - da, moment - dm
            between = max(between, heights[i])
    return moment / area if area > 0.0 else 0.5 * (sets[0, 0] + sets[-1, 2])


@compiled
def cut_union(
    heights: Float[Array, " sets"], samples: Float[Array, "sets samples"]
) -> Float[Array, " samples"]:
    """Samples of ``max_k min(heights_k, set_k)``, given samples of the sets."""
    union = np.zeros(samples.shape[1])
    for k in range(len(samples)):
        if heights[k] > 0.0:
            for i in range(samples.shape[1]):
                union[i] = max(union[i], min(heights[k], samples[k, i]))
    return union


@compiled
def sampled_centroid(at: Float[Array, " samples"], degree: Float[Array, " samples"]) -> float:
    """Matlab's centroid, ``sum(degree x) / sum(degree)``; the middle of the range if all zero."""
    area, moment = 0.0, 0.0
    for i in range(len(at)):
        area += degree[i]
        moment += degree[i] * at[i]
    return moment / area if area > 0.0 else 0.5 * (at[0] + at[-1])
