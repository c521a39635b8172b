"""Settings of the sensors: their data sheets, for estimators and for simulated sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.parameter import Bounds


@dataclass(frozen=True, slots=True)
class EncoderSettings:
    """Incremental encoders that never miss a count."""

    counts_per_turn: Annotated[int, Bounds(4, 2**24, "counts")] = 4096
    """Of the wheel, all edges counted: those of a usual encoder with 1024 lines at the wheel."""

    @property
    def step(self) -> float:
        """Angle from count to count, in rad."""
        return 2.0 * pi / self.counts_per_turn


@dataclass(frozen=True, slots=True)
class GyroSettings:
    """A gyro as data sheets describe it.

    The defaults are those of a usual part in drones and robots: 0.014 deg/s / sqrt(Hz), and a bias
    that was averaged for two seconds at rest before the start, which leaves 0.01 deg/s of it.
    """

    noise_density: Annotated[float, Bounds(0.0, 1.0, "rad/s/sqrt(Hz)")] = 2.4e-4
    """Of its white noise: the angle walks by this times the square root of seconds."""
    bias: Annotated[float, Bounds(0.0, 1.0, "rad/s")] = 2e-4
    """Standard deviation of the bias with which a run begins."""
    bias_walk: Annotated[float, Bounds(0.0, 1.0, "rad/s/sqrt(s)")] = 2e-5
    """Standard deviation of the bias's change in one second."""


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
    def bias_dynamics(self) -> tuple[float, float]:
        """Time constant (s) and damping ratio of the bias; see :func:`.gauss_markov`.

        The bias of the law `paper`, ``sin(t / 5)``, is undamped.
        """
        return (5.0, 0.0) if self.law == "paper" else (self.bias_time, self.bias_damping)


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """What sensors a robot has, and how good they are."""

    encoders: EncoderSettings = field(default_factory=EncoderSettings)
    gyro: GyroSettings | None = field(default_factory=GyroSettings)
    """None: it has none."""
    fixes: PoseFixSettings | None = field(default_factory=PoseFixSettings)
    """None: nothing measures the pose."""
