"""Paths: poses without times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.arc_length import length_bounds
from omnidrive.planning.curvature import STANDSTILL, curvature_bounds
from omnidrive.planning.path_clearance import clearance_bounds
from omnidrive.planning.pieces import pieces


@dataclass(frozen=True, eq=False, slots=True)
class Path:
    """Poses to pass through, in order.

    Attributes:
        poses: Poses of B in W; x and y in m, yaw in rad, unwrapped.
    """

    poses: Float[Array, "points 3"]

    @property
    def length(self) -> float:
        """Distance travelled by the origin of B, in m."""
        return float(np.linalg.norm(np.diff(self.poses[:, :2], axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class SplinePath:
    """Clamped uniform cubic B-spline in (x, y, yaw): twice continuously differentiable.

    It starts at the first control point, ends at the last, and stays within the convex hull of
    each four neighbours in between (de Boor, "A Practical Guide to Splines", ch. IX).

    With the centres of at least six cells of a way without corner cutting as control points, it
    keeps 0.409 of a cell's side from the square of every obstacle (of five cells, 0.353, and of
    four, 0.285); of a way that cuts corners, it may enter one. The tests try every sequence of
    moves that a piece can see.

    Where control points coincide the path may slow down to a standstill, and there, and only
    there, turn on the spot: three in one place make a sharp corner.

    Attributes:
        control_points: x and y in m, yaw in rad, unwrapped; at least four.
    """

    control_points: Float[Array, "points 3"]

    def __post_init__(self) -> None:
        if len(self.control_points) < 4:
            raise InvalidInput(
                f"a cubic spline needs 4 control points, got {len(self.control_points)}"
            )
        if not np.isfinite(self.control_points).all():
            raise InvalidInput("a control point is not finite")

    @cached_property
    def _derivatives(self) -> tuple[BSpline, BSpline, BSpline]:
        n = len(self.control_points)
        knots = np.concatenate([[0.0] * 3, np.arange(n - 2), [n - 3.0] * 3]) / (n - 3)
        spline = BSpline(knots, self.control_points, 3)
        slope = spline.derivative()
        return spline, slope, slope.derivative()

    def poses(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n 3"]:
        """Poses at ``u`` in [0, 1]; x and y in m, yaw in rad."""
        poses: Float[Array, "*n 3"] = self._derivatives[0](u)
        return poses

    def first_derivatives(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n 3"]:
        """Derivatives of :meth:`poses` by ``u``, in m and rad."""
        slopes: Float[Array, "*n 3"] = self._derivatives[1](u)
        return slopes

    def curvature(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Curvature in 1/m at ``u`` in [0, 1], positive where the path turns left.

        Infinite where the path stands still for a moment (its speed is below 1e-9 of its
        greatest), for it may turn on the spot there; 0 all along a path without length.
        """
        slope, bend = self._derivatives[1](u)[..., :2], self._derivatives[2](u)[..., :2]
        cube = (slope**2).sum(axis=-1) ** 1.5
        cross = slope[..., 0] * bend[..., 1] - slope[..., 1] * bend[..., 0]
        steps = np.linalg.norm(np.diff(self.control_points[:, :2], axis=0), axis=1)
        moves = cube > (STANDSTILL * 3.0 * (len(steps) - 2) * steps.max()) ** 3
        at_rest = np.inf if steps.any() else 0.0
        curvature: Float[Array, "*n"] = np.where(moves, cross / np.where(moves, cube, 1.0), at_rest)
        return curvature

    @cached_property
    def max_curvature(self) -> tuple[float, float]:
        """Bounds on the greatest magnitude of :meth:`curvature`, in 1/m.

        The first is attained. The second is proved; it is at most a thousandth larger, or belongs
        to a turn of 0.001 rad over the whole path.
        """
        return curvature_bounds(pieces(self.control_points[:, :2]), 1e-3)

    def clearance(self, grid: OccupancyGrid, tolerance: float = 1e-3) -> tuple[float, float]:
        """Bounds on the least distance in m from the path to an obstacle's square.

        Both are proved. They differ by twice ``tolerance`` times the side of a cell.
        Negative where the path enters an obstacle: minus how deep, as for
        :meth:`OccupancyGrid.clearance`; infinite on a grid without obstacles.

        Args:
            grid: The obstacles.
            tolerance: In cells, positive.
        """
        return clearance_bounds(grid, self.control_points[:, :2], tolerance)

    @cached_property
    def length(self) -> float:
        """Distance travelled by the origin of B, in m; within :attr:`length_bounds`.

        By Simpson's rule on every knot interval.
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
        """Proved bounds on :attr:`length`, in m, which differ by a millionth of it."""
        return length_bounds(pieces(self.control_points[:, :2]), 1e-6)
