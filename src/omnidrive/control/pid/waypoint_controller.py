"""The self-tuning PID controller that drives to the reference pose of the next sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import inf
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow
from omnidrive.control.controller import CommandLimits
from omnidrive.control.pid.channel import (
    SELF_TUNING_MEMORY,
    Channel,
    PidChannel,
    channel_law,
    write_tuning,
)
from omnidrive.control.pid.channel_controller import ChannelController
from omnidrive.control.pid.tuners import borrowed
from omnidrive.geometry import WorldTwist
from omnidrive.geometry.kernels import to_body, wrap
from omnidrive.reference import Reference

MEMORY = np.dtype([("position", SELF_TUNING_MEMORY), ("heading", SELF_TUNING_MEMORY)], align=True)


class WaypointData(NamedTuple):
    """Parameters of the law; the fields are those of :class:`FuzzyPidController`."""

    wraps_heading: bool
    position: Any
    heading: Any


@cache
def waypoint_law(position: Callable[..., Any], heading: Callable[..., Any]) -> Callable[..., int]:
    """Return the kernel of the law for the laws of the channels of position and heading."""

    @compiled
    def law(  # noqa: PLR0917
        data: WaypointData,
        memory: Any,
        now: SampleState,
        setpoints: Float[Array, "1 6"],
        command: Float[Array, " 3"],
        details: Float[Array, " details"],
    ) -> int:
        """Fill in command and details of a sample."""
        m, goal, channels = memory[0], setpoints[0], borrowed(data)
        x, y, yaw = now.pose
        error, turn = complex(goal[0] - x, goal[1] - y), goal[2] - yaw
        if data.wraps_heading:
            turn = wrap(turn)
        velocity, tuned = position(channels.position, m.position, error, abs(error))
        yaw_rate, tuned_heading = heading(channels.heading, m.heading, turn, turn)
        twist = to_body(WorldTwist(velocity.real, velocity.imag, yaw_rate.real), yaw)
        command[0], command[1], command[2] = twist
        write_tuning((tuned, tuned_heading), details)
        return 0

    return law


@dataclass(frozen=True)
class FuzzyPidController(ChannelController):
    """A :class:`~omnidrive.control.Controller` that drives to the next sample's reference pose.

    The position channel maps the vector to the goal to a velocity in W, tuned by the distance; the
    heading channel maps the heading difference to a yaw rate. The result is commanded as a body
    twist.

    Attributes:
        dt: Sample time in s.
        position: From the vector to the goal, in m, to a velocity in W, in m/s.
        heading: From the heading difference, in rad, to a yaw rate, in rad/s.
        wraps_heading: Whether the heading difference is wrapped to [-pi, pi].
    """

    axes: ClassVar[tuple[str, ...]] = ("position", "heading")

    dt: float
    position: PidChannel | Channel
    heading: PidChannel | Channel
    wraps_heading: bool

    def command_limits(self, reference: Reference) -> CommandLimits:
        """Return the limits of the channels; the law without memory has none."""
        each = (self.position.parameters, self.heading.parameters)
        return CommandLimits(*(getattr(parameters, "limit", inf) for parameters in each))

    def law_of(self, *channels: Any) -> CompiledLaw:
        """Return the law with these channels, of kernels or of Python."""
        step = waypoint_law(channel_law(self.position), channel_law(self.heading))
        data = WaypointData(self.wraps_heading, *channels)
        return CompiledLaw(step, data, np.zeros(1, MEMORY), SetpointWindow(self.dt, 1, 0.0))
