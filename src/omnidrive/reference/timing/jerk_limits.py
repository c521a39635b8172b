"""Smallest time along a path within limits of speed, acceleration and jerk: the optimisation.

With x = (ds/dt)^2 as a function of the path parameter s, u = d2s/dt2 = x'/2 and d3s/dt3 = sqrt(x)
x''/2, so that limits of speed and acceleration are linear in x and its derivatives. The third
derivative of the pose q is

    sqrt(x) (q''' x + 3 q'' x'/2 + q' x''/2),

and a bound J of its norm reads |q''' x + 3 q'' x'/2 + q' x''/2| <= J / sqrt(x). The right-hand side
is convex: the feasible set is not, but its linearisations lie within it (Consolini, Locatelli &
Minari, "A sequential algorithm for jerk limited speed planning", IEEE Trans. Autom. Sci. Eng. 19,
2022). x is a quadratic spline with continuous derivative; its coefficients are found by a barrier
method with banded Newton steps, whose iterates stay strictly within all limits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import solveh_banded

from omnidrive.arrays import Array

SHARES = (0.0, 0.5, 1.0)
"""Points of an interval at which its limits hold."""

_GAUSS_POINTS = (0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5)
_REDUCTION, _GAP = 0.1, 1e-4
"""Factor of the barrier's weight per stage, and final weight times the number of rows, as a share
of the duration."""
_FAR, _NEAR = (0.5, 1.0), (0.95, 0.01)
"""Initial share of the largest multiple of a guess, and initial weight of the barrier times the
number of rows, as a share of the duration: for any guess, and for one that is almost optimal."""
_STEPS, _PROGRESS = 30, 1e-3
"""Largest number of Newton steps in a stage, and decrease at which a stage ends, as a share of the
barrier's weight times the number of rows."""
_RIDGE = 1e-10
"""Added to the unit diagonal of the scaled Hessian, against rounding."""


@dataclass(frozen=True, eq=False, slots=True)
class SpeedSpline:
    """Quadratic spline x(s) on given nodes as a linear function of its free coefficients.

    At an end from rest, the interval before the first node (of length ``rest``) is passed with
    constant d3s/dt3: x grows with s^(4/3), hence x' = 4 x / (3 rest) at the first node.

    Attributes:
        widths: Widths of the intervals.
        index: Free coefficients on which each interval depends.
        scale: Factors of these coefficients.
    """

    widths: Float[Array, " intervals"]
    index: Int[Array, "intervals 3"]
    scale: Float[Array, "intervals 3"]

    @classmethod
    def of(cls, widths: Float[Array, " intervals"], rest: tuple[float, float]) -> SpeedSpline:
        """Return the spline; ``rest`` are the lengths from rest at both ends, 0: not from rest."""
        count = len(widths)
        index = np.arange(count)[:, None] + np.arange(3)
        scale = np.ones((count, 3))
        if rest[0] > 0.0:
            ratio = 1.0 + 2.0 * widths[0] / (3.0 * rest[0])
            index = np.maximum(index - 1, 0)
            scale[0, 1] = scale[1, 0] = ratio
        if rest[1] > 0.0:
            ratio = 1.0 + 2.0 * widths[-1] / (3.0 * rest[1])
            index = np.minimum(index, index[-1, 2] - 1)
            scale[-1, 1] = scale[-2, 2] = ratio
        return cls(widths, index, scale)

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return int(self.index[-1, 2]) + 1

    def values(self, share: float) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
        """Return x and u = x'/2 at a share of each interval as factors of its coefficients."""
        d = self.widths
        before, after = np.append(0.0, d[:-1]), np.append(d[1:], 0.0)
        zero = np.zeros_like(d)
        left, right = before + d, d + after
        x0 = np.stack([d / left, before / left, zero], axis=1)
        u0 = np.stack([-1.0 / left, 1.0 / left, zero], axis=1)
        u1 = np.stack([zero, -1.0 / right, 1.0 / right], axis=1)
        along = share * d[:, None]
        x = x0 + along * (2.0 * u0 + share * (u1 - u0))
        return x * self.scale, (u0 + share * (u1 - u0)) * self.scale

    def slopes(self) -> Float[Array, "n 3"]:
        """Return du/ds on each interval as factors of its coefficients."""
        (_, first), (_, last) = self.values(0.0), self.values(1.0)
        slopes: Float[Array, "n 3"] = (last - first) / self.widths[:, None]
        return slopes


