"""Settings of the sensors: their data sheets, for estimators and for simulated sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import Annotated, Literal, get_args

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.parameter import Bounds, check_choice

NoiseLaw = Literal["white", "paper"]


@dataclass(frozen=True, slots=True)
class EncoderSettings:
    """Incremental wheel encoders that miss no counts."""

    counts_per_turn: Annotated[int, Bounds(4, 2**24, "counts")] = 4096
    """Counts per wheel turn with all edges counted; the default is 1024 lines at the wheel."""

    @property
    def step(self) -> float:
        """Angle per count, rad."""
        return 2.0 * pi / self.counts_per_turn


@dataclass(frozen=True, slots=True)
class GyroSettings:
    """Noise and bias of a gyro, in the terms of data sheets.

    The defaults are those of a good MEMS gyro: 0.014 deg/s/sqrt(Hz), and 0.01 deg/s of bias left
    after averaging for two seconds at rest before the start.
    """

    noise_density: Annotated[float, Bounds(0.0, 1.0, "rad/s/sqrt(Hz)")] = 2.4e-4
    """Density of the white noise; the standard deviation of the integrated angle is this times the
    square root of the time in s."""
    bias: Annotated[float, Bounds(0.0, 1.0, "rad/s")] = 2e-4
    """Standard deviation of the bias at the start of a run."""
    bias_walk: Annotated[float, Bounds(0.0, 1.0, "rad/s/sqrt(s)")] = 2e-5
    """Standard deviation of the change of the bias in one second."""


@dataclass(frozen=True, slots=True)
class PoseFixSettings:
    """Errors, rate and delay of pose fixes.

    The law `white` adds white noise and a bias, which starts at zero; the law `paper` adds the
    noise of :class:`~omnidrive.simulation.PaperNoise`. Each fix states the standard deviation of
    its white noise, as positioning systems do. Of the bias only the usual size and the rate of
    change are known, which can be read from a log of a robot at rest.
    """

    law: NoiseLaw = "white"
    """Law of the noise."""
    rate: Annotated[float, Bounds(0.01, 1000.0, "Hz")] = 10.0
    """Rate of the fixes; the first is taken at t = 0."""
    position_sigma: Annotated[float, Bounds(0.0, 100.0, "m")] = 0.02
    """Standard deviation of the white noise of x and of y, for the law `white`."""
    yaw_sigma: Annotated[float, Bounds(0.0, 3.0, "rad")] = 0.01
    """Standard deviation of the white noise of the yaw, for the law `white`."""
    position_bias: Annotated[float, Bounds(0.0, 100.0, "m")] = 0.0
    """Stationary standard deviation of the bias of x and of y, for the law `white`."""
    yaw_bias: Annotated[float, Bounds(0.0, 3.0, "rad")] = 0.0
    """Stationary standard deviation of the bias of the yaw, for the law `white`."""
    bias_time: Annotated[float, Bounds(0.1, 1e6, "s")] = 5.0
    """Standard deviation of the bias over that of its rate of change."""
    bias_damping: Annotated[float, Bounds(0.0, 0.999, "1")] = 0.9
    """Damping ratio of the bias: near 1 it changes without a period, near 0 it oscillates with the
    period 2 pi bias_time."""
    latency: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.0
    """Least delay between the stamp of a fix and its arrival."""
    jitter: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.0
    """Largest additional delay, uniformly distributed; fixes may overtake each other."""
    dropout: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.0
    """Probability that a fix is lost."""
    outliers: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.0
    """Probability that a fix is an outlier."""
    outlier_size: Annotated[float, Bounds(0.0, 1000.0, "m")] = 1.0
    """Displacement of an outlier, in a random direction."""

    def __post_init__(self) -> None:
        check_choice("law of the noise", self.law, get_args(NoiseLaw))

    @property
    def bias_sigma(self) -> Float[Array, " 3"]:
        """Standard deviation of the bias of x, y and yaw; m, m, rad.

        For the law `paper`, whose bias is ``sin(t / 5) / 12``, it is the amplitude, because a run
        starts where this sine is zero and changes fastest.
        """
        if self.law == "paper":
            return np.full(3, 1.0 / 12.0)
        return np.array([self.position_bias, self.position_bias, self.yaw_bias])

    @property
    def bias_dynamics(self) -> tuple[float, float]:
        """Time constant (s) and damping ratio of the bias; see :func:`.gauss_markov`.

        The bias of the law `paper`, ``sin(t / 5) / 12``, is undamped.
        """
        return (5.0, 0.0) if self.law == "paper" else (self.bias_time, self.bias_damping)


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """The sensors of a robot and their settings."""

    encoders: EncoderSettings = field(default_factory=EncoderSettings)
    """Wheel encoders."""
    gyro: GyroSettings | None = field(default_factory=GyroSettings)
    """None: no gyro."""
    fixes: PoseFixSettings | None = field(default_factory=PoseFixSettings)
    """None: no pose fixes."""
