"""Self-tuning PID controllers: one for waypoints, one that corrects a feedforward."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot, inf
from typing import NamedTuple

from omnidrive.control.compiled_law import CompiledLaw
from omnidrive.control.controller import Command, CommandLimits
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.pid.channel import Channel, TrackingChannel, tuning_units
from omnidrive.control.pid.compiled_laws import tracking_pid_law, waypoint_law
from omnidrive.control.pid.tracking import (
    Vector,
    lead,
    mean_velocity,
    missing_motion,
    pose_error,
    rate_of_error,
    saturated,
    time_between,
    twist_of,
    whole_samples,
)
from omnidrive.control.preparation import run_once
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, wrap
from omnidrive.reference import Reference


def _detail_units(channels: Mapping[str, Channel | TrackingChannel]) -> dict[str, str]:
    """Return name and unit of each number that the channels log, such as ``kp_heading``."""
    return {
        f"{name}_{axis}": unit
        for axis, channel in channels.items()
        for name, unit in tuning_units(channel.parameters).items()
    }


@dataclass(frozen=True, slots=True)
class FuzzyPidController(GuardedController):
    """A :class:`Controller` that drives to the reference pose of the next sample.

    The position channel maps the vector to the goal to a velocity in W, tuned by the distance; the
    heading channel maps the heading difference to a yaw rate. The result is commanded as a body
    twist. The channels hold all memory.

    Attributes:
        dt: Sample time in s.
        position: From the vector to the goal, in m, to a velocity in W, in m/s.
        heading: From the heading difference, in rad, to a yaw rate, in rad/s.
        wraps_heading: Whether the heading difference is wrapped to [-pi, pi].
    """

    dt: float
    position: Channel
    heading: Channel
    wraps_heading: bool

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Units of the gains in use and of the fuzzy inputs, per channel."""
        return _detail_units({"position": self.position, "heading": self.heading})

    def prepare(self) -> None:
        """Compile the kernels of a step."""
        run_once(self)

    def reset(self, state: State) -> None:
        """Clear the memory."""
        self.position.reset()
        self.heading.reset()

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s); only its pose is used."""
        pose = state.pose
        goal = reference.at(t + self.dt).pose
        error = complex(goal.x - pose.x, goal.y - pose.y)
        turn = goal.yaw - pose.yaw
        if self.wraps_heading:
            turn = wrap(turn)
        velocity, position_details = self.position.step(error, abs(error))
        yaw_rate, heading_details = self.heading.step(turn, turn)
        twist = WorldTwist(velocity.real, velocity.imag, yaw_rate.real)
        return Command(to_body(twist, pose.yaw), details=position_details + heading_details)

    def command_limits(self, reference: Reference) -> CommandLimits:
        """Return the limits of the channels; the law without memory has none."""
        each = (self.position.parameters, self.heading.parameters)
        return CommandLimits(*(getattr(parameters, "limit", inf) for parameters in each))

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law for compiled loops; None for other channels or tuners than ours."""
        return waypoint_law(self.dt, (self.position, self.heading), wraps=self.wraps_heading)


class _Sample(NamedTuple):
    """What a :class:`TrackingPidController` keeps of one sample."""

    t: float
    """Time, s."""
    pose: Pose
    """Pose in W."""
    motion: WorldTwist
    """Mean velocity of the reference until the next sample."""
    command: BodyTwist
    response: BodyTwist
    """Twist that is predicted from the commands before."""


_ZERO = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class TrackingPidController(GuardedController):
    """A :class:`Controller` that follows the reference's motion and corrects errors in B.

    It commands the body twist whose arc leads, in one sample, to the pose that the reference's
    motion plus the corrections of the channels would reach. The reference's motion is its mean
    velocity, led by the lag of the robot. With constant gains, ki = kd = 0, no lag and no limits it
    equals :func:`~omnidrive.control.feedforward.feedforward_law`.

    The rate of the error is that motion minus the motion of the measured pose: a jump of the
    reference causes an error but no derivative kick. The integral parts compensate the motion that
    is missing after the commands, see :func:`~.laws.tracking_integral`. The corrections of x and y
    are saturated together, which keeps their direction. After samples without a usable pose, the
    rate of the error and the missing motion are means over the time without one.

    Attributes:
        dt: Sample time in s.
        x: From the error along x of B, in m, to a velocity in that direction, in m/s; its lag,
            limit and acceleration are those of translation.
        y: Likewise along y of B.
        heading: From the heading error, wrapped, in rad, to a yaw rate, in rad/s.
    """

    dt: float
    x: TrackingChannel
    y: TrackingChannel
    heading: TrackingChannel
    _previous: _Sample | None = field(default=None, init=False)

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Units of the gains in use and of the fuzzy inputs, per channel."""
        return _detail_units({"x": self.x, "y": self.y, "heading": self.heading})

    def prepare(self) -> None:
        """Compile the kernels of a step."""
        run_once(self)

    def reset(self, state: State) -> None:
        """Clear the memory."""
        self._previous = None
        for channel in (self.x, self.y, self.heading):
            channel.reset()

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s); only its pose is used."""
        pose = state.pose
        of_position, of_heading = self.x.parameters, self.heading.parameters
        lags = of_position.lag, of_heading.lag
        target, begin, motion, end = _motion(reference, t, self.dt)
        error = pose_error(pose, target)
        most = of_position.acceleration, of_heading.acceleration
        rate, missing, response = _ZERO, _ZERO, BodyTwist(*_ZERO)
        if self._previous is not None:
            before, previous, last_motion, command, response = self._previous
            elapsed = time_between(before, t, self.dt)
            rate = rate_of_error(pose, previous, last_motion, whole_samples(elapsed, self.dt))
            missing, response = missing_motion(
                pose, previous, command, response, lags, most, elapsed
            )

        distance = hypot(error[0], error[1])
        x, details_x = self.x.step(error[0], rate[0], missing[0], distance)
        y, details_y = self.y.step(error[1], rate[1], missing[1], distance)
        turn, details_heading = self.heading.step(error[2], rate[2], missing[2], abs(error[2]))
        correction = saturated(x, y, turn, (of_position.limit, of_heading.limit))
        leading = lead(motion, begin, end, lags, most, self.dt)
        twist = twist_of(pose, leading, correction, self.dt)
        self._previous = _Sample(t, pose, motion, twist, response)
        return Command(twist, details=details_x + details_y + details_heading)

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law for compiled loops; None for other tuners than ours."""
        return tracking_pid_law(self.dt, (self.x, self.y, self.heading))


def _motion(reference: Reference, t: float, dt: float) -> tuple[Pose, Vector, WorldTwist, Vector]:
    """Return the reference pose at ``t``, and velocity at ``t``, mean and at ``t + dt``, in W."""
    begin, middle, end = (tuple(row) for row in reference.window(t, 3, 0.5 * dt).tolist())
    return Pose(*begin[:3]), begin[3:], mean_velocity(begin[3:], middle[3:], end[3:]), end[3:]
