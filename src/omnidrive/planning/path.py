"""Paths: poses without times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from omnidrive.errors import InvalidInput

Array = np.ndarray


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
    def _derivatives(self) -> tuple[BSpline, BSpline]:
        n = len(self.control_points)
        knots = np.concatenate([[0.0] * 3, np.arange(n - 2), [n - 3.0] * 3]) / (n - 3)
        spline = BSpline(knots, self.control_points, 3)
        return spline, spline.derivative()

    def poses(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n 3"]:
        """Poses at ``u`` in [0, 1]; x and y in m, yaw in rad."""
        poses: Float[Array, "*n 3"] = self._derivatives[0](u)
        return poses

    def slopes(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n 3"]:
        """Derivatives of :meth:`poses` by ``u``, in m and rad."""
        slopes: Float[Array, "*n 3"] = self._derivatives[1](u)
        return slopes

    @cached_property
    def length(self) -> float:
        """Distance travelled by the origin of B, in m, by Simpson's rule on every knot interval."""
        pieces = 16 * (len(self.control_points) - 3)
        speed = np.linalg.norm(self.slopes(np.linspace(0.0, 1.0, 2 * pieces + 1))[:, :2], axis=1)
        return float((speed[:-1:2] + 4.0 * speed[1::2] + speed[2::2]).sum() / (6.0 * pieces))
