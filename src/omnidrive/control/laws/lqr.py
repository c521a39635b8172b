"""Linear-quadratic regulator of the pose error, with feedforward of the reference's motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_discrete_are

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow, floats_of
from omnidrive.control.components import ControllerContext
from omnidrive.control.law_controller import LawController
from omnidrive.control.wheel_limit import WheelLimit, within_wheel_limit
from omnidrive.geometry import BodyTwist, Pose, WorldTwist
from omnidrive.geometry.kernels import to_body, to_world, twist_between, wrap
from omnidrive.parameter import Bounds, check_bounds, check_sample_time
from omnidrive.robot import Chassis
from omnidrive.robot.lag_response import mean_decay

MEMORY = floats_of(BodyTwist)
"""Body twist at the sample, predicted from the commands; zero: at rest."""


class LqrTolerances(NamedTuple):
    """Errors and corrections that cost the same: the weights are ``1 / tolerance^2``."""

    x: Annotated[float, Bounds(1e-4, 10.0, "m")] = 0.02
    """Tolerance of the error along x of the robot, m."""
    y: Annotated[float, Bounds(1e-4, 10.0, "m")] = 0.02
    """Tolerance of the error along y of the robot, m."""
    heading: Annotated[float, Bounds(1e-4, 10.0, "rad")] = 0.1
    """Tolerance of the heading error, rad."""
    speed: Annotated[float, Bounds(1e-4, 10.0, "m/s")] = 0.1
    """Tolerance of the correction of the velocity along x and along y, m/s."""
    yaw_rate: Annotated[float, Bounds(1e-4, 50.0, "rad/s")] = 0.5
    """Tolerance of the correction of the yaw rate, rad/s."""


class Axis(NamedTuple):
    """Gains and lag of one axis of B."""

    pose_gain: float
    """Correction per error of the pose, 1/s."""
    velocity_gain: float
    """Correction per error of the velocity."""
    mean: float
    """Share of the initial velocity in the mean velocity of a sample, see
    :func:`~omnidrive.robot.lag_response.mean_decay`."""
    final: float
    """Share of the initial velocity in the final velocity of a sample."""


class LqrData(NamedTuple):
    """Parameters of the law."""

    dt: float
    x: Axis
    y: Axis
    heading: Axis
    limit: WheelLimit


def error_model(lag: float, dt: float) -> tuple[Float[Array, "2 2"], Float[Array, "2 1"]]:
    """Return A and B of ``z[k+1] = A z[k] + B u[k]``, z: errors of pose and velocity of an axis."""
    mean, final = mean_decay(lag, dt)
    return np.array([[1.0, dt * mean], [0.0, final]]), np.array(
        [[dt * (1.0 - mean)], [1.0 - final]]
    )


def lqr_gain(lag: float, dt: float, error: float, correction: float) -> Float[Array, " 2"]:
    """Return K of ``u = -K z`` that minimises the sum of ``(e / error)^2 + (u / correction)^2``.

    With the solution P of the discrete algebraic Riccati equation, ``K = (R + B'PB)^-1 B'PA``
    (Anderson & Moore, "Optimal Control: Linear Quadratic Methods", 1990, section 2.4). Weights that
    are inverse squares of tolerances are Bryson's rule.

    Args:
        lag: Time constant of the axis, s.
        dt: Sample time, s.
        error: Tolerance of the error e of the pose, m or rad.
        correction: Tolerance of the correction u, m/s or rad/s.
    """
    a, b = error_model(lag, dt)
    r = np.array([[correction**-2.0]])
    p = solve_discrete_are(a, b, np.diag([error**-2.0, 0.0]), r)
    gain: Float[Array, " 2"] = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)[0]
    return gain


@compiled
def lag_compensation(axis: Axis, motion: float, wanted: float, velocity: float) -> float:
    """Return what a lag adds to the command of an axis: feedforward and velocity feedback.

    Args:
        axis: The axis.
        motion: Mean velocity of the reference in the sample, m/s or rad/s.
        wanted: Its velocity at the sample.
        velocity: Velocity of the robot at the sample.
    """
    lead = axis.mean / (1.0 - axis.mean) * (motion - wanted)
    return lead - axis.velocity_gain * (velocity - wanted)


@compiled
def lqr_law(  # noqa: PLR0917
    data: LqrData,
    memory: Any,
    now: SampleState,
    setpoints: Float[Array, "2 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " 0"],
) -> int:
    """Fill in the body twist: feedforward plus optimal feedback of the errors along the reference.

    The errors are expressed in B, which turns along the reference: the gains are constant in B and
    vary in time in W. The pose feedback of one sample is applied exactly, along the arc of a
    constant twist, see :func:`~omnidrive.control.feedforward.feedforward_law`.
    """
    m, d, dt = memory[0], data, data.dt
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    start = Pose(setpoints[0][0], setpoints[0][1], setpoints[0][2])
    end = Pose(setpoints[1][0], setpoints[1][1], setpoints[1][2])
    wanted = to_body(WorldTwist(setpoints[0][3], setpoints[0][4], setpoints[0][5]), start.yaw)
    motion = twist_between(start, end, dt)

    error = to_body(WorldTwist(pose.x - start.x, pose.y - start.y, 0.0), pose.yaw)
    turn = wrap(pose.yaw - start.yaw)
    x, y = (1.0 - dt * d.x.pose_gain) * error.vx, (1.0 - dt * d.y.pose_gain) * error.vy
    kept = to_world(BodyTwist(x, y, (1.0 - dt * d.heading.pose_gain) * turn), pose.yaw)
    goal = Pose(end.x + kept.vx, end.y + kept.vy, end.yaw + kept.yaw_rate)
    direct = twist_between(pose, goal, dt)

    twist = within_wheel_limit(
        d.limit,
        BodyTwist(
            direct.vx + lag_compensation(d.x, motion.vx, wanted.vx, m.vx),
            direct.vy + lag_compensation(d.y, motion.vy, wanted.vy, m.vy),
            direct.yaw_rate
            + lag_compensation(d.heading, motion.yaw_rate, wanted.yaw_rate, m.yaw_rate),
        ),
    )
    m.vx = twist.vx + d.x.final * (m.vx - twist.vx)
    m.vy = twist.vy + d.y.final * (m.vy - twist.vy)
    m.yaw_rate = twist.yaw_rate + d.heading.final * (m.yaw_rate - twist.yaw_rate)
    command[0], command[1], command[2] = twist
    return 0


_DEFAULTS = LqrTolerances()


@dataclass(frozen=True)
class LqrController(LawController):
    """A :class:`~omnidrive.control.Controller` with :func:`lqr_law`.

    Attributes:
        dt: Sample time in s.
        chassis: Wheels of the robot, within whose speed limit commands are.
        lag: Time constants of translation and rotation in response to commands, s.
        tolerances: Weights of the cost, as tolerances.

    Raises:
        InvalidInput: ``dt`` is not positive, or a tolerance is out of its range.
    """

    dt: float
    chassis: Chassis
    lag: tuple[float, float] = (0.0, 0.0)
    tolerances: LqrTolerances = _DEFAULTS

    def __post_init__(self) -> None:
        check_sample_time(self.dt)
        check_bounds(self.tolerances)

    def compiled_law(self) -> CompiledLaw:
        """Return the law with the controller's gains."""
        q, (translation, rotation) = self.tolerances, self.lag
        axes = (
            self._axis(translation, q.x, q.speed),
            self._axis(translation, q.y, q.speed),
            self._axis(rotation, q.heading, q.yaw_rate),
        )
        data = LqrData(self.dt, *axes, WheelLimit.of(self.chassis))
        return CompiledLaw(lqr_law, data, np.zeros(1, MEMORY), SetpointWindow(0.0, 2, self.dt))

    def _axis(self, lag: float, error: float, correction: float) -> Axis:
        pose_gain, velocity_gain = lqr_gain(lag, self.dt, error, correction).tolist()
        return Axis(pose_gain, velocity_gain, *mean_decay(lag, self.dt))


def controller(context: ControllerContext, parameters: LqrTolerances) -> LqrController:
    """Linear-quadratic regulator with feedforward of the reference's motion."""
    lag = context.robot.lag if context.forces else (0.0, 0.0)
    return LqrController(context.dt, context.robot.chassis, lag, parameters)
