"""A controller for omnidrive: errors decay exponentially."""

from dataclasses import dataclass
from math import exp
from typing import Annotated

import omnidrive as od
from omnidrive.geometry import twist_between, wrap


@dataclass(frozen=True)
class DecayParameters:
    """Decay rates of errors."""

    position: Annotated[float, od.Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of the position error, 1/s."""
    heading: Annotated[float, od.Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of the heading error, 1/s."""


class DecayController:
    """Feedforward of the reference; errors decay exponentially from sample to sample."""

    def __init__(self, context: od.ControllerContext, parameters: DecayParameters) -> None:
        """Store the sample time and the parameters."""
        self.dt, self.parameters = context.dt, parameters

    def reset(self, state: od.State) -> None:
        """Do nothing: the law has no memory."""

    def step(self, t: float, state: od.State, reference: od.Reference) -> od.Command:
        """Return the twist that leads to the next reference pose plus the decayed error."""
        pose, dt = state.pose, self.dt
        now, following = (od.Pose(*row) for row in reference.window(t, 2, dt)[:, :3].tolist())
        decay = exp(-self.parameters.position * dt)
        yaw_decay = exp(-self.parameters.heading * dt)
        goal = od.Pose(
            following.x + decay * (pose.x - now.x),
            following.y + decay * (pose.y - now.y),
            following.yaw + yaw_decay * wrap(pose.yaw - now.yaw),
        )
        return od.Command(twist_between(pose, goal, dt))
