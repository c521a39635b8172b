"""Membership functions of consequents that are polylines, cut into straight segments."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.consequents import Consequent
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.sets import FULL_FOOTPRINT, ZSlice
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import Footprint, FuzzySet, OutputVariable

MAX_SEGMENTS = 1_000_000
"""Greatest number of segments over all outputs."""


class Segments(NamedTuple):
    """Segments of the membership functions of the consequents of every output, as flat arrays.

    The range of an output is divided at every corner of a consequent and at every crossing of two.
    Over one piece of the range, every consequent is one segment and the segments do not cross.
    """

    first_piece: Int[Array, " output_edges"]
    """First piece of each output, then the number of all pieces."""
    ends: Float[Array, " piece_ends"]
    """Left and right end of each piece."""
    first_segment: Int[Array, " piece_edges"]
    """First segment over each piece, highest first; then the number of all segments."""
    owners: Int[Array, " segments"]
    """Consequent of each segment, numbered within the output."""
    degrees: Float[Array, " segment_ends"]
    """Degree of each segment at the left and at the right end of its piece."""


def reason_not_exact(system: FuzzySystem) -> str | None:
    """Return why the aggregated outputs of a system are no polylines; None if they are."""
    for output in system.outputs:
        if output.aggregation != "max":
            return f"output {output.name!r} is aggregated by {output.aggregation}, not max"
        for each in output.sets:
            for function in (each.upper, each.lower) if isinstance(each, FuzzySet) else ():
                if isinstance(function, Membership) and not function.is_piecewise_linear:
                    return f"set {each.name!r} of {output.name!r} is a {function.shape}"
    return None


def segments_of(
    system: FuzzySystem,
    consequents: tuple[tuple[Consequent, ...], ...],
    z_slice: ZSlice = FULL_FOOTPRINT,
    *,
    of_lower: bool = False,
) -> Segments:
    """Return the segments of the upper, or of the lower, functions of the consequents.

    Raises:
        InvalidInput: There are more than :data:`MAX_SEGMENTS`.
    """
    first_piece, first_segment = [0], [0]
    ends: list[float] = []
    owners: list[int] = []
    degrees: list[float] = []
    for output, own in zip(system.outputs, consequents, strict=True):
        for piece, over in _pieces(output, own, z_slice, of_lower):
            ends += piece
            for consequent, left, right in over:
                owners.append(consequent)
                degrees += [left, right]
            first_segment.append(len(owners))
            if len(owners) > MAX_SEGMENTS:
                raise InvalidInput(
                    f"the sets of {output.name!r} have too many crossings for an exact "
                    "centroid; use --centroid matlab, in Python centroid='matlab'"
                )
        first_piece.append(len(ends) // 2)
    return Segments(
        np.array(first_piece),
        np.array(ends, dtype=np.float64),
        np.array(first_segment),
        np.array(owners, dtype=np.int64),
        np.array(degrees, dtype=np.float64),
    )


_Piece = tuple[tuple[float, float], list[tuple[int, float, float]]]


def _pieces(
    output: OutputVariable, consequents: tuple[Consequent, ...], z_slice: ZSlice, of_lower: bool
) -> list[_Piece]:
    """Return the pieces of one output's range and the segments over each, highest first.

    A segment is the number of a consequent and its degrees at the left and the right end.
    """

    def degrees_at(at: Float[Array, " points"]) -> Float[Array, "consequents points"]:
        """Return the lower or the upper degree of every consequent at each point."""
        pairs = [consequent.membership_bounds(at, z_slice) for consequent in consequents]
        return np.array([pair[0 if of_lower else 1] for pair in pairs]).reshape(-1, len(at))

    corners = _corner_points(output, consequents)
    left, right = _end_degrees(degrees_at, corners[:-1], corners[1:])
    crossings = [corners]
    for a, b, y0, y1 in zip(corners[:-1], corners[1:], left.T, right.T, strict=True):
        crossings.append(a + (b - a) * _crossings(y0, y1))
        if sum(map(len, crossings)) > MAX_SEGMENTS:
            break  # too many segments: the caller raises
    knots = np.unique(np.concatenate(crossings))
    left, right = _end_degrees(degrees_at, knots[:-1], knots[1:])
    pieces: list[_Piece] = []
    for a, b, y0, y1 in zip(knots[:-1].tolist(), knots[1:].tolist(), left.T, right.T, strict=True):
        order = np.argsort(-(y0 + y1), kind="stable")
        over = [(int(k), float(y0[k]), float(y1[k])) for k in order if y0[k] + y1[k] > 0.0]
        if over:
            pieces.append(((a, b), over))
    return pieces


def _corner_points(
    output: OutputVariable, consequents: tuple[Consequent, ...]
) -> Float[Array, " corners"]:
    """Return every point at which a consequent may have a corner, and the ends of the range."""
    corners = [output.low, output.high]
    for each in {c.definition.name: c.definition for c in consequents}.values():
        assert isinstance(each, FuzzySet)
        upper, lower = each.upper, each.lower
        corners += [x for x, _ in upper.vertices]
        if isinstance(lower, Membership):
            corners += [x for x, _ in lower.vertices]
        if isinstance(lower, Footprint):
            corners.append(upper.core_midpoint)
            for (x0, y0), (x1, y1) in zip(upper.vertices, upper.vertices[1:], strict=False):
                corners += [
                    x0 + (x1 - x0) * (lag - y0) / (y1 - y0)
                    for lag in lower.lags
                    if min(y0, y1) < lag < max(y0, y1)
                ]
    return np.unique([x for x in corners if isfinite(x) and output.low <= x <= output.high])


def _end_degrees(
    degrees_at: Callable[[Array], Array],
    left: Float[Array, " pieces"],
    right: Float[Array, " pieces"],
) -> tuple[Float[Array, "consequents pieces"], Float[Array, "consequents pieces"]]:
    """Return degrees at both ends of each piece, extrapolated from within the piece.

    A function may jump at an end, so that its value there belongs to the neighbouring piece.
    """
    near, far = degrees_at(0.75 * left + 0.25 * right), degrees_at(0.25 * left + 0.75 * right)
    slope = far - near
    return np.clip(near - 0.5 * slope, 0.0, 1.0), np.clip(far + 0.5 * slope, 0.0, 1.0)


def _crossings(
    left: Float[Array, " consequents"], right: Float[Array, " consequents"]
) -> Float[Array, " crossings"]:
    """Return where segments cross within a piece, as fractions of its width."""
    shown = (left > 0.0) | (right > 0.0)
    gap = np.subtract.outer(left[shown], left[shown])
    closing = gap - np.subtract.outer(right[shown], right[shown])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = gap / closing
    return np.unique(at[(at > 1e-12) & (at < 1.0 - 1e-12)])
