"""Smooth headings of a path that are nearest to given directions along it."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded

from omnidrive.arrays import Array
from omnidrive.geometry import wrap
from omnidrive.planning import SplinePath

TURN_LENGTH = 0.4
"""Length over which the heading approaches a direction, m."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_STANDSTILL = 1e-9
"""Share of the largest speed below which a point has no direction of travel."""
_SLOWEST = 0.5
"""Share of the mean speed below which turns cost as much as at that speed."""
_LEAST_WEIGHT = 1e-3
"""Least weight of an angle to a direction; zero at half a turn would be singular."""
_ITERATIONS = 50
_CONVERGED = 1e-7
"""Largest change of a heading in the last iteration, rad."""


class Directions(NamedTuple):
    """Directions at the samples of a path."""

    yaw: Float[Array, " n"]
    """Directions, rad, modulo whole turns."""
    turns: Float[Array, " n"]
    """Their derivatives with respect to the parameter, which grows by 1 on each piece, rad."""


class PathSamples(NamedTuple):
    """Gauss points of the pieces of a path, four on each, in order."""

    path: SplinePath
    poses: Float[Array, "n 3"]
    """Poses of the path; m, m, rad."""
    first: Float[Array, "n 3"]
    """Their derivatives with respect to the parameter, which grows by 1 on each piece."""
    lengths: Float[Array, " n"]
    """Arc lengths for which the points stand, m; 0 where the path stands still."""
    stiffness: Float[Array, " n"]
    """Weights of squared derivatives of the heading with respect to the parameter, m."""
    basis: Float[Array, "n 4"]
    """Values at each point of the four basis functions of its piece."""
    slopes: Float[Array, "n 4"]
    """Their derivatives with respect to the parameter."""

    @classmethod
    def of(cls, path: SplinePath) -> PathSamples:
        """Sample a path."""
        count = len(path.control_points) - 3
        u = (np.arange(count)[:, None] + 0.5 * (1.0 + _NODES)).ravel()
        first = path.first_derivatives(u / count) / count
        speed = np.hypot(first[:, 0], first[:, 1])
        weights = np.tile(0.5 * _WEIGHTS, count)
        mean = float(weights @ speed) / count
        slowest = np.maximum(speed, _SLOWEST * mean if mean > 0.0 else 1.0)
        lengths = np.where(speed > _STANDSTILL * speed.max(), weights * speed, 0.0)
        stiffness = TURN_LENGTH**2 * weights / slowest
        return cls(path, path.poses(u / count), first, lengths, stiffness, *_basis(u, count))

    def along_travel(self) -> Directions:
        """Return the directions of travel; those of the neighbours where the path stands still."""
        moving = np.flatnonzero(self.lengths)
        travel = np.zeros(len(self.lengths))
        if len(moving):
            x, y, _ = self.first[moving].T
            travel = np.interp(np.arange(len(travel)), moving, np.unwrap(np.arctan2(y, x)))
        count = len(self.lengths) // len(_NODES)
        u = (np.arange(count)[:, None] + 0.5 * (1.0 + _NODES)).ravel() / count
        curvature = self.path.curvature(u)
        finite = np.where(np.isfinite(curvature), curvature, 0.0)
        return Directions(travel, finite * np.hypot(self.first[:, 0], self.first[:, 1]))

    def nearest(
        self,
        directions: Directions,
        start_yaw: float | None,
        goal_yaw: float | None,
        where: Bool[Array, " n"] | None = None,
    ) -> SplinePath:
        """Return the path with the headings of :func:`least_strafing`, for any directions.

        Args:
            directions: Directions to which the headings are near.
            start_yaw: Heading at the start, rad, modulo whole turns; None: free, or that of a path
                without directions.
            goal_yaw: Heading at the goal, likewise.
            where: Samples that have a direction; None: all. Elsewhere the heading turns as little
                as possible.
        """
        weights = self.lengths if where is None else np.where(where, self.lengths, 0.0)
        known = np.flatnonzero(weights)
        own = self.path.control_points[:, 2]
        if len(known):
            yaw = np.zeros(len(weights))
            yaw[known] = np.unwrap(directions.yaw[known])
            ends = _near(start_yaw, yaw[known[0]]), _near(goal_yaw, yaw[known[-1]])
        else:
            yaw = np.full(len(weights), own[0] if start_yaw is None else start_yaw)
            ends = yaw[0], _near(own[-1] if goal_yaw is None else goal_yaw, yaw[0])
        speed = np.hypot(self.first[:, 0], self.first[:, 1])
        largest = speed / TURN_LENGTH
        turns = np.where(weights > 0.0, directions.turns.clip(-largest, largest), 0.0)
        found = self._least_squares(weights, yaw, turns, ends)
        for _ in range(_ITERATIONS):
            sinc = np.maximum(np.sinc((self._values(found) - yaw) / pi), _LEAST_WEIGHT)
            before, found = found, self._least_squares(weights * sinc, yaw, turns, ends)
            if np.abs(found - before).max() < _CONVERGED:
                break
        return SplinePath(np.column_stack([self.path.control_points[:, :2], found]))

    def _values(self, yaw: Float[Array, " points"]) -> Float[Array, " n"]:
        """Return the headings at the samples from those of the control points, rad."""
        local = np.lib.stride_tricks.sliding_window_view(yaw, 4)
        values: Float[Array, " n"] = (self.basis * local.repeat(len(_NODES), axis=0)).sum(axis=1)
        return values

    def _least_squares(
        self,
        weights: Float[Array, " n"],
        directions: Float[Array, " n"],
        turns: Float[Array, " n"],
        ends: tuple[float | None, float | None],
    ) -> Float[Array, " points"]:
        """Return the headings of the control points of least squares, with given ends, rad."""
        blocks = _per_piece(weights, self.basis) + _per_piece(self.stiffness, self.slopes)
        pieces, count = len(blocks), len(blocks) + 3
        bands, right = np.zeros((4, count)), np.zeros(count)
        right_sides = (weights * directions)[:, None] * self.basis
        right_sides += (self.stiffness * turns)[:, None] * self.slopes
        right_sides = right_sides.reshape(pieces, len(_NODES), 4).sum(axis=1)
        for i in range(4):
            right[i : i + pieces] += right_sides[:, i]
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


def _near(yaw: float | None, direction: float) -> float | None:
    """Return an angle shifted by whole turns to a direction."""
    return None if yaw is None else direction + float(wrap(yaw - direction))


def _per_piece(
    weights: Float[Array, " n"], rows: Float[Array, "n 4"]
) -> Float[Array, "pieces 4 4"]:
    """Return the weighted sums of products of the rows of each piece."""
    grouped = rows.reshape(-1, len(_NODES), 4)
    weighted = (weights[:, None] * rows).reshape(grouped.shape)
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
