"""Time parameterization of a path with limits of the jerk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, log

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.reference.timing.jerk_limits import SHARES, JerkProblem, SpeedSpline
from omnidrive.reference.timing.limits import LimitRows, limit_terms
from omnidrive.reference.timing.piecewise_path import (
    PathDerivatives,
    PiecewisePath,
    body_derivatives,
)
from omnidrive.reference.timing.smooth_reference import SmoothReference, jerk_terms
from omnidrive.reference.timing.time_parameterization import (
    ZONE_SHARES,
    time_optimal_reference,
    zone_rows,
)
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.reference.timing.zone_speeds import ZoneSpeeds

_FIRST_NODES = 400
"""Intervals of the path, at least; each piece has at least two."""
_GROWTH = 1.1
"""Largest ratio of neighbouring intervals near an end from rest."""
_SMALLEST = 1e-5
"""Shortest first interval from rest, as a share of the others."""
_TRIES, _EXCESS = 3, 1e-3
"""Largest number of times that limits are tightened, and tolerated relative violation."""
_REST_SHARES = np.array([0.25, 0.5, 0.75, 1.0])
"""Points of the first and the last interval from rest at which limits hold."""


def fastest_reference(
    path: PiecewisePath,
    limits: tuple[LimitRows, ...],
    jerks: tuple[LimitRows, ...] = (),
    end_speeds: tuple[float, float] = (0.0, 0.0),
    zone_speeds: ZoneSpeeds | None = None,
) -> TimedReference | SmoothReference:
    """Return the fastest motion along ``path`` within limits, see :func:`time_optimal_reference`.

    Args:
        path: Path; with limits of the jerk its second derivative has to be continuous.
        limits: Limits of speeds and accelerations.
        jerks: Limits of the jerk. Limits that are violated between the collocation points are
            tightened; a remaining violation is removed by slowing the whole motion. The problem is
            not convex: the motion is a local optimum.
        end_speeds: Largest ds/dt at the start and at the end, 1/s; 0: rest, with limits of the jerk
            also without acceleration. The path parameter s counts pieces.
        zone_speeds: Largest speed of the origin of B at points in W; None: no zones.

    Raises:
        InvalidInput: The yaw jerk is limited on a path whose heading is tangent to it.
        InvalidReference: The limits differ by too many orders of magnitude.
    """
    if not jerks:
        return time_optimal_reference(path, limits, end_speeds, zone_speeds)
    if path.tangent and any(group.name == "yaw jerk" for group in jerks):
        raise InvalidInput(
            "the yaw acceleration of heading 'tangent' jumps where the curvature of the path has a "
            "corner, so that its yaw jerk cannot be limited: choose another heading"
        )
    grid = _Grid.of(path, limits, jerks, end_speeds)
    factors, found = np.ones(len(grid.piece)), None
    for attempt in range(_TRIES + 1):
        found = grid.fastest(factors, zone_speeds, found)
        reference = grid.reference(found)
        usage = reference.scaled_usage
        if usage.max() <= 1.0 + _EXCESS or attempt == _TRIES:
            break
        factors *= np.maximum(usage, 1.0)
    return reference.within_limits()


@dataclass(frozen=True, eq=False)
class _Grid:
    """Intervals of a path, finer near ends from rest.

    Attributes:
        path: The path.
        limits: Limits of speeds and accelerations.
        jerks: Limits of the jerk.
        nodes: Values of s between the intervals.
        piece: Piece of the path of each interval.
        rest: Whether the motion starts, and ends, at rest.
        tops: Bounds of x at the start and at the end, 1/s^2, where these are not at rest.
    """

    path: PiecewisePath
    limits: tuple[LimitRows, ...]
    jerks: tuple[LimitRows, ...]
    nodes: Float[Array, " nodes"]
    piece: Int[Array, " intervals"]
    rest: tuple[bool, bool]
    tops: tuple[float, float]

    @classmethod
    def of(
        cls,
        path: PiecewisePath,
        limits: tuple[LimitRows, ...],
        jerks: tuple[LimitRows, ...],
        end_speeds: tuple[float, float],
    ) -> _Grid:
        """Divide the path; where its first derivative is zero at an end, every ds/dt is rest."""
        pieces = len(path.pieces)
        per_piece = max(2, ceil(_FIRST_NODES / pieces))
        ends = path.at(np.array([0, pieces - 1]), np.array([0.0, 1.0]))
        size = np.abs(path.pieces[:, 1:]).sum(axis=(1, 2)).max()
        still = np.abs(ends.first_derivatives).max(axis=1) <= 1e-9 * size
        rest = tuple(bool(v == 0.0 and not s) for v, s in zip(end_speeds, still, strict=True))
        lengths = _rest_lengths(ends, limits, jerks)
        nodes = np.arange(pieces * per_piece + 1) / per_piece
        if rest[0]:
            nodes = _graded(nodes, per_piece, lengths[0])
        if rest[1]:
            nodes = pieces - _graded(pieces - nodes[::-1], per_piece, lengths[1])[::-1]
        piece = np.floor(0.5 * (nodes[:-1] + nodes[1:])).astype(int)
        tops = tuple(np.inf if s else float(v) ** 2 for v, s in zip(end_speeds, still, strict=True))
        return cls(path, limits, jerks, nodes, piece, (rest[0], rest[1]), (tops[0], tops[1]))

    @property
    def inner(self) -> slice:
        """Intervals on which x is a quadratic spline: all but the first and last from rest."""
        return slice(int(self.rest[0]), len(self.piece) - int(self.rest[1]))

    @cached_property
    def spline(self) -> SpeedSpline:
        """Spline of x on the inner intervals."""
        widths = np.diff(self.nodes)
        return SpeedSpline.of(
            widths[self.inner],
            (float(widths[0]) * self.rest[0], float(widths[-1]) * self.rest[1]),
        )

    def fastest(
        self,
        factors: Float[Array, " intervals"],
        zone_speeds: ZoneSpeeds | None,
        similar: Float[Array, " coefficients"] | None,
    ) -> Float[Array, " coefficients"]:
        """Return the coefficients of x of the fastest motion.

        Args:
            factors: Divisors of the limits of x on each interval.
            zone_speeds: Largest speed of the origin of B at points in W; None: no zones.
            similar: Coefficients with other factors; None: none are known.
        """
        rows, jerks = self._inner_rows(factors)
        at = np.stack([self.spline.values(share)[0] for share in SHARES], axis=1)
        if zone_speeds is not None:
            start, width = self.nodes[:-1, None] - self.piece[:, None], np.diff(self.nodes)[:, None]
            r = start + width * ZONE_SHARES
            zones = zone_rows(self.path, zone_speeds, self.piece, r) * factors[:, None]
            rows = np.concatenate([rows, zones[self.inner, :, None] * at], axis=1)
        bounds = np.zeros((len(rows), 1, 3))
        bounds[0, 0], bounds[-1, 0] = self._end_rows(factors)
        problem = JerkProblem(self.spline, np.concatenate([rows, bounds], axis=1), jerks, at)
        guess = self._shape() if similar is None else similar
        return problem.solve(guess, optimal=similar is not None)

    def _at(self, share: float) -> tuple[tuple[Array, Array, Array], PathDerivatives]:
        r = np.diff(self.nodes) * share + self.nodes[:-1] - self.piece
        motion = self.path.at(self.piece, r)
        return body_derivatives(motion), motion

    def _inner_rows(
        self, factors: Float[Array, " intervals"]
    ) -> tuple[Float[Array, "n rows 3"], tuple[Float[Array, "n 3 entries 3"], ...]]:
        """Return the limits of speed and acceleration, and those of the jerk."""
        inner, spline, rows = self.inner, self.spline, []
        for share in SHARES:
            along, across = (part[inner] for part in limit_terms(self._at(share)[0], self.limits))
            x, u = spline.values(share)
            row = along[..., None] * u[:, None] + across[..., None] * x[:, None]
            rows.append(row * factors[inner, None, None])
        slopes, points = spline.slopes(), []
        for share in SHARES:
            x, u = spline.values(share)
            terms = jerk_terms(self._at(share)[1], self.path.third_derivatives(self.piece))
            third, second, first = (part[inner, :, None] for part in terms)
            points.append(third * x[:, None] + second * u[:, None] + first * slopes[:, None])
        scale = factors[inner, None, None] ** 1.5
        jerks = [
            np.stack([np.matmul(group.rows, part) * scale for part in points], axis=1)
            for group in self.jerks
        ]  # fmt: skip
        return np.concatenate(rows, axis=1), tuple(jerks)

    def _end_rows(
        self, factors: Float[Array, " intervals"]
    ) -> tuple[Float[Array, " 3"], Float[Array, " 3"]]:
        """Return the bounds of x at the first and the last node of the spline as rows."""
        found = []
        for end, share in ((0, 0.0), (-1, 1.0)):
            bound = 0.0 if self.tops[end] in {0.0, np.inf} else 1.0 / self.tops[end]
            if self.rest[end]:
                bound = self._rest_bound(end) * float(factors[end])
            found.append(self.spline.values(share)[0][end] * bound)
        return found[0], found[1]

    def _rest_bound(self, end: int) -> float:
        """Return the reciprocal of the largest x at the end of an interval from rest.

        With constant d3s/dt3 = 2 x^1.5 / (9 h^2) from rest at d = 0 to x at d = h, the squared
        speed is x (d/h)^(4/3) and the acceleration 2/3 x/h (d/h)^(1/3).
        """
        width = float(np.diff(self.nodes)[end])
        share = _REST_SHARES if end == 0 else 1.0 - _REST_SHARES
        piece = np.full(len(share), self.piece[end])
        motion = self.path.at(piece, self.nodes[:-1][end] - piece + width * share)
        x, u = _REST_SHARES ** (4 / 3), 2.0 / 3.0 / width * _REST_SHARES ** (1 / 3)
        u *= 1.0 if end == 0 else -1.0
        along, across = limit_terms(body_derivatives(motion), self.limits)
        bound = float(np.abs(along * u[:, None] + across * x[:, None]).max())
        third, second, first = jerk_terms(motion, self.path.third_derivatives(piece))
        speed = np.sqrt(x)[:, None]
        jerk = third * speed**3 + second * speed * u[:, None] + first * 2.0 / 9.0 / width**2
        for group in self.jerks:
            bound = max(bound, float(group.shares(jerk.T).max() ** (2.0 / 3.0)))
        return bound

    def _shape(self) -> Float[Array, " coefficients"]:
        """Return coefficients of x that grow from ends at rest like (distance)^(4/3)."""
        places = np.zeros(self.spline.size)
        middles = 0.5 * (self.nodes[:-1] + self.nodes[1:])[self.inner]
        places[self.spline.index[:, 1]] = middles
        places[0], places[-1] = self.nodes[self.inner.start], self.nodes[self.inner.stop]
        total = float(self.nodes[-1])
        shape = np.ones(len(places))
        if self.rest[0]:
            shape *= (places / total) ** (4 / 3)
        if self.rest[1]:
            shape *= (1.0 - places / total) ** (4 / 3)
        return shape

    def reference(self, values: Float[Array, " coefficients"]) -> SmoothReference:
        """Return the motion with the given coefficients of x."""
        local = values[self.spline.index]
        x, u = np.zeros((2, len(self.nodes)))
        for share, nodes in ((0.0, slice(0, -1)), (1.0, slice(1, None))):
            rows = self.spline.values(share)
            inside = np.arange(self.inner.start, self.inner.stop + 1)[nodes]
            x[inside], u[inside] = ((row * local).sum(axis=1) for row in rows)
        return SmoothReference.of(self.path, (*self.limits, *self.jerks), self.nodes, x, u)


def _rest_lengths(
    ends: PathDerivatives, limits: tuple[LimitRows, ...], jerks: tuple[LimitRows, ...]
) -> Float[Array, " 2"]:
    """Return a quarter of the way from rest on which the jerk limits, at both ends, in s.

    With acceleration a and jerk j it is a^3 / (6 j^2).
    """
    first = body_derivatives(ends)
    along, _ = limit_terms(first, limits)
    shares = [group.shares(first[0].T) for group in jerks]
    inverse, acceleration = np.max(shares, axis=0), np.abs(along).max(axis=1)
    still = acceleration == 0.0
    lengths: Float[Array, " 2"] = inverse**2 / np.where(still, 1.0, 24.0 * acceleration**3)
    return lengths


def _graded(nodes: Float[Array, " n"], per_piece: int, first: float) -> Float[Array, " m"]:
    """Replace the first intervals by ones that grow from the length ``first``."""
    span = min(4.0 / per_piece, 1.0)
    first = min(max(first, _SMALLEST / per_piece), 0.25 * span)
    count = ceil(log(span / first) / log(_GROWTH))
    graded = first * (span / first) ** (np.arange(count) / count)
    return np.concatenate([[0.0], graded, nodes[nodes >= span * (1.0 - 1e-12)]])
