"""Velocity feedforward with proportional feedback in x, y and heading."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compilable, compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow
from omnidrive.control.controller import Command
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.geometry.kernels import twist_between, wrap
from omnidrive.parameter import Bounds, check_bounds, check_sample_time
from omnidrive.reference import Reference


class FeedforwardGains(NamedTuple):
    """Decay rates of the position and heading errors."""

    position: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of the position error, 1/s."""
    heading: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of the heading error, 1/s."""


@compilable
def feedforward_law(
    gains: FeedforwardGains, pose: Pose, current: Pose, following: Pose, dt: float
) -> BodyTwist:
    """Return the body twist that follows the reference exactly and makes errors decay.

    The continuous law ``twist_W = ref' + K (ref - pose)`` (Siciliano et al., "Robotics", 2009,
    eq. 3.70) makes the error decay as ``e(t + dt) = exp(-K dt) e(t)``. A sampled and held command
    has the same decay if it leads to ``goal = ref(t + dt) + exp(-K dt) (pose - ref(t))`` along the
    arc of a constant body twist, so that rotation during translation causes no error.

    Args:
        gains: K, in 1/s.
        pose: Pose of the robot at t.
        current: Reference pose at t.
        following: Reference pose at t + dt.
        dt: Sample time in s.
    """
    decay, yaw_decay = exp(-gains.position * dt), exp(-gains.heading * dt)
    goal = Pose(
        following.x + decay * (pose.x - current.x),
        following.y + decay * (pose.y - current.y),
        following.yaw + yaw_decay * wrap(pose.yaw - current.yaw),
    )
    return twist_between(pose, goal, dt)


_DEFAULT_GAINS = FeedforwardGains()


@dataclass(frozen=True, slots=True)
class FeedforwardController(GuardedController):
    """A :class:`Controller` with :func:`feedforward_law`; it has no memory.

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

    def reset(self, state: State) -> None:
        """Do nothing: the law has no memory."""

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s); only its pose is used."""
        pose = state.pose
        current, following = (Pose(*row) for row in reference.window(t, 2, self.dt)[:, :3].tolist())
        return Command(feedforward_law(self.gains, pose, current, following, self.dt))

    def compiled_law(self) -> CompiledLaw:
        """Return the law for compiled loops."""
        data = _FeedforwardData(self.gains, self.dt)
        return CompiledLaw(_feedforward_step, data, np.zeros(0), SetpointWindow(0.0, 2, self.dt))


class _FeedforwardData(NamedTuple):
    gains: FeedforwardGains
    dt: float


@compiled
def _feedforward_step(  # noqa: PLR0917
    data: _FeedforwardData,
    memory: Float[Array, " memory"],
    now: SampleState,
    setpoints: Float[Array, "2 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " 0"],
) -> int:
    current = Pose(setpoints[0, 0], setpoints[0, 1], setpoints[0, 2])
    following = Pose(setpoints[1, 0], setpoints[1, 1], setpoints[1, 2])
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    twist = feedforward_law(data.gains, pose, current, following, data.dt)
    command[0], command[1], command[2] = twist.vx, twist.vy, twist.yaw_rate
    return 0
