"""Joined conclusions as polylines, exact, and what follows from them in closed form."""

from __future__ import annotations

from math import sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.reduction import NIE_TAN
from omnidrive.fuzzy.sampled import BISECTOR, CENTROID, MOM, of_maxima
from omnidrive.fuzzy.segments import Lines


@compiled
def polyline(
    s: Lines, output: int, cuts: bool, heights: Float[Array, " shapes"]
) -> Float[Array, "4 pieces"]:
    """The joined conclusions about one output: the greatest of the cut (or scaled) shapes.

    Over one piece, with the lines from the highest to the lowest, a line shows above the ones
    before it only if its shape is cut higher than all of theirs. So it may break only where a line
    reaches the height of its own shape, or that of the last one before it. Scaled lines break
    where the highest of them gives way to a steeper one.

    Args:
        s: Lines of the shapes.
        output: Which output.
        cuts: Whether shapes are cut; if not, they are scaled.
        heights: Strength of each shape of the output.

    Returns:
        Straight pieces, left to right: left end, right end, degree at the left, at the right.
    """
    begin, end = s.first_piece[output], s.first_piece[output + 1]
    ends, first_line, shapes, degrees = s.ends, s.first_line, s.shapes, s.degrees
    most = len(heights)
    lines = first_line[end] - first_line[begin]
    found = np.empty((4, 2 * lines))
    cap, p, q = np.empty(most), np.empty(most), np.empty(most)
    breaks = np.empty(2 * most)
    count = 0
    for piece in range(begin, end):
        shown, top = 0, 0.0
        for k in range(first_line[piece], first_line[piece + 1]):
            height = heights[shapes[k]]
            if height <= 0.0 or (cuts and height <= top):
                continue
            scale = 1.0 if cuts else height
            cap[shown] = height
            p[shown], q[shown] = scale * degrees[2 * k], scale * degrees[2 * k + 1]
            shown, top = shown + 1, height
        if shown == 0:
            continue
        number = (
            _cut_breaks(cap, p, q, shown, breaks) if cuts else _scaled_breaks(p, q, shown, breaks)
        )
        left, width = ends[2 * piece], ends[2 * piece + 1] - ends[2 * piece]
        at, before = 0.0, _highest(cap, p, q, shown, 0.0)
        for k in range(number + 1):
            to = breaks[k] if k < number else 1.0
            after = _highest(cap, p, q, shown, to)
            found[0, count], found[1, count] = left + width * at, left + width * to
            found[2, count], found[3, count] = before, after
            at, before, count = to, after, count + 1
    return found[:, :count]


@compiled
def _highest(
    cap: Float[Array, " lines"],
    p: Float[Array, " lines"],
    q: Float[Array, " lines"],
    shown: int,
    at: float,
) -> float:
    best = 0.0
    for k in range(shown):
        best = max(best, min(cap[k], p[k] + (q[k] - p[k]) * at))
    return best


@compiled
def _cut_breaks(
    cap: Float[Array, " lines"],
    p: Float[Array, " lines"],
    q: Float[Array, " lines"],
    shown: int,
    breaks: Float[Array, " breaks"],
) -> int:
    """Where each line reaches its own height or the one before, ascending; returns how many."""
    number = 0
    for k in range(shown):
        if p[k] != q[k]:
            slope = q[k] - p[k]
            number = _inserted(breaks, number, (cap[k] - p[k]) / slope)
            if k > 0:
                number = _inserted(breaks, number, (cap[k - 1] - p[k]) / slope)
    return number


@compiled
def _scaled_breaks(
    p: Float[Array, " lines"],
    q: Float[Array, " lines"],
    shown: int,
    breaks: Float[Array, " breaks"],
) -> int:
    """Where the highest of the lines gives way to a steeper one, ascending; returns how many."""
    on = 0
    for k in range(1, shown):
        if p[k] > p[on] or (p[k] == p[on] and q[k] > q[on]):
            on = k
    number, at = 0, 0.0
    while True:
        follower, nearest = -1, 1.0
        for k in range(shown):
            closing = (q[k] - p[k]) - (q[on] - p[on])
            if closing > 0.0:
                crossing = max(at, (p[on] - p[k]) / closing)
                if crossing < nearest:
                    follower, nearest = k, crossing
        if follower < 0:
            return number
        if nearest > at:
            breaks[number] = nearest
            number += 1
        on, at = follower, nearest


@compiled
def _inserted(breaks: Float[Array, " breaks"], number: int, at: float) -> int:
    """Insert a part of the width, if it lies within, in ascending order."""
    if not 0.0 < at < 1.0:
        return number
    k = number
    while k > 0 and breaks[k - 1] > at:
        breaks[k] = breaks[k - 1]
        k -= 1
    breaks[k] = at
    return number + 1


@compiled
def exact_value(defuzzifier: int, line: Float[Array, "4 pieces"]) -> float:
    """One number for a conclusion that is a polyline, in closed form."""
    if defuzzifier == CENTROID:
        area, moment = _left_part(line, np.inf)
        return _within(line, moment / area if area > 0.0 else np.nan)
    if defuzzifier == BISECTOR:
        return _bisector(line)
    return _maximum(defuzzifier, line)


