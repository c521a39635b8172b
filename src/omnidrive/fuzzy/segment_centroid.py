"""Exact aggregation and defuzzification of consequents that are made of straight segments."""

from __future__ import annotations

from math import sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.reduction import NIE_TAN
from omnidrive.fuzzy.sampled import BISECTOR, CENTROID, MOM, select_maximum
from omnidrive.fuzzy.segments import Segments


@compiled
def aggregate_segments(
    s: Segments, output: int, clips: bool, heights: Float[Array, " consequents"]
) -> Float[Array, "4 pieces"]:
    """Aggregate the consequents of one output: the maximum of the clipped (or scaled) consequents.

    The range is divided into pieces on which the consequents, before clipping or scaling, are
    straight segments that do not cross; they are sorted from the highest to the lowest. A clipped
    segment can exceed the segments before it only if its height of clipping, the firing strength,
    is greater than all of theirs; other segments are skipped. So the maximum has a corner only
    where a segment reaches its own height or that of the segment before it. Scaled segments may
    cross: their maximum has a corner where the highest one is overtaken by a steeper one.

    Args:
        s: Segments of the consequents of all outputs.
        output: Number of the output.
        clips: Whether consequents are clipped; otherwise they are scaled.
        heights: Firing strength of each consequent of the output.

    Returns:
        Straight parts of the maximum from left to right, one per column: left end, right end, and
        the degrees there.
    """
    begin, end = s.first_piece[output], s.first_piece[output + 1]
    ends, first_segment, owners, degrees = s.ends, s.first_segment, s.owners, s.degrees
    consequents = len(heights)
    segments = first_segment[end] - first_segment[begin]
    pieces = np.empty((4, 2 * segments))
    cap, p, q = np.empty(consequents), np.empty(consequents), np.empty(consequents)
    breaks = np.empty(2 * consequents)
    count = 0
    for piece in range(begin, end):
        shown, top = 0, 0.0
        for k in range(first_segment[piece], first_segment[piece + 1]):
            height = heights[owners[k]]
            if height <= 0.0 or (clips and height <= top):
                continue
            scale = 1.0 if clips else height
            cap[shown] = height  # also an upper bound of a scaled segment, as degrees are at most 1
            p[shown], q[shown] = scale * degrees[2 * k], scale * degrees[2 * k + 1]
            shown, top = shown + 1, height
        if shown == 0:
            continue
        number = (
            _clipped_breaks(cap, p, q, shown, breaks)
            if clips
            else _scaled_breaks(p, q, shown, breaks)
        )
        left, width = ends[2 * piece], ends[2 * piece + 1] - ends[2 * piece]
        fraction, before = 0.0, _envelope(cap, p, q, shown, 0.0)
        for k in range(number + 1):
            to = breaks[k] if k < number else 1.0
            after = _envelope(cap, p, q, shown, to)
            pieces[0, count], pieces[1, count] = left + width * fraction, left + width * to
            pieces[2, count], pieces[3, count] = before, after
            fraction, before, count = to, after, count + 1
    return pieces[:, :count]


@compiled
def _envelope(
    cap: Float[Array, " segments"],
    p: Float[Array, " segments"],
    q: Float[Array, " segments"],
    shown: int,
    fraction: float,
) -> float:
    """Return the greatest degree of clipped segments at a fraction of the width of a piece.

    Args:
        cap: Height at which each segment is clipped.
        p: Degree of each segment at the left end, before clipping.
        q: Degree of each segment at the right end, before clipping.
        shown: Number of segments; the rest of each array is unused.
        fraction: Distance from the left end over the width, 0 to 1.
    """
    best = 0.0
    for k in range(shown):
        best = max(best, min(cap[k], p[k] + (q[k] - p[k]) * fraction))
    return best


@compiled
def _clipped_breaks(
    cap: Float[Array, " segments"],
    p: Float[Array, " segments"],
    q: Float[Array, " segments"],
    shown: int,
    breaks: Float[Array, " breaks"],
) -> int:
    """Find the corners of the maximum of clipped segments; return their number.

    They are written to ``breaks`` as ascending fractions of the width; the other arguments are
    those of :func:`_envelope`.
    """
    number = 0
    for k in range(shown):
        if p[k] != q[k]:
            slope = q[k] - p[k]
            number = _insert_sorted(breaks, number, (cap[k] - p[k]) / slope)
            if k > 0:
                number = _insert_sorted(breaks, number, (cap[k - 1] - p[k]) / slope)
    return number


