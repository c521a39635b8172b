"""Fairing of a spline: low curvature without kinks, within limits if there are any.

The weighted sum of squared second and third derivatives approaches the greatest curvature and the
greatest change of curvature by reweighting: where one of them exceeds its limit, its weight grows
in proportion (iteratively reweighted least squares for the maximum norm; Lawson, "Contributions to
the Theory of Linear Least Maximum Approximation", UCLA 1961).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32

from omnidrive.arrays import Array
from omnidrive.planning.clearance import Obstacles
from omnidrive.planning.curvature import curvature_peaks, max_curvature_rate
from omnidrive.planning.pieces import Pieces, pieces
from omnidrive.planning.smoothing.initial_spline import InitialSpline
from omnidrive.planning.smoothing.relaxation import STRIDES, WIDE_STRIDES, Relaxation
from omnidrive.planning.spline_bounds import curvature_bounds

_CYCLES = 10  # over all strides; more cycles hardly lower the curvature
_THIRD_WEIGHT = 30.0
"""Weight of the squared third derivatives per control point against that of the second ones: the
curvature changes over about 5 control points."""
_ROUNDS = 60
_POWERS = (1.0, 0.5)
"""Powers of the excess by which weights grow, tried in turn."""
_GROWTH = 3.0
"""Largest factor of a weight in one round."""
_INSIDE = 0.995
"""Share of a limit that the samples must keep; the proof or finer samples use the rest."""
_LEAST, _MOST = 1e-3, 1e6
"""Smallest and largest factor of a weight in all rounds."""


class CurvatureLimits(NamedTuple):
    """Limits of the magnitude of the curvature and of its change with the arc length."""

    curvature: float = np.inf
    """1 over the unit of length."""
    rate: float = np.inf
    """1 over the square of the unit of length."""

    def scaled(self, unit: float) -> CurvatureLimits:
        """Return the limits in another unit of length, given in the present one."""
        return CurvatureLimits(self.curvature * unit, self.rate * unit**2)


NO_LIMITS = CurvatureLimits()


class FairSpline(NamedTuple):
    """Result of the fairing, in cells.

    Attributes:
        control_points: Control points; with limits that are not met, those of the least excess.
        is_complete: Whether the fairing ended before its time was over.
        is_within: Whether the limits are met.
    """

    control_points: Float[Array, "points 2"]
    is_complete: bool
    is_within: bool


def fair_spline(
    obstacles: Obstacles,
    start: InitialSpline,
    costs: Float32[Array, "rows cols"],
    limits: CurvatureLimits = NO_LIMITS,
    is_over: Callable[[], bool] | None = None,
) -> FairSpline:
    """Return a spline with the clearances of ``start`` and low curvature.

    Without costs and limits only the second derivatives count; with them the third ones, too, so
    that the curvature has no kinks.

    Args:
        obstacles: Occupied cells; all lengths are in cells.
        start: Initial spline.
        costs: Cost of each cell; empty: none.
        limits: Limits of the curvature.
        is_over: Whether the time for the smoothing is over.
    """
    if costs.size == 0 and limits == NO_LIMITS:
        relaxation = Relaxation(obstacles, start, costs, STRIDES)
        ended = relaxation.run(_CYCLES, is_over)
        return FairSpline(relaxation.control_points, ended, True)
    relaxation = Relaxation(obstacles, start, costs, WIDE_STRIDES)
    count = len(start.control_points)
    weights = np.ones(count - 2), np.full(count - 3, _THIRD_WEIGHT)
    ended = relaxation.run(_CYCLES, is_over)  # from cells, third derivatives lead to poor optima
    relaxation.set_weights(*weights)
    ended = ended and relaxation.run(_CYCLES, is_over)
    if limits == NO_LIMITS:
        return FairSpline(relaxation.control_points, ended, True)
    return _limited(relaxation, weights, limits, is_over)


def _limited(
    relaxation: Relaxation,
    weights: tuple[Float[Array, " knots"], Float[Array, " pieces"]],
    limits: CurvatureLimits,
    is_over: Callable[[], bool] | None,
) -> FairSpline:
    """Return the spline whose weights grow where limits are exceeded."""
    least, best, ended = np.inf, relaxation.control_points.copy(), True
    for power in _POWERS:
        factors = [np.ones_like(each) for each in weights]
        for _ in range(_ROUNDS):
            curve = pieces(relaxation.control_points)
            bend, change = curvature_peaks(curve)
            usage = bend / limits.curvature, change / limits.rate
            excess = float(np.max(usage))
            if excess < least:
                least, best = excess, relaxation.control_points.copy()
            if excess <= _INSIDE and is_within(curve, limits):
                return FairSpline(best, ended, True)
            if not ended:
                return FairSpline(best, False, False)
            bend = np.maximum(np.append(usage[0], 0.0), np.append(0.0, usage[0]))
            for k, used in enumerate((bend, usage[1])):
                if np.isfinite(limits[k]):
                    grown = factors[k] * np.clip(used, 1.0 / _GROWTH, _GROWTH) ** power
                    factors[k] = grown.clip(_LEAST, _MOST)
            relaxation.set_weights(*(w * f for w, f in zip(weights, factors, strict=True)))
            ended = relaxation.run(1, is_over)
    return FairSpline(best, ended, False)


def is_within(curve: Pieces, limits: CurvatureLimits) -> bool:
    """Whether the proved greatest curvature and the greatest rate are within the limits."""
    if np.isfinite(limits.curvature) and curvature_bounds(curve, 1e-3)[1] > limits.curvature:
        return False
    return not np.isfinite(limits.rate) or max_curvature_rate(curve) <= limits.rate
