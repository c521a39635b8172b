"""The self-tuning PID controller that drives to the reference pose of the next sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from math import inf
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow, in_python
from omnidrive.control.controller import CommandLimits
from omnidrive.control.law_controller import LawController
from omnidrive.control.pid.channel import (
    SELF_TUNING_MEMORY,
    Channel,
    WaypointChannel,
    channel_law,
    detail_units,
    packed_channel,
    write_tuning,
)
from omnidrive.estimation import State
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
        m, goal = memory[0], setpoints[0]
        x, y, yaw = now.pose
        error, turn = complex(goal[0] - x, goal[1] - y), goal[2] - yaw
        if data.wraps_heading:
            turn = wrap(turn)
        velocity, tuned = position(data.position, m.position, error, abs(error))
        yaw_rate, tuned_heading = heading(data.heading, m.heading, turn, turn)
        twist = to_body(WorldTwist(velocity.real, velocity.imag, yaw_rate.real), yaw)
        command[0], command[1], command[2] = twist
        write_tuning((tuned, tuned_heading), details)
        return 0

    return law


@dataclass(frozen=True)
class FuzzyPidController(LawController):
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

    dt: float
    position: WaypointChannel
    heading: WaypointChannel
    wraps_heading: bool

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Units of the gains in use and of the fuzzy inputs, per channel."""
        return detail_units({"position": self.position, "heading": self.heading})

    def reset(self, state: State) -> None:
        """Clear the memory."""
        super().reset(state)
        for each in (self.position, self.heading):
            if isinstance(each, Channel):
                each.reset()

    def command_limits(self, reference: Reference) -> CommandLimits:
        """Return the limits of the channels; the law without memory has none."""
        each = (self.position.parameters, self.heading.parameters)
        return CommandLimits(*(getattr(parameters, "limit", inf) for parameters in each))

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law for compiled loops; None for other channels or tuners than ours."""
        position, heading = packed_channel(self.position), packed_channel(self.heading)
        if position is None or heading is None:
            return None
        return self._law_of(position, heading)

    def law_in_python(self) -> CompiledLaw:
        """Return the law for channels or tuners of the user."""
        return in_python(self._law_of(self.position, self.heading))

    def _law_of(self, position: Any, heading: Any) -> CompiledLaw:
        step = waypoint_law(channel_law(self.position), channel_law(self.heading))
        data = WaypointData(self.wraps_heading, position, heading)
        return CompiledLaw(step, data, np.zeros(1, MEMORY), SetpointWindow(self.dt, 1, 0.0))
