"""Velocity feedforward with proportional feedback in x, y and heading."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow
from omnidrive.control.law_controller import LawController
from omnidrive.geometry import Pose
from omnidrive.geometry.kernels import twist_between, wrap
from omnidrive.parameter import Bounds, check_bounds, check_sample_time


class FeedforwardGains(NamedTuple):
    """Decay rates of the position and heading errors."""

    position: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of the position error, 1/s."""
    heading: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of the heading error, 1/s."""


class FeedforwardData(NamedTuple):
    """Parameters of the law; the fields are those of :class:`FeedforwardController`."""

    gains: FeedforwardGains
    dt: float


@compiled
def feedforward_law(  # noqa: PLR0917
    data: FeedforwardData,
    memory: Float[Array, " 0"],
    now: SampleState,
    setpoints: Float[Array, "2 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " 0"],
) -> int:
    """Fill in the body twist that follows the reference exactly and makes errors decay.

    The continuous law ``twist_W = ref' + K (ref - pose)`` (Siciliano et al., "Robotics", 2009,
    eq. 3.70) makes the error decay as ``e(t + dt) = exp(-K dt) e(t)``. A sampled and held command
    has the same decay if it leads to ``goal = ref(t + dt) + exp(-K dt) (pose - ref(t))`` along the
    arc of a constant body twist, so that rotation during translation causes no error.
    """
    gains, dt, (x, y, yaw) = data.gains, data.dt, now.pose
    current, following = setpoints[0], setpoints[1]
    decay, yaw_decay = exp(-gains.position * dt), exp(-gains.heading * dt)
    goal = Pose(
        following[0] + decay * (x - current[0]),
        following[1] + decay * (y - current[1]),
        following[2] + yaw_decay * wrap(yaw - current[2]),
    )
    command[0], command[1], command[2] = twist_between(Pose(x, y, yaw), goal, dt)
    return 0


_DEFAULT_GAINS = FeedforwardGains()


@dataclass(frozen=True)
class FeedforwardController(LawController):
    """A :class:`Controller` with :func:`feedforward_law`; it has no memory and no details.

    Attributes:
        dt: Sample time in s.
        gains: Decay rates of errors, in 1/s.

    Raises:
        InvalidInput: ``dt`` is not positive, or a gain is out of its range.
    """

    dt: float
    gains: FeedforwardGains = _DEFAULT_GAINS

    def __post_init__(self) -> None:
        check_sample_time(self.dt)
        check_bounds(self.gains)

    def compiled_law(self) -> CompiledLaw:
        """Return the law with the controller's parameters."""
        data = FeedforwardData(self.gains, self.dt)
        return CompiledLaw(feedforward_law, data, np.zeros(0), SetpointWindow(0.0, 2, self.dt))
