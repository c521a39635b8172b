"""The self-tuning controllers: one steers to a waypoint, one corrects a feedforward."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import cos, isfinite, sin

from omnidrive.control.controller import Command, Status
from omnidrive.control.pid.channel import Channel, TrackingChannel, tuning_units
from omnidrive.control.pid.laws import cut
from omnidrive.estimation import State
from omnidrive.geometry import (
    BodyTwist,
    Pose,
    WorldTwist,
    to_body,
    to_world,
    twist_between,
    wrap,
)
from omnidrive.reference import Reference

_STOP = BodyTwist(0.0, 0.0, 0.0)


def _detail_units(channels: Mapping[str, Channel | TrackingChannel]) -> dict[str, str]:
    """Name and unit of each number that the channels log, such as ``kp_heading``."""
    return {
        f"{name}_{axis}": unit
        for axis, channel in channels.items()
        for name, unit in tuning_units(channel.parameters).items()
    }


@dataclass(frozen=True, slots=True)
class FuzzyPidController:
    """A :class:`Controller` that steers to the reference one sample ahead.

    The position's channel sees the distance to the goal and commands a velocity in W, the
    heading's channel sees the heading difference and commands a yaw rate; the robot executes them
    as a body twist. The memory is that of the channels.

    Attributes:
        dt: Sample time in s.
        position: From the vector to the goal, in m, to a velocity in W, in m/s.
        heading: From the angle to the goal's heading, in rad, to a yaw rate, in rad/s.
        wraps: Whether the robot turns the short way; if not, by the plain difference of headings.
    """

    dt: float
    position: Channel
    heading: Channel
    wraps: bool

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Gains in use and inputs of the fuzzy system, per channel."""
        return _detail_units({"position": self.position, "heading": self.heading})

    def reset(self, state: State) -> None:
        """Forget the past."""
        self.position.reset()
        self.heading.reset()

    def step(self, t: float, state: State, reference: Reference) -> Command:
        """Command for the state estimated at ``t`` (s); only its pose is used."""
        pose = state.pose
        goal = reference.at(t + self.dt).pose
        error = complex(goal.x - pose.x, goal.y - pose.y)
        turn = goal.yaw - pose.yaw
        if self.wraps:
            turn = wrap(turn)
        velocity, moving = self.position.step(error, abs(error))
        yaw_rate, turning = self.heading.step(turn, turn)
        twist = WorldTwist(velocity.real, velocity.imag, yaw_rate.real)
        return Command(to_body(twist, pose.yaw), details=moving + turning)


@dataclass(slots=True)
class TrackingPidController:
    """A :class:`Controller` that follows the reference's motion and corrects errors in B.

    It commands the body twist whose arc leads, in one sample, to where the reference's own motion
    and the channels' corrections add up. With constant gains, ki = kd = 0 and no limit this is
    :func:`~omnidrive.control.feedforward.feedforward_law`.

    The reference's motion is that of its velocity, and the rate of the error is that motion minus
    the measured pose's: where the reference jumps there is an error to remove, but no kick. The
    corrections of x and y are cut together, which does not turn them, and the channels are told
    what was cut. A pose that is not finite fails one step and spoils no later one.

    Attributes:
        dt: Sample time in s.
        x: From the error along x of B, in m, to a velocity in that direction, in m/s.
        y: Likewise along y of B.
        heading: From the heading error, wrapped, in rad, to a yaw rate, in rad/s.
    """

    dt: float
    x: TrackingChannel
    y: TrackingChannel
    heading: TrackingChannel
    _last: tuple[Pose, WorldTwist] | None = field(default=None, init=False)

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Gains in use and inputs of the fuzzy system, per channel."""
        return _detail_units({"x": self.x, "y": self.y, "heading": self.heading})

    def reset(self, state: State) -> None:
        """Forget the past."""
        self._last = None
        for channel in (self.x, self.y, self.heading):
            channel.reset()

    def step(self, t: float, state: State, reference: Reference) -> Command:
        """Command for the state estimated at ``t`` (s); only its pose is used."""
        pose = state.pose
        if not isfinite(pose.x + pose.y + pose.yaw):
            self._last = None
            return Command(_STOP, Status.FAILED)
        now, motion = _motion(reference, t, self.dt)
        rate = self._rate(pose)
        self._last = pose, motion
        error = _in_body(pose, now.x - pose.x, now.y - pose.y, wrap(now.yaw - pose.yaw))

        x, details_x = self.x.step(error[0], rate[0])
        y, details_y = self.y.step(error[1], rate[1])
        turn, details_heading = self.heading.step(error[2], rate[2])
        given = cut(complex(x, y), self.x.parameters.limit)
        given_turn = cut(turn, self.heading.parameters.limit)
        self.x.lose(given.real - x)
        self.y.lose(given.imag - y)
        self.heading.lose(given_turn - turn)

        correction = to_world(BodyTwist(given.real, given.imag, given_turn), pose.yaw)
        twist = _arc(pose, motion, correction, self.dt)
        return Command(twist, details=details_x + details_y + details_heading)

    def _rate(self, pose: Pose) -> tuple[float, float, float]:
        """Mean rate of the error in B over the last sample, without jumps of the reference."""
        if self._last is None:
            return (0.0, 0.0, 0.0)
        last, motion = self._last
        dt = self.dt
        return _in_body(
            pose,
            motion.vx - (pose.x - last.x) / dt,
            motion.vy - (pose.y - last.y) / dt,
            motion.yaw_rate - wrap(pose.yaw - last.yaw) / dt,
        )


def _in_body(pose: Pose, x: float, y: float, yaw: float) -> tuple[float, float, float]:
    """A difference of poses, or of twists, rewritten from W to B."""
    c, s = cos(pose.yaw), sin(pose.yaw)
    return c * x + s * y, -s * x + c * y, yaw


def _motion(reference: Reference, t: float, dt: float) -> tuple[Pose, WorldTwist]:
    """Reference pose at ``t`` and mean velocity on [t, t + dt], by Simpson's rule."""
    rows = reference.window(t, 3, 0.5 * dt).tolist()
    begin, middle, end = (row[3:] for row in rows)
    mean = ((a + 4.0 * b + c) / 6.0 for a, b, c in zip(begin, middle, end, strict=True))
    return Pose(*rows[0][:3]), WorldTwist(*mean)


def _arc(pose: Pose, motion: WorldTwist, correction: WorldTwist, dt: float) -> BodyTwist:
    """Body twist whose arc leads where both velocities, in W, would lead in ``dt`` s."""
    goal = Pose(*(p + dt * (v + c) for p, v, c in zip(pose, motion, correction, strict=True)))
    return twist_between(pose, goal, dt)
