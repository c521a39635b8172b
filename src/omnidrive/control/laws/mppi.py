"""Model predictive path integral control: the mean of random motions, weighted by their cost.

Williams, Drews, Goldfain, Rehg & Theodorou, "Information-theoretic model predictive control", IEEE
Trans. Robotics 34(6), 2018. Motion model and terms of the cost are those of Nav2's MPPI controller
for omnidirectional robots that need no cost map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, hypot, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow, floats_of
from omnidrive.control.components import ControllerContext
from omnidrive.control.law_controller import LawController
from omnidrive.control.wheel_limit import WheelLimit, within_wheel_limit
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.geometry.kernels import move, twist_between, wrap
from omnidrive.parameter import Bounds, check_bounds, check_sample_time
from omnidrive.robot import Chassis

_SETS = 16
"""Number of sets of noise, used in turn."""
STATE = np.dtype([("sample", "i8"), ("twist", floats_of(BodyTwist))], align=True)
"""Number of the sample, and its last commanded twist; zero: at rest."""


class MppiParameters(NamedTuple):
    """Samples, their noise, terms of the cost, and limits of acceleration."""

    horizon: Annotated[int, Bounds(1, 60, "steps")] = 12
    """Prediction horizon, in steps of the sample time."""
    pairs: Annotated[int, Bounds(1, 5000)] = 150
    """Number of pairs of sampled motions, whose noise has opposite signs."""
    temperature: Annotated[float, Bounds(1e-6, 1e6)] = 1.7
    """Cost of a motion above the best one at which its weight is 1/e."""
    speed_noise: Annotated[float, Bounds(1e-6, 10.0, "m/s")] = 0.14
    """Standard deviation of the sampled velocity along x and along y of the robot, m/s."""
    yaw_rate_noise: Annotated[float, Bounds(1e-6, 50.0, "rad/s")] = 0.17
    """Standard deviation of the sampled yaw rate, rad/s."""
    position: Annotated[float, Bounds(1e-4, 10.0, "m")] = 0.057
    """Tolerance of the distance to the reference, m."""
    heading: Annotated[float, Bounds(1e-4, 10.0, "rad")] = 0.095
    """Tolerance of the heading error, rad."""
    yaw_rate: Annotated[float, Bounds(1e-4, 50.0, "rad/s")] = 3.2
    """Tolerance of the yaw rate beside that of the reference, rad/s."""
    control_cost: Annotated[float, Bounds(0.0, 1.0)] = 0.065
    """Cost of corrections, as a share of that of Williams et al. (gamma over temperature)."""
    wheel_cost: Annotated[float, Bounds(0.0, 1e6)] = 81.0
    """Cost of a wheel speed of twice the limit in one step."""
    max_acceleration: Annotated[float, Bounds(1e-3, 1e3, "m/s^2")] = 4.2
    """Largest change of the velocity along x and along y of the robot, m/s^2."""
    max_yaw_acceleration: Annotated[float, Bounds(1e-3, 1e4, "rad/s^2")] = 26.0
    """Largest change of the yaw rate, rad/s^2."""


class MppiData(NamedTuple):
    """Parameters of the law."""

    dt: float
    parameters: MppiParameters
    noise: Float[Array, "sets pairs horizon 3"]
    """Deviations from the mean twists, in B."""
    limit: WheelLimit


class MppiMemory(NamedTuple):
    """Memory of the law."""

    corrections: Float[Array, "horizon 3"]
    """Mean twists without the feedforward, from the next sample on, in B."""
    state: Array
    """One record of :data:`STATE`."""


@inlined
def tolerated(error: float, tolerance: float) -> float:
    """Return the cost of an error: half its square in tolerances if small, linear if large."""
    return sqrt(1.0 + (error / tolerance) ** 2) - 1.0


@inlined
def within_acceleration(data: MppiData, twist: BodyTwist, last: BodyTwist) -> BodyTwist:
    """Return a twist, each component limited to what the acceleration reaches in a sample."""
    step = data.parameters.max_acceleration * data.dt
    turn = data.parameters.max_yaw_acceleration * data.dt
    return BodyTwist(
        last.vx + max(-step, min(step, twist.vx - last.vx)),
        last.vy + max(-step, min(step, twist.vy - last.vy)),
        last.yaw_rate + max(-turn, min(turn, twist.yaw_rate - last.yaw_rate)),
    )


@compiled
def cost_of_motion(  # noqa: PLR0917
    data: MppiData,
    pose: Pose,
    last: BodyTwist,
    setpoints: Float[Array, "setpoints 6"],
    feedforward: Float[Array, "horizon 3"],
    deviation: Float[Array, "horizon 3"],
) -> float:
    """Return the cost of a motion with twists ``feedforward + deviation``.

    Nav2's terms in every step: distance to the target (path align, path follow; goal in the last
    step), heading error (path angle, goal angle), yaw rate beside the reference's (twirling) and
    wheel speeds beyond the limit (constraint).

    Args:
        data: Parameters.
        pose: Pose of the robot, W.
        last: Its last commanded twist.
        setpoints: One more than the horizon.
        feedforward: Twists of the reference, in B.
        deviation: Further twists.
    """
    p, total, j = data.parameters, 0.0, data.limit.jacobian
    for k in range(len(feedforward)):
        f, d = feedforward, deviation
        wanted = BodyTwist(f[k, 0] + d[k, 0], f[k, 1] + d[k, 1], f[k, 2] + d[k, 2])
        last = within_acceleration(data, wanted, last)
        pose = move(pose, last, data.dt)
        x, y = pose.x - setpoints[k + 1, 0], pose.y - setpoints[k + 1, 1]
        total += tolerated(hypot(x, y), p.position)
        total += tolerated(wrap(pose.yaw - setpoints[k + 1, 2]), p.heading)
        total += tolerated(last.yaw_rate - f[k, 2], p.yaw_rate)
        peak = 0.0
        for w in range(len(j)):
            speed = j[w, 0] * last.vx + j[w, 1] * last.vy + j[w, 2] * last.yaw_rate
            peak = max(peak, abs(speed))
        total += p.wheel_cost * max(0.0, peak / data.limit.speed - 1.0)
    return total


@compiled
def weights_of(costs: Float[Array, " samples"], temperature: float) -> Float[Array, " samples"]:
    """Return weights ``exp(-cost / temperature)``, whose sum is 1."""
    weights = np.empty(len(costs))
    lowest = costs.min()
    for i, cost in enumerate(costs):
        weights[i] = exp((lowest - cost) / temperature)
    weights /= weights.sum()
    return weights


@compiled
def feedforward_twists(
    pose: Pose, setpoints: Float[Array, "setpoints 6"], dt: float
) -> Float[Array, "horizon 3"]:
    """Return the twists that move a robot with its heading error as the reference moves, in B."""
    turn, twists = wrap(pose.yaw - setpoints[0][2]), np.empty((len(setpoints) - 1, 3))
    for k in range(len(twists)):
        start = Pose(setpoints[k][0], setpoints[k][1], setpoints[k][2] + turn)
        end = Pose(setpoints[k + 1][0], setpoints[k + 1][1], setpoints[k + 1][2] + turn)
        twists[k, 0], twists[k, 1], twists[k, 2] = twist_between(start, end, dt)
    return twists


@compiled
def mppi_law(  # noqa: PLR0917
    data: MppiData,
    memory: MppiMemory,
    now: SampleState,
    setpoints: Float[Array, "setpoints 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " 2"],
) -> int:
    """Fill in the first mean twist; lowest cost and effective number of samples as details.

    The mean is the feedforward of the reference plus corrections, to which every sample adds the
    weighted mean of the noise. Noise in pairs of opposite signs has no mean where the cost is
    symmetric, so that a robot without error follows the reference without noise. The noise is drawn
    once; its sets take turns: the same law in single steps and in batches.
    """
    p, corrections, m, dt = data.parameters, memory.corrections, memory.state[0], data.dt
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    last = BodyTwist(m.twist.vx, m.twist.vy, m.twist.yaw_rate)
    feedforward = feedforward_twists(pose, setpoints, dt)
    noise = data.noise[m.sample % len(data.noise)]
    costs = np.empty(2 * len(noise))
    spread = (p.speed_noise, p.speed_noise, p.yaw_rate_noise)
    for i in range(len(costs)):
        sign = 1.0 - 2.0 * (i % 2)
        costs[i] = cost_of_motion(
            data, pose, last, setpoints, feedforward, corrections + sign * noise[i // 2]
        )
        for k in range(len(corrections)):
            for a in range(3):
                share = corrections[k, a] * noise[i // 2, k, a] / spread[a] ** 2
                costs[i] += p.control_cost * p.temperature * sign * share
    weights = weights_of(costs, p.temperature)
    for i in range(len(noise)):
        corrections += (weights[2 * i] - weights[2 * i + 1]) * noise[i]

    for k in range(len(corrections)):
        f, c = feedforward[k], corrections[k]
        wanted = BodyTwist(f[0] + c[0], f[1] + c[1], f[2] + c[2])
        last = within_wheel_limit(data.limit, within_acceleration(data, wanted, last))
        if k == 0:
            command[0], command[1], command[2] = last
        else:
            for a in range(3):
                corrections[k - 1, a] = last[a] - f[a]
    corrections[-1] = 0.0
    m.sample += 1
    m.twist.vx, m.twist.vy, m.twist.yaw_rate = command[0], command[1], command[2]
    details[0], details[1] = costs.min(), 1.0 / (weights * weights).sum()
    return 0


_DEFAULTS = MppiParameters()


def draw_noise(
    rng: np.random.Generator, parameters: MppiParameters
) -> Float[Array, "sets pairs horizon 3"]:
    """Return the noise of the sampled twists, m/s, m/s, rad/s: white, normally distributed."""
    p = parameters
    spread = (p.speed_noise, p.speed_noise, p.yaw_rate_noise)
    return rng.standard_normal((_SETS, p.pairs, p.horizon, 3)) * spread


@dataclass(frozen=True, eq=False)
class MppiController(LawController):
    """A :class:`~omnidrive.control.Controller` with :func:`mppi_law`.

    Attributes:
        dt: Sample time in s.
        chassis: Wheels of the robot, within whose speed limit commands are.
        noise: That of :func:`draw_noise` for the parameters.
        parameters: Samples, cost and limits of acceleration.

    Raises:
        InvalidInput: ``dt`` is not positive, a parameter is out of its range, or the noise is that
            of another number of samples or another horizon.
    """

    dt: float
    chassis: Chassis
    noise: Float[Array, "sets pairs horizon 3"]
    parameters: MppiParameters = _DEFAULTS

    def __post_init__(self) -> None:
        check_sample_time(self.dt)
        check_bounds(self.parameters)
        shape = (len(self.noise), self.parameters.pairs, self.parameters.horizon, 3)
        if self.noise.shape != shape or not self.noise.size:
            raise InvalidInput(f"noise must have the shape {shape}, got {self.noise.shape}")

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Name and unit of each detail: lowest cost, effective number of samples."""
        return {"cost": "1", "effective_samples": "1"}

    def compiled_law(self) -> CompiledLaw:
        """Return the law with the controller's parameters and noise."""
        p, limit = self.parameters, WheelLimit.of(self.chassis)
        data = MppiData(self.dt, p, self.noise, limit)
        memory = MppiMemory(np.zeros((p.horizon, 3)), np.zeros(1, STATE))
        return CompiledLaw(mppi_law, data, memory, SetpointWindow(0.0, p.horizon + 1, self.dt))


def controller(context: ControllerContext, parameters: MppiParameters) -> MppiController:
    """Model predictive path integral control with feedforward of the reference's motion."""
    noise = draw_noise(context.rng, parameters)
    return MppiController(context.dt, context.robot.chassis, noise, parameters)
