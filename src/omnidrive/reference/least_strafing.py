"""Headings near the direction of travel, with smooth turns to given headings at the ends."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded

from omnidrive.arrays import Array
from omnidrive.geometry import wrap
from omnidrive.planning import SplinePath

TURN_LENGTH = 0.4
"""Length over which the heading approaches the direction of travel, m."""
_CURVATURES = (-1.0 / TURN_LENGTH, 1.0 / TURN_LENGTH)
"""Least and largest curvature that the heading follows without delay, 1/m."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_STANDSTILL = 1e-9
"""Share of the largest speed below which a point has no direction of travel."""
_SLOWEST = 0.5
"""Share of the mean speed below which turns cost as much as at that speed."""
_LEAST_WEIGHT = 1e-3
"""Least weight of an angle to the direction of travel; zero at half a turn would be singular."""
_ITERATIONS = 50
_CONVERGED = 1e-7
"""Largest change of a heading in the last iteration, rad."""


def least_strafing(
    path: SplinePath, start_yaw: float | None = None, goal_yaw: float | None = None
) -> SplinePath:
    """Return the path with headings as near to the direction of travel as smooth turns allow.

    With the arc length s, the heading a(s), the angle r(s) between it and the direction of travel,
    and the curvature c(s) of the path, at most 1 / l in magnitude, the control points of the
    heading minimise the integral over s of

        (2 sin(r / 2))^2 + l^2 (da/ds - c)^2

    with l = 0.4 m. For small angles the first term is the square of the sideways share of the
    motion, sin(r)^2; beyond a right angle it still grows, so that the robot does not drive
    backward. Where the path is not more curved, the heading comes from r0 at the start as
    r = 4 atan(exp(-s / l) tan(r0 / 4)): it turns by at most 2 / l = 5 rad/m beside the turn of the
    path. Where the path turns on the spot, or is slower in its parameter than half the mean, turns
    cost as much as at half the mean.

    The minimum is found by iteratively reweighted least squares: r^2 sin(r0) / r0 plus a constant
    is an upper bound of the first term for angles up to pi that touches it at r0, so that no
    iteration increases the integral (Hunter & Lange 2004, "A Tutorial on MM Algorithms").

    Args:
        path: Path to follow; it may reverse, or turn on the spot.
        start_yaw: Heading at the start, rad, modulo whole turns, met exactly; None: free, or that
            of a path that only turns on the spot.
        goal_yaw: Heading at the goal, likewise.
    """
    samples = _Samples.of(path)
    yaw = path.control_points[:, 2]
    if not samples.lengths.any():
        first = yaw[0] if start_yaw is None else start_yaw
        last = yaw[-1] if goal_yaw is None else goal_yaw
        ends: tuple[float | None, float | None] = (first, first + float(wrap(last - first)))
    else:
        ends = _near(start_yaw, samples.travel[0]), _near(goal_yaw, samples.travel[-1])
    found = samples.solve(np.ones_like(samples.travel), ends)
    for _ in range(_ITERATIONS):
        away = samples.values(found) - samples.travel
        weight = np.maximum(np.sinc(away / pi), _LEAST_WEIGHT)
        before, found = found, samples.solve(weight, ends)
        if np.abs(found - before).max() < _CONVERGED:
            break
    return SplinePath(np.column_stack([path.control_points[:, :2], found]))


def _near(yaw: float | None, direction: float) -> float | None:
    """Return an angle shifted by whole turns to a direction."""
    return None if yaw is None else direction + float(wrap(yaw - direction))