@dataclass(frozen=True, eq=False, slots=True)
class JerkProblem:
    """Limits of a spline x(s) as rows over the three coefficients of each interval.

    Attributes:
        spline: The spline.
        rows: Rows with ``|rows @ coefficients| <= 1``: speed and acceleration.
        jerks: For every bound of a norm: rows ``N`` with ``|N @ coefficients| <= 1 / sqrt(x)``.
        at: x at the points of ``jerks``, as rows.
    """

    spline: SpeedSpline
    rows: Float[Array, "intervals rows 3"]
    jerks: tuple[Float[Array, "intervals points entries 3"], ...]
    at: Float[Array, "intervals points 3"]

    def solve(
        self, shape: Float[Array, " coefficients"], *, optimal: bool = False
    ) -> Float[Array, " coefficients"]:
        """Return the coefficients of the fastest motion.

        Args:
            shape: Positive coefficients, of which a multiple is the initial guess.
            optimal: Whether these are the optimum of a similar problem.
        """
        share, first = _NEAR if optimal else _FAR
        found = shape * self._largest_scale(shape) * share
        count = self.rows[..., 0].size + sum(each[..., 0, 0].size for each in self.jerks)
        weight = first * self._time(found)[0] / count
        while True:
            found = self._centred(found, weight, weight * count * _PROGRESS)
            if weight * count <= _GAP * self._time(found)[0]:
                return found
            weight *= _REDUCTION

    def _local(self, values: Float[Array, " coefficients"]) -> Float[Array, "intervals 3"]:
        local: Float[Array, "intervals 3"] = values[self.spline.index]
        return local

    def _largest_scale(self, shape: Float[Array, " coefficients"]) -> float:
        """Return the multiple of ``shape`` that reaches a limit."""
        local = self._local(shape)
        usage = np.abs(_dot(self.rows, local)).max()
        x = _dot(self.at, local)
        for each in self.jerks:
            jerk = np.sqrt(x * (_dot(each, local) ** 2).sum(axis=2)).max()
            usage = max(usage, jerk ** (2.0 / 3.0))
        return 1.0 / float(usage)

    def _time(
        self, values: Float[Array, " coefficients"]
    ) -> tuple[float, Float[Array, "n 3"], Float[Array, "n 3 3"]]:
        """Return the duration without the ends from rest, its gradients and its Hessians."""
        local = self._local(values)
        total, gradient, hessian = 0.0, np.zeros_like(local), np.zeros((len(local), 3, 3))
        weight = 0.5 * self.spline.widths
        for share in _GAUSS_POINTS:
            row = self.spline.values(share)[0]
            x = (row * local).sum(axis=1)
            root = weight / np.sqrt(x)
            total += float(root.sum())
            gradient -= (0.5 * root / x)[:, None] * row
            hessian += (0.75 * root / x**2)[:, None, None] * _outer(row)
        return total, gradient, hessian

    def _merit(self, values: Float[Array, " coefficients"], weight: float) -> float:
        """Return the duration plus the barrier; infinity outside the limits."""
        local = self._local(values)
        inside = 1.0 - _dot(self.rows, local) ** 2
        x = _dot(self.at, local)
        if not (inside.min() > 0.0 and x.min() > 0.0):
            return np.inf
        barrier = np.log(inside).sum()
        for each in self.jerks:
            slack = 1.0 - x * (_dot(each, local) ** 2).sum(axis=2)
            if slack.min() <= 0.0:
                return np.inf
            barrier += np.log(slack).sum()
        return self._time(values)[0] - weight * float(barrier)

    def _centred(
        self, values: Float[Array, " coefficients"], weight: float, enough: float
    ) -> Float[Array, " coefficients"]:
        """Return the minimum of duration plus barrier, by Newton's method from ``values``."""
        merit = self._merit(values, weight)
        for _ in range(_STEPS):
            gradient, band = self._newton_terms(values, weight)
            step = -_solved(band, gradient)
            slope = float(gradient @ step)
            length = 1.0
            while True:
                trial = values + length * step
                after = self._merit(trial, weight)
                if after <= merit + 1e-4 * length * slope:
                    break
                length *= 0.5
                if length < 1e-6:
                    return values
            decrease, values, merit = merit - after, trial, after
            if decrease <= enough and length > 0.5:
                break
        return values

    def _newton_terms(
        self, values: Float[Array, " coefficients"], weight: float
    ) -> tuple[Float[Array, " coefficients"], Float[Array, "3 coefficients"]]:
        """Return the gradient and the Hessian, without the part of 1/x that is not convex."""
        local = self._local(values)
        _, gradient, hessian = self._time(values)
        usage = _dot(self.rows, local)
        inside = 1.0 - usage**2
        gradient += weight * _weighted(2.0 * usage / inside, self.rows)
        hessian += weight * _squares(2.0 * (1.0 + usage**2) / inside**2, self.rows)
        x = _dot(self.at, local)
        for each in self.jerks:
            y = _dot(each, local)
            slack = 1.0 / x - (y**2).sum(axis=2)
            change = -self.at / x[..., None] ** 2 - 2.0 * (y[..., None] * each).sum(axis=2)
            gradient -= weight * (_weighted(1.0 / slack, change) + _weighted(1.0 / x, self.at))
            hessian += weight * (_squares(1.0 / slack**2, change) + _squares(1.0 / x**2, self.at))
            for k in range(each.shape[2]):
                hessian += weight * _squares(2.0 / slack, each[:, :, k])
        return self._assembled(gradient, hessian)

    def _assembled(
        self, gradient: Float[Array, "n 3"], hessian: Float[Array, "n 3 3"]
    ) -> tuple[Float[Array, " coefficients"], Float[Array, "3 coefficients"]]:
        """Add up the intervals: the gradient, and the Hessian in upper banded form."""
        index, size = self.spline.index, self.spline.size
        total = np.bincount(index.ravel(), gradient.ravel(), minlength=size)
        rows = np.broadcast_to(index[:, :, None], hessian.shape).ravel()
        columns = np.broadcast_to(index[:, None, :], hessian.shape).ravel()
        upper = rows <= columns
        place = (2 - (columns - rows)) * size + columns
        band = np.bincount(place[upper], hessian.ravel()[upper], minlength=3 * size)
        return total, band.reshape(3, size)


