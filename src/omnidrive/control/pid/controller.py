"""Self-tuning PID controllers: one for waypoints, one that corrects a feedforward."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import cos, sin

from omnidrive.control.controller import Command
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.pid.channel import Channel, TrackingChannel, tuning_units
from omnidrive.control.pid.laws import saturate
from omnidrive.control.preparation import run_once
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


@dataclass(slots=True)
class TrackingPidController(GuardedController):
    """A :class:`Controller` that follows the reference's motion and corrects errors in B.

    It commands the body twist whose arc leads, in one sample, to the pose that the reference's
    motion plus the corrections of the channels would reach. With constant gains, ki = kd = 0 and
    no limit it equals :func:`~omnidrive.control.feedforward.feedforward_law`.

    The reference's motion is its mean velocity, and the rate of the error is that motion minus the
    motion of the measured pose: a jump of the reference causes an error but no derivative kick.
    The corrections of x and y are saturated together, which keeps their direction, and the
    integrals are corrected for the saturation. After samples without a usable pose, the rate of the
    error is the mean over the time without one.

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
    _previous: tuple[float, Pose, WorldTwist] | None = field(default=None, init=False)
    """Time (s), pose, and motion of the reference at the previous sample."""

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
        current, motion = _motion(reference, t, self.dt)
        rate = self._rate(t, pose)
        self._previous = t, pose, motion
        error = _in_body(pose, current.x - pose.x, current.y - pose.y, wrap(current.yaw - pose.yaw))

        x, details_x = self.x.step(error[0], rate[0])
        y, details_y = self.y.step(error[1], rate[1])
        turn, details_heading = self.heading.step(error[2], rate[2])
        saturated = saturate(complex(x, y), self.x.parameters.limit)
        saturated_turn = saturate(turn, self.heading.parameters.limit)
        self.x.compensate_saturation(saturated.real - x)
        self.y.compensate_saturation(saturated.imag - y)
        self.heading.compensate_saturation(saturated_turn - turn)

        correction = to_world(BodyTwist(saturated.real, saturated.imag, saturated_turn), pose.yaw)
        twist = _arc(pose, motion, correction, self.dt)
        return Command(twist, details=details_x + details_y + details_heading)

    def _rate(self, t: float, pose: Pose) -> tuple[float, float, float]:
        """Return the mean rate of the error in B since the previous pose, without reference jumps.

        The time since then is a whole number of sample times, also if these vary a little.
        """
        if self._previous is None:
            return (0.0, 0.0, 0.0)
        before, previous, motion = self._previous
        dt = self.dt * max(1, round((t - before) / self.dt))
        return _in_body(
            pose,
            motion.vx - (pose.x - previous.x) / dt,
            motion.vy - (pose.y - previous.y) / dt,
            motion.yaw_rate - wrap(pose.yaw - previous.yaw) / dt,
        )


def _in_body(pose: Pose, x: float, y: float, yaw: float) -> tuple[float, float, float]:
    """Rotate a difference of poses, or of twists, from W to B."""
    c, s = cos(pose.yaw), sin(pose.yaw)
    return c * x + s * y, -s * x + c * y, yaw


def _motion(reference: Reference, t: float, dt: float) -> tuple[Pose, WorldTwist]:
    """Return the reference pose at ``t`` and the mean velocity on [t, t + dt] (Simpson's rule)."""
    rows = reference.window(t, 3, 0.5 * dt).tolist()
    begin, middle, end = (row[3:] for row in rows)
    mean = ((a + 4.0 * b + c) / 6.0 for a, b, c in zip(begin, middle, end, strict=True))
    return Pose(*rows[0][:3]), WorldTwist(*mean)


def _arc(pose: Pose, motion: WorldTwist, correction: WorldTwist, dt: float) -> BodyTwist:
    """Return the body twist whose arc ends where both velocities, in W, would lead in ``dt`` s."""
    goal = Pose(*(p + dt * (v + c) for p, v, c in zip(pose, motion, correction, strict=True)))
    return twist_between(pose, goal, dt)