@compiled
def _within(line: Float[Array, "4 pieces"], mean: float) -> float:
    """A mean, brought between the ends: denormal degrees leave too few figures of it."""
    first, last = float(line[0, 0]), float(line[1, -1])
    return min(max(mean, first), last) if np.isfinite(mean) else 0.5 * (first + last)


@compiled
def _left_part(line: Float[Array, "4 pieces"], split: float) -> tuple[float, float]:
    """Area and first moment about x = 0 of the part left of ``split``."""
    area, moment = 0.0, 0.0
    for k in range(line.shape[1]):
        x0, x1, y0, y1 = line[0, k], line[1, k], line[2, k], line[3, k]
        if split <= x0:
            break
        if split < x1:
            y1 = y0 + (y1 - y0) * (split - x0) / (x1 - x0)
            x1 = split
        area += 0.5 * (x1 - x0) * (y0 + y1)
        moment += (x1 - x0) * (x0 * (2.0 * y0 + y1) + x1 * (y0 + 2.0 * y1)) / 6.0
    return area, moment


@compiled
def _right_part(line: Float[Array, "4 pieces"], split: float) -> tuple[float, float]:
    """As :func:`_left_part`, right of ``split``: no difference of two areas that nearly agree."""
    area, moment = 0.0, 0.0
    for k in range(line.shape[1]):
        x0, x1, y0, y1 = line[0, k], line[1, k], line[2, k], line[3, k]
        if split >= x1:
            continue
        if split > x0:
            y0 = y0 + (y1 - y0) * (split - x0) / (x1 - x0)
            x0 = split
        area += 0.5 * (x1 - x0) * (y0 + y1)
        moment += (x1 - x0) * (x0 * (2.0 * y0 + y1) + x1 * (y0 + 2.0 * y1)) / 6.0
    return area, moment


@compiled
def _bisector(line: Float[Array, "4 pieces"]) -> float:
    """Where half of the area lies to the left."""
    missing = 0.5 * _left_part(line, np.inf)[0]
    for k in range(line.shape[1]):
        width, y0, y1 = line[1, k] - line[0, k], line[2, k], line[3, k]
        area = 0.5 * width * (y0 + y1)
        if area >= missing and area > 0.0:
            # y0 z + (y1 - y0) z^2/(2 width) = missing, by the root that is stable near y1 = y0
            root = sqrt(max(0.0, y0 * y0 + 2.0 * (y1 - y0) * missing / width))
            return float(line[0, k] + 2.0 * missing / (y0 + root))
        missing -= area
    return float(line[1, -1])


@compiled
def _maximum(defuzzifier: int, line: Float[Array, "4 pieces"]) -> float:
    """A point of the highest part, or its mean: of its plateaus, if there are any."""
    top = max(line[2].max(), line[3].max()) * (1.0 - 1e-12)
    length, moment = 0.0, 0.0
    points = np.empty(3 * line.shape[1])
    count = 0
    for k in range(line.shape[1]):
        x0, x1 = line[0, k], line[1, k]
        at_left, at_right = line[2, k] >= top, line[3, k] >= top
        if at_left and at_right:
            length += x1 - x0
            moment += 0.5 * (x1 - x0) * (x0 + x1)
        for inside, x in (
            (at_left, x0),
            (at_left and at_right and x0 < 0.0 < x1, 0.0),
            (at_right, x1),
        ):
            if inside:
                points[count] = x
                count += 1
    if defuzzifier == MOM and length > 0.0:
        return float(moment / length)
    return of_maxima(defuzzifier, np.unique(points[:count]))


@compiled
def exact_interval(
    algorithm: int, lower: Float[Array, "4 pieces"], upper: Float[Array, "4 pieces"]
) -> tuple[float, float]:
    """Least and greatest centroid of all functions between two polylines.

    Karnik and Mendel's fixed point in the continuum (Liu & Mendel 2011, "Connect Karnik-Mendel
    algorithms to root-finding"), where it is Newton's method; the algorithms differ in how they
    find it on samples, but not in what they find. Nie-Tan is the centroid of the mean function.

    Args:
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        lower: Lower polyline, perhaps of no piece.
        upper: Upper polyline, with an area.
    """
    low_area, low_moment = _left_part(lower, np.inf)
    area, moment = _left_part(upper, np.inf)
    middle = _within(upper, (moment + low_moment) / (area + low_area) if area > 0.0 else np.nan)
    if algorithm == NIE_TAN:
        return middle, middle
    if low_area <= 0.0:
        return float(upper[0, 0]), float(upper[1, -1])
    least = greatest = middle
    for step in range(200):
        (u, um), (w, wm) = _left_part(upper, least), _right_part(lower, least)
        better = (um + wm) / (u + w)
        if step > 0 and better >= least:
            break
        least = better
    for step in range(200):
        (u, um), (w, wm) = _right_part(upper, greatest), _left_part(lower, greatest)
        better = (um + wm) / (u + w)
        if step > 0 and better <= greatest:
            break
        greatest = better
    return _within(upper, least), _within(upper, greatest)
