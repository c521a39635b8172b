"""Active disturbance rejection: an extended state observer of the pose and the disturbance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp
from typing import Annotated, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow, floats_of
from omnidrive.control.components import ControllerContext
from omnidrive.control.law_controller import LawController
from omnidrive.control.wheel_limit import WheelLimit, within_wheel_limit
from omnidrive.geometry import BodyTwist, Pose, WorldTwist
from omnidrive.geometry.kernels import move, to_body, twist_between, wrap
from omnidrive.parameter import Bounds, check_bounds, check_sample_time
from omnidrive.robot import Chassis

MEMORY = np.dtype([
    ("started", "i8"),
    ("predicted", floats_of(Pose)),
    ("disturbance", floats_of(BodyTwist)),
], align=True)  # fmt: skip
"""Whether there was a sample; the pose in W that was predicted for this one; and the estimated
disturbance, executed minus commanded twist, in B."""


class AdrcParameters(NamedTuple):
    """The two bandwidths of Gao, "Scaling and bandwidth-parameterization", ACC 2003, and bounds.

    Wheels that slip look like a disturbance, too. Without a bound its rejection makes them slip
    more, and the robot may oscillate.
    """

    control: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 4.0
    """Bandwidth of the controller: decay rate of the errors of pose and heading, 1/s."""
    observer: Annotated[float, Bounds(0.1, 200.0, "1/s")] = 6.0
    """Bandwidth of the observer: decay rate of its errors, 1/s."""
    max_speed: Annotated[float, Bounds(0.0, 10.0, "m/s")] = 0.2
    """Largest disturbance of the velocity along x and along y of the robot, m/s."""
    max_yaw_rate: Annotated[float, Bounds(0.0, 50.0, "rad/s")] = 0.5
    """Largest disturbance of the yaw rate, rad/s."""


class AdrcData(NamedTuple):
    """Parameters of the law."""

    dt: float
    control: float
    """Share of the pose error that is left after a sample."""
    pose_gain: float
    """Correction of the estimated pose, per innovation."""
    disturbance_gain: float
    """Correction of the estimated disturbance, per innovation, 1/s."""
    max_speed: float
    max_yaw_rate: float
    limit: WheelLimit


def observer_gains(bandwidth: float, dt: float) -> tuple[float, float]:
    """Return the gains of pose (1) and disturbance (1/s) of the sampled observer of one axis.

    Both poles of the error of the current estimate are ``b = exp(-bandwidth dt)``: Miklosovic,
    Radke & Gao, "Discrete implementation and generalization of the extended state observer",
    ACC 2006.

    Args:
        bandwidth: 1/s.
        dt: Sample time, s.
    """
    b = exp(-bandwidth * dt)
    return 1.0 - b * b, (1.0 - b) ** 2 / dt


@compiled
def bounded(value: float, limit: float) -> float:
    """Return a value, limited to the magnitude ``limit``."""
    return max(-limit, min(limit, value))


@compiled
def adrc_law(  # noqa: PLR0917
    data: AdrcData,
    memory: Any,
    now: SampleState,
    setpoints: Float[Array, "2 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " 3"],
) -> int:
    """Fill in the body twist, and the estimated disturbance in B as details.

    Every axis of B is an integrator of its command plus a disturbance, which lumps lag, slip and
    wrong wheel radii together and is rejected by subtraction (Han, "From PID to active disturbance
    rejection control", IEEE Trans. Ind. Electron. 56(3), 2009). The observer predicts along the
    arc of a constant twist, so that a constant disturbance in B is estimated without error while
    the robot turns, too. The other part of the command is that of
    :func:`~omnidrive.control.feedforward.feedforward_law` for the estimated pose.
    """
    m, dt = memory[0], data.dt
    x, y, yaw = now.pose
    if m.started:
        innovation = WorldTwist(x - m.predicted.x, y - m.predicted.y, wrap(yaw - m.predicted.yaw))
        seen = to_body(innovation, yaw)
        push, gain = m.disturbance, data.disturbance_gain
        push.vx = bounded(push.vx + gain * seen.vx, data.max_speed)
        push.vy = bounded(push.vy + gain * seen.vy, data.max_speed)
        push.yaw_rate = bounded(push.yaw_rate + gain * seen.yaw_rate, data.max_yaw_rate)
        missed = 1.0 - data.pose_gain
        x, y = x - missed * innovation.vx, y - missed * innovation.vy
        yaw -= missed * innovation.yaw_rate
    pose = Pose(x, y, yaw)

    start, end, left = setpoints[0], setpoints[1], data.control
    goal = Pose(
        end[0] + left * (x - start[0]),
        end[1] + left * (y - start[1]),
        end[2] + left * wrap(yaw - start[2]),
    )
    wanted = twist_between(pose, goal, dt)
    disturbance = BodyTwist(m.disturbance.vx, m.disturbance.vy, m.disturbance.yaw_rate)
    twist = within_wheel_limit(
        data.limit,
        BodyTwist(
            wanted.vx - disturbance.vx,
            wanted.vy - disturbance.vy,
            wanted.yaw_rate - disturbance.yaw_rate,
        ),
    )
    executed = BodyTwist(
        twist.vx + disturbance.vx, twist.vy + disturbance.vy, twist.yaw_rate + disturbance.yaw_rate
    )
    m.started = 1
    m.predicted.x, m.predicted.y, m.predicted.yaw = move(pose, executed, dt)
    command[0], command[1], command[2] = twist
    details[0], details[1], details[2] = disturbance
    return 0


_DEFAULTS = AdrcParameters()


@dataclass(frozen=True)
class AdrcController(LawController):
    """A :class:`~omnidrive.control.Controller` with :func:`adrc_law`.

    Attributes:
        dt: Sample time in s.
        chassis: Wheels of the robot, within whose speed limit commands are: the observer needs the
            command that is executed.
        parameters: Bandwidths and largest disturbances.

    Raises:
        InvalidInput: ``dt`` is not positive, or a parameter is out of its range.
    """

    dt: float
    chassis: Chassis
    parameters: AdrcParameters = _DEFAULTS

    def __post_init__(self) -> None:
        check_sample_time(self.dt)
        check_bounds(self.parameters)

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Name and unit of each detail: the estimated disturbance in B."""
        return {"disturbance_x": "m/s", "disturbance_y": "m/s", "disturbance_yaw": "rad/s"}

    def compiled_law(self) -> CompiledLaw:
        """Return the law with the gains of the bandwidths."""
        p, limit = self.parameters, WheelLimit.of(self.chassis)
        left, gains = exp(-p.control * self.dt), observer_gains(p.observer, self.dt)
        data = AdrcData(self.dt, left, *gains, p.max_speed, p.max_yaw_rate, limit)
        return CompiledLaw(adrc_law, data, np.zeros(1, MEMORY), SetpointWindow(0.0, 2, self.dt))


def controller(context: ControllerContext, parameters: AdrcParameters) -> AdrcController:
    """Active disturbance rejection with feedforward of the reference's motion."""
    return AdrcController(context.dt, context.robot.chassis, parameters)
