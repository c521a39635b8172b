"""Simulated pose fixes, as from cameras above the floor, beacons or scan matching."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, inf, pi, sin, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.estimation import PoseFix, PoseFixSettings
from omnidrive.estimation.gauss_markov import gauss_markov
from omnidrive.geometry import Pose, move, twist_between
from omnidrive.parameter import TIME_TOLERANCE


@dataclass(slots=True)
class PoseFixes:
    """Pose fixes with noise, bias, outliers, dropouts and delay.

    Attributes:
        settings: Noise, rate and delays.
        rng: Generator of the noise. The law `paper` draws the same three numbers per fix as
            ``PaperNoise``, so that fixes in every sample have the same noise.
        chance: Generator of dropouts, outliers, delays and bias changes.
    """

    settings: PoseFixSettings
    rng: np.random.Generator
    event_rng: np.random.Generator
    _count: int = field(default=0, init=False, repr=False)
    _previous: tuple[float, Pose] = field(
        default=(0.0, Pose(0.0, 0.0, 0.0)), init=False, repr=False
    )
    _bias: Float[Array, "2 3"] = field(init=False, repr=False)
    """Bias of x, y, yaw (m, m, rad) and its rate of change (per second)."""
    _in_transit: list[tuple[float, PoseFix]] = field(default_factory=list, init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset(Pose(0.0, 0.0, 0.0))

    def reset(self, pose: Pose) -> None:
        """Start at ``pose`` with zero bias and a random bias rate; the generators continue."""
        self._count, self._previous, self._in_transit = 0, (-inf, pose), []
        time, _ = self.settings.bias_dynamics
        sigma = self.settings.bias_sigma / time
        self._bias = np.array([np.zeros(3), sigma * self.event_rng.standard_normal(3)])

    def read(self, t: float, pose: Pose, *, silent: bool = False) -> tuple[PoseFix, ...]:
        """Return the fixes that arrive up to ``t``.

        The pose between two samples is interpolated on SE(2).

        Args:
            t: Time of the sample, s.
            pose: True pose of B in W.
            silent: Whether the fixes taken since the previous sample are lost.
        """
        settings = self.settings
        time, start = self._previous
        while (stamp := self._count / settings.rate) <= t + TIME_TOLERANCE:
            self._count += 1
            true_pose = pose
            if stamp < t - TIME_TOLERANCE and time > -inf:
                fraction = (stamp - time) / (t - time)
                true_pose = move(start, twist_between(start, pose, 1.0), fraction)
            fix = self._measure(min(stamp, t), true_pose)
            dropout, outlier, bearing, delay = self.event_rng.random(4).tolist()
            if outlier < settings.outliers:
                fix = _displaced(fix, settings.outlier_size, 2.0 * pi * bearing)
            if dropout >= settings.dropout and not silent:
                self._in_transit.append((stamp + settings.latency + settings.jitter * delay, fix))
        self._previous = t, pose
        arrived = [fix for due, fix in sorted(self._in_transit) if due <= t + TIME_TOLERANCE]
        self._in_transit = [(due, fix) for due, fix in self._in_transit if due > t + TIME_TOLERANCE]
        return tuple(arrived)

    def _measure(self, stamp: float, pose: Pose) -> PoseFix:
        """Return a fix of the true ``pose`` with noise and bias."""
        settings = self.settings
        if settings.law == "paper":
            size = sin(stamp / 5.0) / 6.0
            offset = self.rng.random(3) * size
            sigma = abs(size) / sqrt(12.0)  # uniform distribution of width size
            sigmas = (sigma, sigma)
        else:
            sigmas = (settings.position_sigma, settings.yaw_sigma)
            position, yaw = sigmas
            bias, _ = self._bias
            offset = bias + np.array([position, position, yaw]) * self.rng.standard_normal(3)
            self._advance_bias(1.0 / settings.rate)
        measured = Pose(*(a + b for a, b in zip(pose, offset.tolist(), strict=True)))
        return PoseFix(stamp, measured, *sigmas)

    def _advance_bias(self, dt: float) -> None:
        """Propagate the bias by ``dt`` (s)."""
        (time, damping), sigma = self.settings.bias_dynamics, self.settings.bias_sigma
        step = np.array(gauss_markov(dt, time, damping)).reshape(2, 2)
        stationary = np.diag([1.0, time**-2])
        noise = stationary - step @ stationary @ step.T
        root = _root(noise) if damping > 0.0 else np.zeros((2, 2))
        self._bias = step @ self._bias + sigma * (root @ self.event_rng.standard_normal((2, 3)))


def _root(covariance: Float[Array, "2 2"]) -> Float[Array, "2 2"]:
    """Return a matrix R with R R^T equal to a covariance, whose rounding may make it indefinite."""
    try:
        return np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:  # a bias that hardly changes in one period of the fixes
        variances, axes = np.linalg.eigh(covariance)
        root: Float[Array, "2 2"] = axes * np.sqrt(np.maximum(variances, 0.0))
        return root


def _displaced(fix: PoseFix, size: float, bearing: float) -> PoseFix:
    """Return ``fix`` displaced by ``size`` (m) in the direction ``bearing`` (rad)."""
    x, y, yaw = fix.pose
    return fix._replace(pose=Pose(x + size * cos(bearing), y + size * sin(bearing), yaw))
