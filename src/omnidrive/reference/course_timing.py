"""Timing of a course at its limits, on a grid that is refined until it does not matter."""

from __future__ import annotations

from math import ceil, cos, log2, pi

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.reference.course import Course
from omnidrive.reference.fastest import fastest
from omnidrive.reference.limits import LimitRows
from omnidrive.reference.timed import TimedReference

_SHARES = (0.0, 0.5, 1.0)
"""Places on an interval at which limits hold by construction."""

_FIRST_NODES, _MAX_NODES = 400, 20_000
"""Intervals of the first grid, and of the finest; at least 4 on every piece all the same, or 2."""

_LONG = 100_000
"""Pieces beyond which 2 intervals on each have to do: for memory."""

_EXCESS, _GAIN = 1e-3, 1e-3
"""Shares by which limits may be broken before they are tightened, and time be lost to the grid."""

_TRIES = 3
"""Times that limits are tightened."""

_ANGLES = np.arange(16) * pi / 16
_POLYGON = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1) / cos(pi / 32)
"""``|_POLYGON @ a| <= 1`` is a polygon of 32 sides in the circle ``|a| <= 1``, 0.5 % smaller."""


def time_course(course: Course, limits: tuple[LimitRows, ...]) -> TimedReference:
    """Fastest motion along ``course``, on a grid so fine that it does not matter.

    The time lost to the grid shrinks with its width, so that two grids say how fine it has to be.
    Where a limit is broken between the places at which it holds by construction, as next to a
    corner, it is tightened. What is then still broken is taken off by going slower.
    """
    pieces = len(course.pieces)
    most = max(4 if pieces <= _LONG else 2, _MAX_NODES // pieces)
    per_piece = min(max(2, -(-_FIRST_NODES // pieces)), most)
    if 2 * per_piece < most:
        coarse = _on_grid(course, limits, per_piece)
        fine = _on_grid(course, limits, 2 * per_piece)
        gain = abs(coarse.duration / fine.duration - 1.0)
        per_piece = min(per_piece * 2 ** max(1, ceil(log2(2.0 * gain / _GAIN + 1e-9))), most)
    else:
        per_piece = most
    tighter = np.ones(per_piece * pieces)
    reference = _on_grid(course, limits, per_piece)
    for _ in range(_TRIES):
        demand = _demand(reference)
        if demand.max() <= 1.0 + _EXCESS:
            break
        tighter *= np.maximum(demand, 1.0)
        reference = _on_grid(course, limits, per_piece, tighter)
    demand = _demand(reference).max()
    return reference.slowed(reference.duration * demand**0.5) if demand > 1.0 else reference


def _on_grid(
    course: Course,
    limits: tuple[LimitRows, ...],
    per_piece: int,
    tighter: Float[Array, " intervals"] | None = None,
) -> TimedReference:
    """Fastest motion whose acceleration changes only at nodes, ``per_piece`` on each piece.

    In each interval, limits are divided by ``tighter``, those of speed by its root.
    """
    a, b, still = interval_rows(course, limits, per_piece)
    # where nothing moves (a control point three times over) no row bounds x; then this does
    scale = np.abs(a).max(axis=1)
    top = 1e6 * float(np.median(2.0 * len(course.pieces) / scale[scale > 0.0]))
    if tighter is not None:
        a *= tighter[:, None]
        b *= tighter[:, None]
    ends = top if still[0] else 0.0, top if still[1] else 0.0
    x = fastest(a, b, 1.0 / per_piece, top, ends)
    reference = TimedReference(course, limits, x)
    if not np.isfinite(reference.duration):
        raise InvalidReference("the limits are too far apart to time this path: change their units")
    return reference


def _demand(reference: TimedReference) -> Float[Array, " intervals"]:
    """Peak share of the squared speeds and of the accelerations allowed, in each interval."""
    usage = reference.interval_usage
    shares = [usage[g.name] ** (2.0 if g.kind == "speed" else 1.0) for g in reference.limits]
    demand: Float[Array, " intervals"] = np.max(shares, axis=0)
    return demand


def interval_rows(
    course: Course, limits: tuple[LimitRows, ...], per_piece: int
) -> tuple[Float[Array, "intervals rows"], Float[Array, "intervals rows"], tuple[bool, bool]]:
    """All limits as rows ``|a u + b x| <= 1`` at the start, middle and end of every interval.

    With x the squared speed at the interval's start, it is x + 2 u d at a distance d from there.

    Returns:
        a, b, and whether the slope is zero at the course's start and end, so that the robot rests
        there whatever ds/dt is.
    """
    count = len(course.pieces) * per_piece
    piece, part = np.divmod(np.arange(count), per_piece)
    first, second, still = [], [], []
    for share in _SHARES:
        slopes, rates, bends = course.body(course.at(piece, (part + share) / per_piece))
        reach = 2.0 * share / per_piece
        square = np.zeros(count)
        for group in limits:
            if group.kind == "speed":
                values = (slopes @ group.rows.T) ** 2
                top = values.sum(axis=1) if group.round else values.max(axis=1)
                square = np.maximum(square, top)
                continue
            rows = _POLYGON @ group.rows if group.round else group.rows
            along = slopes @ rows.T
            across = (rates if group.kind == "twist rate" else bends) @ rows.T
            first.append(along + reach * across)
            second.append(across)
        first.append(reach * square[:, None])
        second.append(square[:, None])
        still.append(np.abs(slopes).max(axis=1))
    least = 1e-9 * float(np.max(still))
    ends = (bool(still[0][0] <= least), bool(still[-1][-1] <= least))
    return np.hstack(first), np.hstack(second), ends
