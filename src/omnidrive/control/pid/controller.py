"""The self-tuning controller: one fuzzy PID for the position, one for the heading."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive.control.controller import Command
from omnidrive.control.pid.channel import Channel
from omnidrive.geometry import Pose, WorldTwist, to_body, wrap
from omnidrive.reference import Reference


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

    def reset(self, pose: Pose) -> None:
        """Forget the past."""
        self.position.reset()
        self.heading.reset()

    def step(self, t: float, pose: Pose, reference: Reference) -> Command:
        """Command for the pose measured at ``t`` (s)."""
        goal = reference.at(t + self.dt).pose
        error = complex(goal.x - pose.x, goal.y - pose.y)
        turn = goal.yaw - pose.yaw
        if self.wraps:
            turn = wrap(turn)
        velocity = self.position.step(error, abs(error))
        yaw_rate = self.heading.step(turn, turn).real
        return Command(to_body(WorldTwist(velocity.real, velocity.imag, yaw_rate), pose.yaw))
