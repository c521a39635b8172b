"""Geometric paths: sequences of poses and splines, without time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.curvature import max_curvature_rate
from omnidrive.planning.path_clearance import clearance_bounds
from omnidrive.planning.pieces import pieces
from omnidrive.planning.spline_bounds import STANDSTILL, curvature_bounds, length_bounds


@dataclass(frozen=True, eq=False, slots=True)
class Path:
    """Sequence of poses.

    Attributes:
        poses: Poses of B in W; x and y in m, yaw in rad, unwrapped.
    """

    poses: Float[Array, "points 3"]

    @property
    def length(self) -> float:
        """Length of the polyline through the positions, in m."""
        return float(np.linalg.norm(np.diff(self.poses[:, :2], axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class SplinePath:
    """Clamped uniform cubic B-spline in (x, y, yaw): twice continuously differentiable.

    It starts at the first control point and ends at the last, and every piece lies in the convex
    hull of four consecutive control points (de Boor, "A Practical Guide to Splines", ch. IX).

    If the control points are the centres of at least six cells of a grid path without corner
    cutting, the spline keeps a distance of 0.409 times the side of a cell from every occupied cell
    (0.353 for five cells, 0.285 for four). If the grid path cuts corners, the spline may enter an
    occupied cell. The tests check every sequence of moves that can shape a piece.

    Where control points coincide, the first derivative may vanish, and only there can the path turn
    on the spot: three coincident control points make a sharp corner.

    Attributes:
        control_points: x and y in m, yaw in rad, unwrapped; at least four.
    """

    control_points: Float[Array, "points 3"]

    def __post_init__(self) -> None:
        if len(self.control_points) < 4:
            raise InvalidInput(
                f"a cubic spline needs at least 4 control points, got {len(self.control_points)}"
            )
        if not np.isfinite(self.control_points).all():
            raise InvalidInput("the control points of a spline must be finite")

    @cached_property
    def _derivatives(self) -> tuple[BSpline, BSpline, BSpline]:
        n = len(self.control_points)
        knots = np.concatenate([[0.0] * 3, np.arange(n - 2), [n - 3.0] * 3]) / (n - 3)
        spline = BSpline(knots, self.control_points, 3)
        first = spline.derivative()
        return spline, first, first.derivative()

    def poses(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n 3"]:
        """Evaluate the poses at ``u`` in [0, 1]; x and y in m, yaw in rad."""
        poses: Float[Array, "*n 3"] = self._derivatives[0](u)
        return poses

    def first_derivatives(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n 3"]:
        """Evaluate the derivatives of :meth:`poses` with respect to ``u``, in m and rad."""
        first_derivatives: Float[Array, "*n 3"] = self._derivatives[1](u)
        return first_derivatives

    def curvature(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Evaluate the curvature in 1/m at ``u`` in [0, 1], positive where the path turns left.

        Infinite where the path comes to rest (the norm of the derivative is below 1e-9 of its
        maximum), because the path may turn on the spot there; 0 everywhere on a path of zero
        length.
        """
        first, second = self._derivatives[1](u)[..., :2], self._derivatives[2](u)[..., :2]
        cube = (first**2).sum(axis=-1) ** 1.5
        cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
        steps = np.linalg.norm(np.diff(self.control_points[:, :2], axis=0), axis=1)
        moves = cube > (STANDSTILL * 3.0 * (len(steps) - 2) * steps.max()) ** 3
        at_rest = np.inf if steps.any() else 0.0
        curvature: Float[Array, "*n"] = np.where(moves, cross / np.where(moves, cube, 1.0), at_rest)
        return curvature

    @cached_property
    def max_curvature(self) -> tuple[float, float]:
        """Lower and upper bound on the greatest magnitude of :meth:`curvature`, in 1/m.

        The lower bound is attained. The upper bound is proved; it exceeds the lower one by at most
        0.1 %, or by the curvature of a turn of 0.001 rad over the whole path.
        """
        return curvature_bounds(pieces(self.control_points[:, :2]), 1e-3)

    @cached_property
    def max_curvature_rate(self) -> float:
        """Greatest magnitude of the derivative of :meth:`curvature` with the arc length, 1/m^2."""
        return max_curvature_rate(pieces(self.control_points[:, :2]))

    def clearance(self, grid: OccupancyGrid, tolerance: float = 1e-3) -> tuple[float, float]:
        """Return proved bounds on the least distance in m from the path to an occupied cell.

        The bounds differ by twice ``tolerance`` times the side of a cell. They are negative (minus
        the depth, as for :meth:`OccupancyGrid.clearance`) if the path enters an occupied cell, and
        infinite on a grid without occupied cells.

        Args:
            grid: The occupancy grid.
            tolerance: Tolerance in cells, positive.

        Raises:
            InvalidInput: The tolerance is not positive or not finite.
        """
        return clearance_bounds(grid, self.control_points[:, :2], tolerance)

    @cached_property
    def length(self) -> float:
        """Arc length of the path of the origin of B, in m, within :attr:`length_bounds`.

        Computed by Simpson's rule on every knot interval.
        """
        parts = 16 * (len(self.control_points) - 3)
        speed = np.linalg.norm(
            self.first_derivatives(np.linspace(0.0, 1.0, 2 * parts + 1))[:, :2], axis=1
        )
        length = float((speed[:-1:2] + 4.0 * speed[1::2] + speed[2::2]).sum() / (6.0 * parts))
        shortest, longest = self.length_bounds
        return min(max(length, shortest), longest)

    @cached_property
    def length_bounds(self) -> tuple[float, float]:
        """Proved bounds on :attr:`length`, in m; their difference is at most 1e-6 of the length."""
        return length_bounds(pieces(self.control_points[:, :2]), 1e-6)