class _Samples(NamedTuple):
    """Gauss points of the pieces of a path, four on each, in order."""

    travel: Float[Array, " n"]
    """Directions of travel, rad, unwrapped."""
    lengths: Float[Array, " n"]
    """Arc lengths for which the points stand, m; 0 where the path stands still."""
    turns: Float[Array, " n"]
    """Derivatives of the direction of travel with respect to the parameter, rad, limited."""
    stiffness: Float[Array, " n"]
    """Weights of the squared difference of the derivative of the heading from them, m."""
    basis: Float[Array, "n 4"]
    """Values at each point of the four basis functions of its piece."""
    slopes: Float[Array, "n 4"]
    """Their derivatives with respect to the parameter, which grows by 1 on each piece."""

    @classmethod
    def of(cls, path: SplinePath) -> _Samples:
        """Sample a path."""
        count = len(path.control_points) - 3
        u = (np.arange(count)[:, None] + 0.5 * (1.0 + _NODES)).ravel()
        x, y, _ = path.first_derivatives(u / count).T / count
        speed = np.hypot(x, y)
        weights = np.tile(0.5 * _WEIGHTS, count)
        moving = speed > _STANDSTILL * speed.max()
        travel = np.zeros(len(u))
        if moving.any():
            travel = np.interp(u, u[moving], np.unwrap(np.arctan2(y, x)[moving]))
        mean = float(weights @ speed) / count
        slowest = np.maximum(speed, _SLOWEST * mean if mean > 0.0 else 1.0)
        basis, slopes = _basis(u, count)
        lengths = np.where(moving, weights * speed, 0.0)
        curvature = path.curvature(u / count)
        bent = np.where(np.isfinite(curvature), curvature, 0.0).clip(*_CURVATURES)
        stiffness = TURN_LENGTH**2 * weights / slowest
        return cls(travel, lengths, bent * speed, stiffness, basis, slopes)

    def values(self, yaw: Float[Array, " points"]) -> Float[Array, " n"]:
        """Return the headings at the samples from those of the control points, rad."""
        local = np.lib.stride_tricks.sliding_window_view(yaw, 4)
        values: Float[Array, " n"] = (self.basis * local.repeat(len(_NODES), axis=0)).sum(axis=1)
        return values

    def solve(
        self, weight: Float[Array, " n"], ends: tuple[float | None, float | None]
    ) -> Float[Array, " points"]:
        """Return the headings of the control points of least squares, with given ends, rad."""
        weight = weight * self.lengths
        blocks = self._per_piece(weight, self.basis) + self._per_piece(self.stiffness, self.slopes)
        pieces, count = len(blocks), len(blocks) + 3
        bands, right = np.zeros((4, count)), np.zeros(count)
        pulls = (weight * self.travel)[:, None] * self.basis
        pulls += (self.stiffness * self.turns)[:, None] * self.slopes
        pulls = pulls.reshape(pieces, len(_NODES), 4).sum(axis=1)
        for i in range(4):
            right[i : i + pieces] += pulls[:, i]
            for below in range(4 - i):
                bands[below, i : i + pieces] += blocks[:, i + below, i]
        first, last = 0, count
        yaw = np.empty(count)
        if ends[0] is not None:
            yaw[0], first = ends[0], 1
            right[1:4] -= bands[1:, 0] * ends[0]
        if ends[1] is not None:
            yaw[-1], last = ends[1], count - 1
            right[-4:-1] -= np.array([bands[k, -1 - k] for k in (3, 2, 1)]) * ends[1]
        yaw[first:last] = solveh_banded(bands[:, first:last], right[first:last], lower=True)
        return yaw

    @staticmethod
    def _per_piece(
        weight: Float[Array, " n"], rows: Float[Array, "n 4"]
    ) -> Float[Array, "pieces 4 4"]:
        """Return the weighted sums of products of the rows of each piece."""
        grouped = rows.reshape(-1, len(_NODES), 4)
        weighted = (weight[:, None] * rows).reshape(grouped.shape)
        products: Float[Array, "pieces 4 4"] = weighted.transpose(0, 2, 1) @ grouped
        return products


def _basis(u: Float[Array, " n"], count: int) -> tuple[Float[Array, "n 4"], Float[Array, "n 4"]]:
    """Return the basis functions of :class:`SplinePath` and their derivatives at parameters u.

    The derivative is a quadratic spline of the differences of the control points (de Boor, "A
    Practical Guide to Splines", ch. X).
    """
    knots = np.concatenate([[0.0] * 3, np.arange(count + 1), [float(count)] * 3])
    basis = BSpline.design_matrix(u, knots, 3).data.reshape(-1, 4)
    quadratic = BSpline.design_matrix(u, knots[1:-1], 2).data.reshape(-1, 3)
    spans = 3.0 / (knots[4:-1] - knots[1:-4])
    piece = np.floor(u).astype(int)
    quadratic = quadratic * spans[piece[:, None] + np.arange(3)]
    slopes = np.zeros_like(basis)
    slopes[:, 1:] += quadratic
    slopes[:, :-1] -= quadratic
    return basis, slopes
