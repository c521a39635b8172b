"""Simulated pose fixes: cameras above the floor, beacons, or scan matching."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, inf, pi, sin, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.estimation import PoseFix, PoseFixSettings
from omnidrive.estimation.gauss_markov import gauss_markov
from omnidrive.geometry import Pose, move, twist_between

_TIME_SLACK = 1e-9
"""Tolerance, s, when the time of a fix is compared with the time of a sample: the two are counted
in different multiples."""


@dataclass(slots=True)
class PoseFixes:
    """Pose fixes with noise, bias, outliers, dropouts and latency.

    Attributes:
        settings: Noise, rate and delays.
        rng: Generator of the noise. The law `paper` draws the same three numbers per fix as
            ``PaperNoise``, so that fixes at every sample have the same noise.
        chance: Generator of dropouts, outliers, delays and bias changes.
    """

    settings: PoseFixSettings
    rng: np.random.Generator
    event_rng: np.random.Generator
    _count: int = field(default=0, init=False, repr=False)
    _before: tuple[float, Pose] = field(default=(0.0, Pose(0.0, 0.0, 0.0)), init=False, repr=False)
    _bias: Float[Array, "2 3"] = field(init=False, repr=False)
    """Bias of x, y, yaw (m, m, rad) and its rate of change (per second)."""
    _waiting: list[tuple[float, PoseFix]] = field(default_factory=list, init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset(Pose(0.0, 0.0, 0.0))

    def reset(self, pose: Pose) -> None:
        """Start at ``pose`` with zero bias and a random bias rate; the generators continue."""
        self._count, self._before, self._waiting = 0, (-inf, pose), []
        sigma = self.settings.bias_sigma / self.settings.bias_dynamics[0]
        self._bias = np.array([np.zeros(3), sigma * self.event_rng.standard_normal(3)])

    def read(self, t: float, pose: Pose, *, silent: bool = False) -> tuple[PoseFix, ...]:
        """Fixes that arrive up to ``t`` (s); motion between readings is interpolated on SE(2).

        Args:
            t: Time of the reading, s.
            pose: True pose.
            silent: Whether the fixes taken since the previous reading are lost.
        """
        settings = self.settings
        since, start = self._before
        while (stamp := self._count / settings.rate) <= t + _TIME_SLACK:
            self._count += 1
            there = pose
            if stamp < t - _TIME_SLACK and since > -inf:
                part = (stamp - since) / (t - since)
                there = move(start, twist_between(start, pose, 1.0), part)
            fix = self._take(min(stamp, t), there)
            lost, far, bearing, late = self.event_rng.random(4).tolist()
            if far < settings.outliers:
                fix = _displaced(fix, settings.outlier_size, 2.0 * pi * bearing)
            if lost >= settings.dropout and not silent:
                self._waiting.append((stamp + settings.latency + settings.jitter * late, fix))
        self._before = t, pose
        arrived = [fix for due, fix in sorted(self._waiting) if due <= t + _TIME_SLACK]
        self._waiting = [item for item in self._waiting if item[0] > t + _TIME_SLACK]
        return tuple(arrived)

    def _take(self, stamp: float, pose: Pose) -> PoseFix:
        settings = self.settings
        if settings.law == "paper":
            size = sin(stamp / 5.0) / 6.0
            offset = self.rng.random(3) * size
            sigma = abs(size) / sqrt(12.0)  # uniform distribution of width size
            sigmas = (sigma, sigma)
        else:
            sigmas = (settings.position_sigma, settings.yaw_sigma)
            scale = np.array([sigmas[0], sigmas[0], sigmas[1]])
            offset = self._bias[0] + scale * self.rng.standard_normal(3)
            self._advance_bias(1.0 / settings.rate)
        measured = Pose(*(a + b for a, b in zip(pose, offset.tolist(), strict=True)))
        return PoseFix(stamp, measured, *sigmas)

    def _advance_bias(self, dt: float) -> None:
        """Propagate the bias by ``dt`` (s)."""
        (time, damping), sigma = self.settings.bias_dynamics, self.settings.bias_sigma
        step = np.array(gauss_markov(dt, time, damping)).reshape(2, 2)
        settled = np.diag([1.0, time**-2])
        spread = settled - step @ settled @ step.T
        root = np.linalg.cholesky(spread) if damping > 0.0 else np.zeros((2, 2))
        self._bias = step @ self._bias + sigma * (root @ self.event_rng.standard_normal((2, 3)))


def _displaced(fix: PoseFix, size: float, bearing: float) -> PoseFix:
    x, y, yaw = fix.pose
    return fix._replace(pose=Pose(x + size * cos(bearing), y + size * sin(bearing), yaw))
