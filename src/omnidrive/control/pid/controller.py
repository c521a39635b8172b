"""Self-tuning PID controllers: one for waypoints, one that corrects a feedforward."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from omnidrive.control.compiled_law import CompiledLaw
from omnidrive.control.controller import Command
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.pid.channel import Channel, TrackingChannel, tuning_units
from omnidrive.control.pid.compiled_laws import tracking_pid_law, waypoint_law
from omnidrive.control.pid.tracking import (
    mean_velocity,
    pose_error,
    rate_of_error,
    saturated,
    twist_of,
)
from omnidrive.control.preparation import run_once
from omnidrive.estimation import State
from omnidrive.geometry import Pose, WorldTwist, to_body, wrap
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

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law for compiled loops; None for other channels or tuners than ours."""
        return waypoint_law(self.dt, (self.position, self.heading), wraps=self.wraps_heading)


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
        target, motion = _motion(reference, t, self.dt)
        rate = (0.0, 0.0, 0.0)
        if self._previous is not None:
            before, previous, last_motion = self._previous
            rate = rate_of_error(pose, previous, last_motion, t - before, self.dt)
        self._previous = t, pose, motion
        error = pose_error(pose, target)

        x, details_x = self.x.step(error[0], rate[0])
        y, details_y = self.y.step(error[1], rate[1])
        turn, details_heading = self.heading.step(error[2], rate[2])
        limits = (self.x.parameters.limit, self.heading.parameters.limit)
        correction = saturated(x, y, turn, limits)
        self.x.compensate_saturation(correction.vx - x)
        self.y.compensate_saturation(correction.vy - y)
        self.heading.compensate_saturation(correction.yaw_rate - turn)
        twist = twist_of(pose, motion, correction, self.dt)
        return Command(twist, details=details_x + details_y + details_heading)

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law for compiled loops; None for other tuners than ours."""
        return tracking_pid_law(self.dt, (self.x, self.y, self.heading))


def _motion(reference: Reference, t: float, dt: float) -> tuple[Pose, WorldTwist]:
    """Return the reference pose at ``t`` and the mean velocity on [t, t + dt]."""
    begin, middle, end = (tuple(row) for row in reference.window(t, 3, 0.5 * dt).tolist())
    return Pose(*begin[:3]), mean_velocity(begin[3:], middle[3:], end[3:])
