"""A sensor that measures the pose: cameras above, beacons, or a scan matched with the map."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, inf, pi, sin, sqrt
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose, move, twist_between
from omnidrive.parameter import Bounds
from omnidrive.simulation.sensing.readings import Fix
from omnidrive.simulation.sensing.wander import wander

_TIME_SLACK = 1e-9
"""In s: samples count their time otherwise than fixes do."""


@dataclass(frozen=True, slots=True)
class PoseFixSettings:
    """How a measured pose differs from the true one, and when it arrives.

    With the law `white`, noise of constant standard deviations and a wandering bias are added; with
    `paper`, the noise of :class:`~omnidrive.simulation.PaperNoise`. A sensor tells with each fix
    the standard deviation of its noise, as positioning systems do, but of the bias only how large
    it usually is and how fast it changes: what a log of a robot at rest shows.
    """

    law: Literal["white", "paper"] = "white"
    rate: Annotated[float, Bounds(0.01, 1000.0, "Hz")] = 10.0
    """At which fixes are taken; the first at t = 0."""
    position_sigma: Annotated[float, Bounds(0.0, 100.0, "m")] = 0.02
    """Standard deviation of x and of y, by the law `white`."""
    yaw_sigma: Annotated[float, Bounds(0.0, 3.0, "rad")] = 0.01
    """The same of the yaw."""
    position_bias: Annotated[float, Bounds(0.0, 100.0, "m")] = 0.0
    """Standard deviation of the bias of x and of y after long, by the law `white`; 0 at first."""
    yaw_bias: Annotated[float, Bounds(0.0, 3.0, "rad")] = 0.0
    """The same of the yaw."""
    bias_time: Annotated[float, Bounds(0.1, 1e6, "s")] = 5.0
    """Size of the bias over its rate of change."""
    bias_damping: Annotated[float, Bounds(0.0, 0.999, "1")] = 0.9
    """Near 1, the bias wanders; near 0, it goes to and fro with a period of 2 pi bias_time."""
    latency: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.0
    """From taking a fix until it arrives, at least."""
    jitter: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.0
    """And at most so much more, evenly spread; fixes may overtake each other."""
    dropout: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.0
    """Probability that a fix is lost."""
    outliers: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.0
    """Probability that a fix is far off."""
    outlier_size: Annotated[float, Bounds(0.0, 1000.0, "m")] = 1.0
    """How far, in a random direction."""

    @property
    def bias_sigma(self) -> Float[Array, " 3"]:
        """How large the bias usually is, in m, m, rad.

        The paper's is ``sin(t / 5) / 12``: its amplitude, for a run begins where it is zero and
        changes fastest.
        """
        if self.law == "paper":
            return np.full(3, 1.0 / 12.0)
        return np.array([self.position_bias, self.position_bias, self.yaw_bias])

    @property
    def wandering(self) -> tuple[float, float]:
        """Time in s and damping with which the bias goes on; see :func:`.wander.wander`.

        The paper's is ``sin(t / 5)``, which goes on so for ever.
        """
        return (5.0, 0.0) if self.law == "paper" else (self.bias_time, self.bias_damping)


@dataclass(slots=True)
class PoseFixes:
    """Takes fixes and hands them over as they arrive.

    Attributes:
        settings: How good they are, and how late.
        rng: What the noise is drawn from: for the law `paper` the same three numbers per fix as
            ``PaperNoise`` draws, so that a run with fixes at every sample sees the same noise.
        chance: What loss, outliers, delay and the wandering of the bias are drawn from.
    """

    settings: PoseFixSettings
    rng: np.random.Generator
    chance: np.random.Generator
    _count: int = field(default=0, init=False, repr=False)
    _before: tuple[float, Pose] = field(default=(0.0, Pose(0.0, 0.0, 0.0)), init=False, repr=False)
    _bias: Float[Array, "2 3"] = field(init=False, repr=False)
    """And its rate of change."""
    _waiting: list[tuple[float, Fix]] = field(default_factory=list, init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset(Pose(0.0, 0.0, 0.0))

    def reset(self, pose: Pose) -> None:
        """Begin at ``pose`` without a bias, which may change at once; random numbers go on."""
        self._count, self._before, self._waiting = 0, (-inf, pose), []
        sigma = self.settings.bias_sigma / self.settings.wandering[0]
        self._bias = np.array([np.zeros(3), sigma * self.chance.standard_normal(3)])

    def read(self, t: float, pose: Pose, *, silent: bool = False) -> tuple[Fix, ...]:
        """Fixes that arrive up to ``t`` (s), when the robot moved evenly from reading to reading.

        Args:
            t: Of the reading.
            pose: The true one.
            silent: Whether those taken since the last reading are lost.
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
            lost, far, bearing, late = self.chance.random(4).tolist()
            if far < settings.outliers:
                fix = _displaced(fix, settings.outlier_size, 2.0 * pi * bearing)
            if lost >= settings.dropout and not silent:
                self._waiting.append((stamp + settings.latency + settings.jitter * late, fix))
        self._before = t, pose
        arrived = [fix for due, fix in sorted(self._waiting) if due <= t + _TIME_SLACK]
        self._waiting = [item for item in self._waiting if item[0] > t + _TIME_SLACK]
        return tuple(arrived)

    def _take(self, stamp: float, pose: Pose) -> Fix:
        settings = self.settings
        if settings.law == "paper":
            size = sin(stamp / 5.0) / 6.0
            offset = self.rng.random(3) * size
            sigma = abs(size) / sqrt(12.0)  # of numbers spread evenly over an interval of 1
            sigmas = (sigma, sigma)
        else:
            sigmas = (settings.position_sigma, settings.yaw_sigma)
            scale = np.array([sigmas[0], sigmas[0], sigmas[1]])
            offset = self._bias[0] + scale * self.rng.standard_normal(3)
            self._wander(1.0 / settings.rate)
        measured = Pose(*(a + b for a, b in zip(pose, offset.tolist(), strict=True)))
        return Fix(stamp, measured, *sigmas)

    def _wander(self, dt: float) -> None:
        """Let the bias go on."""
        (time, damping), sigma = self.settings.wandering, self.settings.bias_sigma
        step = np.array(wander(dt, time, damping)).reshape(2, 2)
        settled = np.diag([1.0, time**-2])
        spread = settled - step @ settled @ step.T
        root = np.linalg.cholesky(spread) if damping > 0.0 else np.zeros((2, 2))
        self._bias = step @ self._bias + sigma * (root @ self.chance.standard_normal((2, 3)))


def _displaced(fix: Fix, size: float, bearing: float) -> Fix:
    x, y, yaw = fix.pose
    return fix._replace(pose=Pose(x + size * cos(bearing), y + size * sin(bearing), yaw))