@compiled
def _scaled_breaks(
    p: Float[Array, " segments"],
    q: Float[Array, " segments"],
    shown: int,
    breaks: Float[Array, " breaks"],
) -> int:
    """Find the corners of the maximum of scaled segments; return their number.

    They are written to ``breaks`` as ascending fractions of the width; the other arguments are
    those of :func:`_envelope`.
    """
    highest = 0
    for k in range(1, shown):
        if p[k] > p[highest] or (p[k] == p[highest] and q[k] > q[highest]):
            highest = k
    number, fraction = 0, 0.0
    while True:
        follower, nearest = -1, 1.0
        for k in range(shown):
            closing = (q[k] - p[k]) - (q[highest] - p[highest])
            if closing > 0.0:
                crossing = max(fraction, (p[highest] - p[k]) / closing)
                if crossing < nearest:
                    follower, nearest = k, crossing
        if follower < 0:
            return number
        if nearest > fraction:
            breaks[number] = nearest
            number += 1
        highest, fraction = follower, nearest


@compiled
def _insert_sorted(breaks: Float[Array, " breaks"], number: int, fraction: float) -> int:
    """Insert a fraction in ascending order if it is between 0 and 1; return the new number."""
    if not 0.0 < fraction < 1.0:
        return number
    k = number
    while k > 0 and breaks[k - 1] > fraction:
        breaks[k] = breaks[k - 1]
        k -= 1
    breaks[k] = fraction
    return number + 1


@compiled
def defuzzify_exact(defuzzifier: int, polyline: Float[Array, "4 pieces"]) -> float:
    """Return the defuzzified value of a polyline, in closed form.

    Args:
        defuzzifier: Index in :data:`~omnidrive.fuzzy.variables.DEFUZZIFIERS`.
        polyline: Membership function, as from :func:`aggregate_segments`; at least one piece.
    """
    if defuzzifier == CENTROID:
        area, moment = _moments_left_of(polyline, np.inf)
        return _clamp_to_support(polyline, moment / area if area > 0.0 else np.nan)
    if defuzzifier == BISECTOR:
        return _bisector(polyline)
    return _exact_maximum(defuzzifier, polyline)


@compiled
def _clamp_to_support(polyline: Float[Array, "4 pieces"], mean: float) -> float:
    """Return a mean clamped to the support; the middle of the support if the mean is not finite.

    Denormal degrees have too few significant digits for an exact mean.
    """
    first, last = float(polyline[0, 0]), float(polyline[1, -1])
    return min(max(mean, first), last) if np.isfinite(mean) else 0.5 * (first + last)


@compiled
def _moments_left_of(polyline: Float[Array, "4 pieces"], split: float) -> tuple[float, float]:
    """Return area and first moment about x = 0 of the part left of ``split``."""
    area, moment = 0.0, 0.0
    for k in range(polyline.shape[1]):
        x0, x1, y0, y1 = polyline[0, k], polyline[1, k], polyline[2, k], polyline[3, k]
        if split <= x0:
            break
        if split < x1:
            y1 = y0 + (y1 - y0) * (split - x0) / (x1 - x0)
            x1 = split
        area += 0.5 * (x1 - x0) * (y0 + y1)
        moment += (x1 - x0) * (x0 * (2.0 * y0 + y1) + x1 * (y0 + 2.0 * y1)) / 6.0
    return area, moment


@compiled
def _moments_right_of(polyline: Float[Array, "4 pieces"], split: float) -> tuple[float, float]:
    """Return area and first moment about x = 0 of the part right of ``split``.

    The sum over the right part avoids the cancellation in a difference of two nearly equal areas.
    """
    area, moment = 0.0, 0.0
    for k in range(polyline.shape[1]):
        x0, x1, y0, y1 = polyline[0, k], polyline[1, k], polyline[2, k], polyline[3, k]
        if split >= x1:
            continue
        if split > x0:
            y0 = y0 + (y1 - y0) * (split - x0) / (x1 - x0)
            x0 = split
        area += 0.5 * (x1 - x0) * (y0 + y1)
        moment += (x1 - x0) * (x0 * (2.0 * y0 + y1) + x1 * (y0 + 2.0 * y1)) / 6.0
    return area, moment