def _solved(
    band: Float[Array, "3 coefficients"], right: Float[Array, " coefficients"]
) -> Float[Array, " coefficients"]:
    """Solve a positive definite system in upper banded form, scaled to a unit diagonal."""
    scale = 1.0 / np.sqrt(band[2])
    scaled = band * scale
    scaled[1, 1:] *= scale[:-1]
    scaled[0, 2:] *= scale[:-2]
    scaled[2] = 1.0 + _RIDGE
    solution: Float[Array, " coefficients"] = scale * solveh_banded(
        scaled, scale * right, check_finite=False
    )
    return solution


def _dot(rows: Float[Array, "n ... 3"], local: Float[Array, "n 3"]) -> Float[Array, "n ..."]:
    """Return the rows times the coefficients of their interval."""
    flat: Float[Array, "n m 1"] = np.matmul(rows.reshape(len(rows), -1, 3), local[:, :, None])
    return flat.reshape(rows.shape[:-1])


def _outer(row: Float[Array, "n 3"]) -> Float[Array, "n 3 3"]:
    product: Float[Array, "n 3 3"] = row[:, :, None] * row[:, None, :]
    return product


def _weighted(factors: Float[Array, "n m"], rows: Float[Array, "n m 3"]) -> Float[Array, "n 3"]:
    total: Float[Array, "n 3"] = np.einsum("nm,nmi->ni", factors, rows)
    return total


def _squares(factors: Float[Array, "n m"], rows: Float[Array, "n m 3"]) -> Float[Array, "n 3 3"]:
    total: Float[Array, "n 3 3"] = np.matmul((rows * factors[..., None]).transpose(0, 2, 1), rows)
    return total
