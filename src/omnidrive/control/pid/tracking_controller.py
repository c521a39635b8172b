"""The self-tuning PID controller that corrects a feedforward of the reference's motion."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import (
    CompiledLaw,
    SampleState,
    SetpointWindow,
    floats_of,
)
from omnidrive.control.pid.channel import (
    TRACKING_MEMORY,
    PidChannel,
    tracking_channel,
    write_tuning,
)
from omnidrive.control.pid.channel_controller import ChannelController
from omnidrive.control.pid.tracking import (
    Pair,
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
from omnidrive.control.pid.tuners import borrowed
from omnidrive.geometry import BodyTwist, Pose, WorldTwist

MEMORY = np.dtype([
    ("started", "i8"),
    ("t", "f8"),
    ("pose", floats_of(Pose)),
    ("motion", floats_of(WorldTwist)),
    ("command", floats_of(BodyTwist)),
    ("response", floats_of(BodyTwist)),
    ("x", TRACKING_MEMORY),
    ("y", TRACKING_MEMORY),
    ("heading", TRACKING_MEMORY),
], align=True)  # fmt: skip
"""Whether there was a sample; its time, s; the pose in W; the mean velocity of the reference until
the next sample, in W; the command; the twist that is predicted from the commands before; and the
memories of the channels."""


class TrackingData(NamedTuple):
    """Parameters of the law; the fields are those of :class:`TrackingPidController`."""

    dt: float
    x: Any
    y: Any
    heading: Any


@compiled
def tracking_pid_law(  # noqa: PLR0917
    data: TrackingData,
    memory: Any,
    now: SampleState,
    setpoints: Float[Array, "3 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " details"],
) -> int:
    """Fill in command and details of a sample."""
    m, d, dt, t = memory[0], borrowed(data), data.dt, now.t
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    first, middle, last = setpoints[0], setpoints[1], setpoints[2]
    begin, end = (first[3], first[4], first[5]), (last[3], last[4], last[5])
    motion = mean_velocity(begin, (middle[3], middle[4], middle[5]), end)
    position, heading = d.x.parameters, d.heading.parameters
    lags = Pair(position.lag, heading.lag)
    maximum = Pair(position.acceleration, heading.acceleration)
    rate, missing, response = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
    if m.started:
        previous = Pose(m.pose.x, m.pose.y, m.pose.yaw)
        earlier = WorldTwist(m.motion.vx, m.motion.vy, m.motion.yaw_rate)
        held = BodyTwist(m.command.vx, m.command.vy, m.command.yaw_rate)
        response = BodyTwist(m.response.vx, m.response.vy, m.response.yaw_rate)
        elapsed = time_between(m.t, t, dt)
        rate = rate_of_error(pose, previous, earlier, whole_samples(elapsed, dt))
        missing, response = missing_motion(pose, previous, held, response, lags, maximum, elapsed)

    error = pose_error(pose, Pose(first[0], first[1], first[2]))
    distance, turn = hypot(error[0], error[1]), abs(error[2])
    x, tuned_x = tracking_channel(d.x, m.x, error[0], rate[0], missing[0], distance)
    y, tuned_y = tracking_channel(d.y, m.y, error[1], rate[1], missing[1], distance)
    yaw_rate, tuned = tracking_channel(d.heading, m.heading, error[2], rate[2], missing[2], turn)
    correction = saturated(x, y, yaw_rate, Pair(position.limit, heading.limit))
    twist = twist_of(pose, lead(motion, begin, end, lags, maximum, dt), correction, dt)
    m.started, m.t = 1, t
    m.pose.x, m.pose.y, m.pose.yaw = pose
    m.motion.vx, m.motion.vy, m.motion.yaw_rate = motion
    m.command.vx, m.command.vy, m.command.yaw_rate = twist
    m.response.vx, m.response.vy, m.response.yaw_rate = response
    command[0], command[1], command[2] = twist
    write_tuning((tuned_x, tuned_y, tuned), details)
    return 0


@dataclass(frozen=True)
class TrackingPidController(ChannelController):
    """A :class:`~omnidrive.control.Controller` that follows the reference and corrects errors in B.

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

    axes: ClassVar[tuple[str, ...]] = ("x", "y", "heading")

    dt: float
    x: PidChannel
    y: PidChannel
    heading: PidChannel

    def law_of(self, *channels: Any) -> CompiledLaw:
        """Return the law with these channels, of kernels or of Python."""
        window = SetpointWindow(0.0, 3, 0.5 * self.dt)
        data = TrackingData(self.dt, *channels)
        return CompiledLaw(tracking_pid_law, data, np.zeros(1, MEMORY), window)
