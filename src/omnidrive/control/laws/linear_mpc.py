"""Linear model predictive control of the pose error within the speed limit of the wheels.

The error dynamics of an omnidirectional robot are linearised along the reference, as by
Kanjanawanishkul & Zell, "Path following for an omnidirectional mobile robot based on model
predictive control", ICRA 2009. Each sample is a convex quadratic program of 3 horizon variables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow
from omnidrive.control.components import ControllerContext
from omnidrive.control.law_controller import LawController
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.geometry.kernels import to_body, twist_between, wrap
from omnidrive.parameter import Bounds, check_bounds, check_sample_time
from omnidrive.robot import Chassis

_MAX_ITERATIONS = 50
_TOLERANCE = 1e-11
"""Residual of a solution."""
_CENTRING = 0.1
"""Ratio of the complementarity that an iteration aims at to the present one."""
_TO_BOUNDARY = 0.99
"""Largest share of the way to the nearest limit in one iteration."""


class LinearMpcParameters(NamedTuple):
    """Horizon, and the errors and corrections that cost the same: weights ``1 / tolerance^2``."""

    horizon: Annotated[int, Bounds(1, 30, "steps")] = 10
    """Prediction horizon, in steps of the sample time."""
    position: Annotated[float, Bounds(1e-4, 10.0, "m")] = 0.02
    """Tolerance of the error along each axis of the robot, m."""
    heading: Annotated[float, Bounds(1e-4, 10.0, "rad")] = 0.1
    """Tolerance of the heading error, rad."""
    speed: Annotated[float, Bounds(1e-4, 10.0, "m/s")] = 0.1
    """Tolerance of the correction of the velocity along each axis of the robot, m/s."""
    yaw_rate: Annotated[float, Bounds(1e-4, 50.0, "rad/s")] = 0.5
    """Tolerance of the correction of the yaw rate, rad/s."""


class LinearMpcData(NamedTuple):
    """Parameters of the law."""

    dt: float
    error_weights: tuple[float, float, float]
    """Of the errors along x and y of B and of the heading, 1/m^2, 1/m^2, 1/rad^2."""
    final_weights: tuple[float, float, float]
    """Of the errors at the end of the horizon."""
    correction_weights: tuple[float, float, float]
    """Of the corrections of the twist."""
    limits: Float[Array, "limits 3"]
    """Forward and backward speed of each wheel per body twist, as a share of the largest one."""


def final_weight(error: float, correction: float, dt: float) -> float:
    """Return the cost of an error at the end of the horizon: that of its infinite horizon.

    It is the solution p of the Riccati equation of an integrator with the weights q and r,
    ``p^2 = q (p + r / dt^2)``, so that without active limits the law is the linear-quadratic
    regulator for every horizon (Rawlings, Mayne & Diehl, "Model predictive control", 2017, 2.5).

    Args:
        error: Tolerance of the error, ``q = 1 / error^2``.
        correction: Tolerance of the correction, ``r = 1 / correction^2``.
        dt: Sample time, s.
    """
    q, r = 1.0 / (error * error), 1.0 / (correction * correction)
    return 0.5 * (q + sqrt(q * q + 4.0 * q * r / (dt * dt)))


@compiled
def condense(  # noqa: PLR0917
    data: LinearMpcData,
    pose: Pose,
    setpoints: Float[Array, "setpoints 6"],
    feedforward: Float[Array, "horizon 3"],
    hessian: Float[Array, "n n"],
    gradient: Float[Array, " n"],
) -> None:
    """Fill in the cost ``d'Hd/2 + g'd`` of the corrections d, and the feedforward twists.

    The nominal motion has the positions of the reference and the heading error of the robot. The
    error z of the pose is expressed in its frame, in which ``z[k+1] = A z[k] + B d[k]`` to the
    first order: A is the adjoint of the inverse of the nominal displacement in SE(2), B the
    integral of A over the sample by the midpoint rule (Sola, Deray & Atchuthan, "A micro Lie
    theory", 2018). Elimination of z leaves the n = 3 horizon corrections.

    Args:
        data: Parameters.
        pose: Pose of the robot, W.
        setpoints: One more than the horizon.
        feedforward: Output: twists of the nominal motion in its frame.
        hessian: H, zero on entry.
        gradient: g, zero on entry.
    """
    dt, turn = data.dt, wrap(pose.yaw - setpoints[0][2])
    beside = to_body(WorldTwist(pose.x - setpoints[0][0], pose.y - setpoints[0][1], 0.0), pose.yaw)
    x, y = beside.vx, beside.vy  # z without corrections
    effect = np.zeros((3, len(gradient)))  # z per correction
    for k in range(len(feedforward)):
        start = Pose(setpoints[k][0], setpoints[k][1], setpoints[k][2] + turn)
        end = Pose(setpoints[k + 1][0], setpoints[k + 1][1], setpoints[k + 1][2] + turn)
        twist = twist_between(start, end, dt)
        feedforward[k, 0], feedforward[k, 1], feedforward[k, 2] = twist
        moved = to_body(WorldTwist(end.x - start.x, end.y - start.y, 0.0), end.yaw)
        angle = dt * twist.yaw_rate
        c, s = cos(angle), sin(angle)
        x, y = c * x + s * y, c * y - s * x
        for j in range(3 * k):
            ex, ey, e = effect[0, j], effect[1, j], effect[2, j]
            effect[0, j] = c * ex + s * ey - moved.vy * e
            effect[1, j] = c * ey - s * ex + moved.vx * e
        new, c, s = 3 * k, cos(0.5 * angle), sin(0.5 * angle)
        effect[0, new], effect[0, new + 1], effect[0, new + 2] = dt * c, dt * s, -dt * moved.vy / 2
        effect[1, new], effect[1, new + 1], effect[1, new + 2] = -dt * s, dt * c, dt * moved.vx / 2
        effect[2, new + 2] = dt
        weights = data.error_weights if k + 1 < len(feedforward) else data.final_weights
        for row, (weight, error) in enumerate(zip(weights, (x, y, turn))):  # noqa: B905
            for i in range(new + 3):
                weighted = weight * effect[row, i]
                gradient[i] += weighted * error
                for j in range(new + 3):
                    hessian[i, j] += weighted * effect[row, j]
        for i in range(3):
            hessian[new + i, new + i] += data.correction_weights[i]


@compiled
def solve(matrix: Float[Array, "n n"], x: Float[Array, " n"]) -> None:
    """Replace x by ``matrix^-1 x``; a positive definite matrix, by its Cholesky factor.

    Of the matrix, only the lower triangle is used.
    """
    n = len(x)
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = rest / matrix[j, j] if j < i else sqrt(rest)
        for k in range(i):
            x[i] -= matrix[i, k] * x[k]
        x[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= matrix[k, i] * x[k]
        x[i] /= matrix[i, i]


@compiled
def speeds(limits: Float[Array, "limits 3"], twists: Float[Array, " n"]) -> Array:
    """Return the values of the limits for the twist of each stage, at most 1 within them."""
    found = np.empty((len(twists) // 3, len(limits)))
    for k in range(len(found)):
        for i, row in enumerate(limits):
            v = twists[3 * k : 3 * k + 3]
            found[k, i] = row[0] * v[0] + row[1] * v[1] + row[2] * v[2]
    return found


@compiled
def balance(
    limits: Float[Array, "limits 3"], force: Float[Array, "horizon limits"], sums: Array
) -> None:
    """Add the gradients of the limits, times their multipliers, to ``sums`` (n)."""
    for k in range(len(force)):
        for i, row in enumerate(limits):
            for a in range(3):
                sums[3 * k + a] += row[a] * force[k, i]


@compiled
def newton_step(
    hessian: Float[Array, "n n"],
    slope: Float[Array, " n"],
    limits: Float[Array, "limits 3"],
    stiffness: Float[Array, "horizon limits"],
    push: Float[Array, "horizon limits"],
) -> Float[Array, " n"]:
    """Return the step of the twists towards the central path.

    Args:
        hessian: Of the cost.
        slope: Gradient of the cost.
        limits: Gradients of the limits.
        stiffness: Multiplier over slack of each limit.
        push: Aim of multiplier times slack, over slack.
    """
    matrix, step = hessian.copy(), -slope
    balance(limits, -push, step)
    for k in range(len(stiffness)):
        for i, row in enumerate(limits):
            for a in range(3):
                for b in range(3):
                    matrix[3 * k + a, 3 * k + b] += stiffness[k, i] * row[a] * row[b]
    solve(matrix, step)
    return step


@compiled
def largest_share(values: Float[Array, "horizon limits"], step: Array) -> float:
    """Return the largest share of a step, at most 1, that leaves all values positive."""
    share = 1.0
    for value, change in zip(values.ravel(), step.ravel()):  # noqa: B905
        if change < 0.0:
            share = min(share, -_TO_BOUNDARY * value / change)
    return share


@compiled
def minimise(
    hessian: Float[Array, "n n"],
    gradient: Float[Array, " n"],
    limits: Float[Array, "limits 3"],
    feedforward: Float[Array, " n"],
    twists: Float[Array, " n"],
) -> tuple[int, float]:
    """Fill in the twists that minimise the cost of their corrections within the wheel limits.

    Where the unconstrained minimum violates limits, a primal-dual interior-point method follows
    the central path ``slack force = centre``, with a Newton step in each iteration (Nocedal &
    Wright, "Numerical Optimization", 2006, section 16.6). It starts at rest, and every iterate is
    within the limits, the last one of an unfinished solution, too.

    Args:
        hessian: H of the cost ``d'Hd/2 + g'd``, d: twists minus feedforward.
        gradient: g.
        limits: Rows whose products with the twist of each stage are at most 1.
        feedforward: Twists that cost nothing.
        twists: Output.

    Returns:
        Number of iterations; residual: the largest violation of stationarity and complementarity,
        as a share of the gradient at rest.
    """
    twists[:] = -gradient
    solve(hessian.copy(), twists)
    twists += feedforward
    if speeds(limits, twists).max() <= 1.0:
        return 0, 0.0
    twists[:] = 0.0
    slope, unit = gradient.copy(), np.abs(limits).max()
    for i in range(len(slope)):
        slope -= hessian[i] * feedforward[i]
    scale = np.abs(slope).max()
    slack = np.ones((len(twists) // 3, len(limits)))
    force = scale / unit * slack
    iterations, residual = 0, 1.0
    while iterations < _MAX_ITERATIONS:
        centre = _CENTRING * (slack * force).mean()
        step = newton_step(hessian, slope, limits, force / slack, centre / slack)
        change = speeds(limits, step)
        increase = (centre + force * change) / slack - force
        share = min(largest_share(slack, -change), largest_share(force, increase))
        twists += share * step
        force += share * increase
        slack = 1.0 - speeds(limits, twists)
        for i in range(len(slope)):
            slope += share * step[i] * hessian[i]
        unbalanced = slope.copy()
        balance(limits, force, unbalanced)
        residual = max(np.abs(unbalanced).max(), unit * (slack * force).mean()) / scale
        iterations += 1
        if residual < _TOLERANCE:
            break
    return iterations, residual


@compiled
def linear_mpc_law(  # noqa: PLR0917
    data: LinearMpcData,
    memory: Float[Array, " 0"],
    now: SampleState,
    setpoints: Float[Array, "setpoints 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " 2"],
) -> int:
    """Fill in the first twist of the optimal sequence; iterations and residual as details.

    It has no memory. Without errors the twist is exactly that of the reference.
    """
    horizon = len(setpoints) - 1
    feedforward, gradient = np.zeros((horizon, 3)), np.zeros(3 * horizon)
    hessian, twists = np.zeros((3 * horizon, 3 * horizon)), np.zeros(3 * horizon)
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    condense(data, pose, setpoints, feedforward, hessian, gradient)
    iterations, residual = minimise(hessian, gradient, data.limits, feedforward.ravel(), twists)
    command[:] = twists[:3]
    details[0], details[1] = iterations, residual
    return 0 if residual < _TOLERANCE else 1


_DEFAULTS = LinearMpcParameters()


@dataclass(frozen=True)
class LinearMpcController(LawController):
    """A :class:`~omnidrive.control.Controller` with :func:`linear_mpc_law`.

    Attributes:
        dt: Sample time in s.
        chassis: Wheels of the robot, within whose speed limit commands are.
        parameters: Horizon and weights.

    Raises:
        InvalidInput: ``dt`` is not positive, or a parameter is out of its range.
    """

    dt: float
    chassis: Chassis
    parameters: LinearMpcParameters = _DEFAULTS

    def __post_init__(self) -> None:
        check_sample_time(self.dt)
        check_bounds(self.parameters)

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Name and unit of each detail: iterations and residual of :func:`minimise`."""
        return {"iterations": "1", "residual": "1"}

    def compiled_law(self) -> CompiledLaw:
        """Return the law with the weights of the tolerances."""
        p, chassis = self.parameters, self.chassis
        errors = (p.position**-2.0, p.position**-2.0, p.heading**-2.0)
        corrections = (p.speed**-2.0, p.speed**-2.0, p.yaw_rate**-2.0)
        wheels = np.array(chassis.jacobian / chassis.max_wheel_speed, dtype=float)
        final = (
            final_weight(p.position, p.speed, self.dt),
            final_weight(p.position, p.speed, self.dt),
            final_weight(p.heading, p.yaw_rate, self.dt),
        )
        data = LinearMpcData(self.dt, errors, final, corrections, np.vstack((wheels, -wheels)))
        window = SetpointWindow(0.0, p.horizon + 1, self.dt)
        return CompiledLaw(linear_mpc_law, data, np.zeros(0), window)


def controller(context: ControllerContext, parameters: LinearMpcParameters) -> LinearMpcController:
    """Linear MPC of the pose error within the speed limit of the wheels."""
    return LinearMpcController(context.dt, context.robot.chassis, parameters)
