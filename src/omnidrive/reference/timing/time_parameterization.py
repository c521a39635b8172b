"""Time-optimal parameterization of a path on an adaptive grid."""

from __future__ import annotations

from itertools import pairwise
from math import ceil, log2
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.reference.timing.limits import LimitRows, SectionLimit, limit_terms
from omnidrive.reference.timing.piecewise_path import PiecewisePath, body_derivatives
from omnidrive.reference.timing.reachability import max_squared_speeds
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.reference.timing.zone_speeds import ZoneSpeeds

_SHARES = (0.0, 0.5, 1.0)
"""Collocation points of an interval: the limits hold there by construction."""

ZONE_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Points of an interval at which its zones are determined."""

_FIRST_NODES, _MAX_NODES = 400, 20_000
"""Intervals of the first and of the finest grid. Each piece has at least 4 intervals, or 2 on a
path of more than :data:`_LONG` pieces."""

_LONG = 100_000
"""Number of pieces above which each has 2 intervals, which bounds the memory."""

_EXCESS, _GAIN = 1e-3, 1e-3
"""Tolerated relative violation of a limit, and tolerated relative loss of time to the grid."""

_TRIES = 3
"""Largest number of times that limits are tightened."""


class PathSections(NamedTuple):
    """Parts of a path with limits of their own, and stops between its ends.

    Attributes:
        limits: Limits of parts of the path, with different names.
        stops: Indices of the pieces at whose start the robot rests, increasing.
    """

    limits: tuple[SectionLimit, ...] = ()
    stops: tuple[int, ...] = ()


NO_SECTIONS = PathSections()


def time_optimal_reference(
    path: PiecewisePath,
    limits: tuple[LimitRows, ...],
    end_speeds: tuple[float, float] = (0.0, 0.0),
    zone_speeds: ZoneSpeeds | None = None,
    sections: PathSections = NO_SECTIONS,
) -> TimedReference:
    """Return the fastest motion along ``path`` within ``limits``.

    It starts and ends with ``end_speeds`` (ds/dt in 1/s; the path parameter s counts pieces), or
    less if the limits do not permit that much.

    The time lost to the grid decreases with its width, so that the durations on two grids give the
    width required. Limits that are violated between the collocation points, for example next to a
    corner, are tightened. A remaining violation is removed by slowing the whole motion.

    In each interval ``zone_speeds`` limits the speed of the origin of B to the least of its values
    there. The limits of ``sections`` hold in all intervals of their parts.
    """
    pieces = len(path.pieces)
    maximum = max(4 if pieces <= _LONG else 2, _MAX_NODES // pieces)
    per_piece = min(max(2, -(-_FIRST_NODES // pieces)), maximum)
    if 2 * per_piece < maximum:
        coarse = _on_grid(path, limits, per_piece, end_speeds, zone_speeds, sections)
        fine = _on_grid(path, limits, 2 * per_piece, end_speeds, zone_speeds, sections)
        gain = abs(coarse.duration / fine.duration - 1.0)
        per_piece = min(per_piece * 2 ** max(1, ceil(log2(2.0 * gain / _GAIN + 1e-9))), maximum)
    else:
        per_piece = maximum
    factors = np.ones(per_piece * pieces)
    reference = _on_grid(path, limits, per_piece, end_speeds, zone_speeds, sections)
    for _ in range(_TRIES):
        usage = _peak_usage(reference)
        if usage.max() <= 1.0 + _EXCESS:
            break
        factors *= np.maximum(usage, 1.0)
        reference = _on_grid(path, limits, per_piece, end_speeds, zone_speeds, sections, factors)
    usage = _peak_usage(reference).max()
    return reference.with_duration(reference.duration * usage**0.5) if usage > 1.0 else reference


def estimated_duration(
    path: PiecewisePath, limits: tuple[LimitRows, ...], zone_speeds: ZoneSpeeds | None = None
) -> float:
    """Return the duration (s) of :func:`time_optimal_reference` on a coarse grid, for rankings."""
    per_piece = max(2, -(-_FIRST_NODES // len(path.pieces)))
    return _on_grid(path, limits, per_piece, (0.0, 0.0), zone_speeds).duration


def _on_grid(  # noqa: PLR0917
    path: PiecewisePath,
    limits: tuple[LimitRows, ...],
    per_piece: int,
    end_speeds: tuple[float, float],
    zone_speeds: ZoneSpeeds | None,
    sections: PathSections = NO_SECTIONS,
    factors: Float[Array, " intervals"] | None = None,
) -> TimedReference:
    """Return the fastest motion whose path acceleration is constant on each interval.

    Args:
        path: Path to follow.
        limits: Limits of the motion.
        per_piece: Number of intervals on each piece.
        end_speeds: Largest ds/dt at the start and at the end, 1/s.
        zone_speeds: Largest speed of the origin of B at points in W; None: no zones.
        sections: Limits of parts of the path, and stops between its ends.
        factors: Divisor of the limits in each interval; speed limits are divided by its root.
    """
    a, b, still = interval_rows(path, limits, per_piece)
    for each in sections.limits:
        section_a, section_b, _ = interval_rows(path, (each.limit,), per_piece)
        inside = each.intervals(len(a), 1.0 / per_piece)[:, None]
        a, b = np.hstack([a, section_a * inside]), np.hstack([b, section_b * inside])
    if zone_speeds is not None:
        piece, part = np.divmod(np.arange(len(a)), per_piece)
        zone = zone_rows(path, zone_speeds, piece, (part[:, None] + ZONE_SHARES) / per_piece)
        a = np.hstack([a, zone * (2.0 * np.array(_SHARES) / per_piece)])
        b = np.hstack([b, zone])
    # where nothing moves (three equal control points) no row bounds x; this value does
    scale = np.abs(a).max(axis=1)
    top = 1e6 * float(np.median(2.0 * len(path.pieces) / scale[scale > 0.0]))
    if factors is not None:
        a *= factors[:, None]
        b *= factors[:, None]
    ends = [top if s else v**2 for v, s in zip(end_speeds, still, strict=True)]
    bounds = [0, *(stop * per_piece for stop in sections.stops), len(a)]
    parts = [
        max_squared_speeds(
            a[i:k],
            b[i:k],
            1.0 / per_piece,
            top,
            (ends[0] if i == 0 else 0.0, ends[1] if k == len(a) else 0.0),
        )
        for i, k in pairwise(bounds)
    ]
    x = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
    reference = TimedReference(path, limits, x, sections.limits)
    if not np.isfinite(reference.duration):
        raise InvalidReference(
            "the limits differ by too many orders of magnitude to time this path: check their units"
        )
    return reference


def zone_rows(
    path: PiecewisePath,
    zone_speeds: ZoneSpeeds,
    piece: Int[Array, " intervals"],
    r: Float[Array, "intervals 5"],
) -> Float[Array, "intervals 3"]:
    """Return the limits of the zones on the squared speed as in :func:`interval_rows`.

    Args:
        path: The path.
        zone_speeds: Largest speed of the origin of B.
        piece: Piece of the path of each interval.
        r: Start, quarters and end of each interval, as parameters of its piece.
    """
    at = [path.at(piece, column) for column in r.T]
    least = np.min([zone_speeds(points.poses[:, :2]) for points in at], axis=0)
    squares = [(p.first_derivatives[:, :2] ** 2).sum(axis=1) for p in at[:: len(at) // 2]]
    across: Float[Array, "intervals 3"] = np.stack(squares, axis=1) / least[:, None] ** 2
    return across


def _peak_usage(reference: TimedReference) -> Float[Array, " intervals"]:
    """Return the peak share of the squared speed and acceleration limits in each interval."""
    usage = reference.interval_usage
    groups = [*reference.limits, *(each.limit for each in reference.section_limits)]
    shares = [usage[g.name] ** (2.0 if g.kind == "speed" else 1.0) for g in groups]
    peak: Float[Array, " intervals"] = np.max(shares, axis=0)
    return peak


def interval_rows(
    path: PiecewisePath, limits: tuple[LimitRows, ...], per_piece: int
) -> tuple[Float[Array, "intervals rows"], Float[Array, "intervals rows"], tuple[bool, bool]]:
    """Return all limits as rows ``|a u + b x| <= 1`` at start, middle and end of each interval.

    x is the squared path speed at the start of the interval, u the path acceleration; the squared
    speed at a distance d from the start is x + 2 u d.

    Returns:
        a, b, and whether the first derivative is zero at the start and at the end of the path, so
        that the robot is at rest there for every ds/dt.
    """
    count = len(path.pieces) * per_piece
    piece, part = np.divmod(np.arange(count), per_piece)
    a, b, size = [], [], []
    for share in _SHARES:
        first, change, second = body_derivatives(path.at(piece, (part + share) / per_piece))
        distance = 2.0 * share / per_piece
        along, across = limit_terms((first, change, second), limits)
        a.append(along + distance * across)
        b.append(across)
        size.append(np.abs(first).max(axis=1))
    minimum = 1e-9 * float(np.max(size))
    ends = (bool(size[0][0] <= minimum), bool(size[-1][-1] <= minimum))
    return np.hstack(a), np.hstack(b), ends