@compiled
def _bisector(polyline: Float[Array, "4 pieces"]) -> float:
    """Return the point with half of the area on either side."""
    missing = 0.5 * _moments_left_of(polyline, np.inf)[0]
    for k in range(polyline.shape[1]):
        width, y0, y1 = polyline[1, k] - polyline[0, k], polyline[2, k], polyline[3, k]
        area = 0.5 * width * (y0 + y1)
        if area >= missing and area > 0.0:
            # y0 z + (y1 - y0) z^2/(2 width) = missing, by the root that is stable near y1 = y0
            root = sqrt(max(0.0, y0 * y0 + 2.0 * (y1 - y0) * missing / width))
            return float(polyline[0, k] + 2.0 * missing / (y0 + root))
        missing -= area
    return float(polyline[1, -1])


@compiled
def _exact_maximum(defuzzifier: int, polyline: Float[Array, "4 pieces"]) -> float:
    """Return the point of greatest degree that the defuzzifier selects, or the mean of all.

    Candidates on a piece of constant degree are its ends and, as the smallest in size, x = 0.
    """
    top = polyline[2, 0]
    for k in range(polyline.shape[1]):
        top = max(top, polyline[2, k], polyline[3, k])
    top *= 1.0 - 1e-12
    length, moment = 0.0, 0.0
    points = np.empty(3 * polyline.shape[1])
    count = 0
    for k in range(polyline.shape[1]):
        x0, x1 = polyline[0, k], polyline[1, k]
        at_left, at_right = polyline[2, k] >= top, polyline[3, k] >= top
        if at_left and at_right:
            length += x1 - x0
            moment += 0.5 * (x1 - x0) * (x0 + x1)
        for inside, x in (
            (at_left, x0),
            (at_left and at_right and x0 < 0.0 < x1, 0.0),
            (at_right, x1),
        ):
            if inside and (count == 0 or x > points[count - 1]):
                points[count] = x
                count += 1
    if defuzzifier == MOM and length > 0.0:
        return float(moment / length)
    return select_maximum(defuzzifier, points[:count])


@compiled
def centroid_interval(
    algorithm: int, lower: Float[Array, "4 pieces"], upper: Float[Array, "4 pieces"]
) -> tuple[float, float]:
    """Return the least and the greatest centroid of all functions between two polylines.

    The fixed point of Karnik and Mendel for functions of a continuous variable, for which their
    iteration is Newton's method (Liu & Mendel 2011, "Connect Karnik-Mendel algorithms to
    root-finding"). All algorithms of type reduction have this result, as they differ only in their
    search on samples, except Nie-Tan: the centroid of the mean of both functions.

    Args:
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        lower: Lower polyline; may have no pieces.
        upper: Upper polyline, with a positive area.
    """
    low_area, low_moment = _moments_left_of(lower, np.inf)
    area, moment = _moments_left_of(upper, np.inf)
    middle = _clamp_to_support(
        upper, (moment + low_moment) / (area + low_area) if area > 0.0 else np.nan
    )
    if algorithm == NIE_TAN:
        return middle, middle
    if low_area <= 0.0:
        return float(upper[0, 0]), float(upper[1, -1])  # of narrow functions at both ends
    minimum = greatest = middle
    for step in range(200):
        (u, um), (w, wm) = _moments_left_of(upper, minimum), _moments_right_of(lower, minimum)
        next_mean = (um + wm) / (u + w)
        if step > 0 and next_mean >= minimum:
            break
        minimum = next_mean
    for step in range(200):
        (u, um), (w, wm) = _moments_right_of(upper, greatest), _moments_left_of(lower, greatest)
        next_mean = (um + wm) / (u + w)
        if step > 0 and next_mean <= greatest:
            break
        greatest = next_mean
    return _clamp_to_support(upper, minimum), _clamp_to_support(upper, greatest)
