"""One step of the controller as compiled functions: fill in the problem, solve it, command."""

from __future__ import annotations

from math import cos, isfinite, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.exit import CONVERGED
from omnidrive.control.nmpc.holonomic.lqr import unconstrained_velocities
from omnidrive.control.nmpc.holonomic.minimum_time_targets import minimum_time_targets
from omnidrive.control.nmpc.holonomic.other_side import HYSTERESIS, replaces
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.slip_compensation import (
    CORRECTIONS,
    compensate,
    predict_change,
)
from omnidrive.control.nmpc.holonomic.solution import assess
from omnidrive.control.nmpc.holonomic.solver import minimise, violates_constraints
from omnidrive.control.nmpc.holonomic.stage_point import lower_bound, overwrite
from omnidrive.estimation.motion.acceleration_ratio import (
    acceleration_load,
    approach_share,
    is_late,
    limit_ratio,
    response_ratio,
)
from omnidrive.estimation.motion.disturbance import without_disturbance
from omnidrive.estimation.motion.motion_memory import (
    MotionMemory,
    remember,
)
from omnidrive.estimation.motion.motion_observer import (
    predict_delayed,
)
from omnidrive.estimation.motion.pose_noise import NOISY, position_variance
from omnidrive.estimation.motion.robot_model import RobotModel, fastest_wheel
from omnidrive.geometry.arc import arc_twist
from omnidrive.geometry.kernels import wrap_angle
from omnidrive.robot.slip import Vector

_STANDING = 1e-9
"""Speed of a reference up to which it stands, m/s and rad/s."""
_NEAR = 1e-6
"""Distance from a standing target up to which there is nothing to approach, m and rad."""
_MAX_LQR_LOAD = 0.3
"""Share of the limits of acceleration up to which the plan of least squares leads to the target."""

_RETURN_GAIN, _RETURN_SHARE = 8.5, 0.5
"""Speed of the return to a moving reference per distance, in 1/s, and the share of the acceleration
that the robot reaches with which it stops there; the reference needs the rest."""
_SLIPPERY = 0.9
"""Factor of the limits of acceleration above which the robot is not seen to reach less."""

_APPROACH_CORRECTIONS = (3, 2)
"""As :data:`~.slip_compensation.CORRECTIONS`, in approaches: there wheels slip, and further
corrections let them spin without driving the robot more."""


FIGURES = np.dtype([
    ("cost", "f8"),
    ("residual", "f8"),
    ("violation", "f8"),
    ("iterations", "i8"),
    ("exit", "i8"),
], align=True)  # fmt: skip
"""Figures of a plan: cost, KKT residual, violation, iterations and exit code."""


class Plan(NamedTuple):
    """Latest plan; all arrays are filled in place."""

    velocities: Float[Array, "stages 3"]
    states: Float[Array, "points 3"]
    multipliers: Float[Array, "stages rows"]
    figures: Any
    """A record of :data:`FIGURES`."""


@compiled
def fill_problem(  # noqa: PLR0917
    robot: RobotModel,
    memory: MotionMemory,
    p: HolonomicProblem,
    window: Float[Array, "rows 6"],
    first: int,
    last: int,
    reserve: float,
) -> bool:
    """Fill in the arrays of a problem that change from step to step.

    Args:
        robot: The robot.
        memory: State of the motion observer.
        p: The problem; ``start``, ``previous``, ``targets`` and ``feedforward`` are filled in.
        window: Setpoints of the reference, ``dt`` apart.
        first: Row of the one at which a command takes effect after the least delay.
        last: Number of setpoints after that one that are not later than the reference.
        reserve: Largest acceleration of an approach over the limits, at least 1.

    Returns:
        Whether the targets are those of an approach to a standing target.
    """
    ahead = int((memory.state[0].drive.delay - robot.drive[0].delay) / p.dt + 0.5)
    first, last = first + ahead, max(last - ahead, 0)
    pose, twist, _ = predict_delayed(robot.model, memory, p.dt)
    points, before = len(p.targets), pose[2]
    for a in range(3):
        p.start[a], p.previous[a] = pose[a], twist[a]
    speed = 0.0
    for k in range(points):
        p.targets[k, 0], p.targets[k, 1] = window[first + k, 0], window[first + k, 1]
        p.targets[k, 2] = before + wrap_angle(window[first + k, 2] - before)
        before = p.targets[k, 2]
        for a in range(3 if k > 0 else 0):
            p.feedforward[k - 1, a] = (p.targets[k, a] - p.targets[k - 1, a]) / p.dt
            speed = max(speed, abs(p.feedforward[k - 1, a]))
    _extrapolate_targets(robot, p, last)
    distance = 0.0
    for a in range(3):
        distance = max(distance, abs(p.targets[0, a] - p.start[a]))
    if len(robot.faces) == 0:
        return False
    if speed > _STANDING:
        _bring_targets_near(robot, memory.state[0], p)
        return False
    if distance <= _NEAR:
        return False
    return _approach_target(robot, memory.state[0], p, twist, reserve)


@compiled
def _bring_targets_near(robot: RobotModel, state: Any, p: HolonomicProblem) -> None:
    """Move all targets towards the robot if it is so far behind that it would pass them.

    Feedback of gain g closes a distance d at the speed g d, from which a robot with the
    acceleration a stops within d up to d = 2 a / g^2. Farther away, d is replaced by the one from
    which it can stop: g d' = sqrt(2 a d). The horizon is too short to plan this. Position and
    heading are moved separately, so that the heading does not wait for the position.
    """
    c, s = cos(p.start[2]), sin(p.start[2])
    x, y = p.targets[0, 0] - p.start[0], p.targets[0, 1] - p.start[1]
    turn = p.targets[0, 2] - p.start[2]
    ratio = limit_ratio(state)
    if ratio > _SLIPPERY:
        return
    share = _RETURN_SHARE * ratio
    away = acceleration_load(robot.faces, (c * x + s * y, c * y - s * x, 0.0)) / share
    turned = acceleration_load(robot.faces, (0.0, 0.0, turn)) / share
    near = 2.0 / (_RETURN_GAIN * _RETURN_GAIN)
    if max(away, turned) <= near:
        return
    part = 1.0 - sqrt(near / max(away, near))
    yaw_part = 1.0 - sqrt(near / max(turned, near))
    for k in range(len(p.targets)):
        p.targets[k, 0] -= part * x
        p.targets[k, 1] -= part * y
        p.targets[k, 2] -= yaw_part * turn


@compiled
def _approach_target(
    robot: RobotModel, state: Any, p: HolonomicProblem, twist: Vector, reserve: float
) -> bool:
    """Replace a standing target by an approach, unless the free plan is one well within limits."""
    target = (p.targets[0, 0], p.targets[0, 1], p.targets[0, 2])
    lead, prompt = _lead(robot, p, twist), response_ratio(state)
    free = unconstrained_velocities(p)
    if not violates_constraints(p, free):
        vx, vy, rate = free[0]
        ahead, left = arc_twist(p.dt, p.start[2], vx, vy, rate)
        share = prompt * prompt  # a gentle change is not yet a near target if it acts too late
        change = (ahead - share * twist[0], left - share * twist[1], rate - share * twist[2])
        if acceleration_load(robot.faces, change) <= _MAX_LQR_LOAD * share * (0.5 * p.dt + lead):
            return False
    minimum_time_targets(
        p.start,
        twist,
        target,
        p.state_weights[0],
        robot.faces,
        robot.wheels,
        robot.max_wheel_speed,
        p.dt,
        lead,
        reserve,
        approach_share(state),
        prompt,
        p.targets,
    )
    for k in range(len(p.feedforward)):
        for a in range(3):
            p.feedforward[k, a] = (p.targets[k + 1, a] - p.targets[k, a]) / p.dt
    return True


@compiled
def _extrapolate_targets(robot: RobotModel, p: HolonomicProblem, last: int) -> None:
    """Let targets after target ``last`` go on at its velocity if the robot cannot stop there.

    A reference that ends in motion stops at once, which no robot can do: a plan that shall be at
    rest then leaves the reference before its end. Its end is not late, the robot stops behind it.
    """
    if not 0 < last < len(p.feedforward):
        return
    x, y, rate = p.feedforward[last - 1]
    c, s = cos(p.targets[last, 2]), sin(p.targets[last, 2])
    if acceleration_load(robot.faces, (c * x + s * y, c * y - s * x, rate)) <= p.dt:
        return
    for k in range(last, len(p.feedforward)):
        for a in range(3):
            p.feedforward[k, a] = p.feedforward[last - 1, a]
            p.targets[k + 1, a] = p.targets[k, a] + p.dt * p.feedforward[k, a]


@compiled
def _lead(robot: RobotModel, p: HolonomicProblem, twist: Vector) -> float:
    """Return the time, in s, by which targets lead a motion that is at the limit of acceleration.

    The mean twist of a sample that ends with the twist of the motion is ahead of the motion's,
    where the robot follows commands within the sample: by half a sample if it does so at once.
    """
    x, y = p.targets[0, 0] - p.start[0], p.targets[0, 1] - p.start[1]
    turn = p.targets[0, 2] - p.start[2]
    c, s = cos(p.start[2]), sin(p.start[2])
    error = (c * x + s * y, c * y - s * x, turn)
    share = p.dt / acceleration_load(robot.faces, error)
    change = (share * error[0], share * error[1], share * turn)
    mean, final = predict_change(robot.model, change, twist, p.dt)
    by_mean, by_end = 0.0, 0.0
    for a in range(3):
        weight = robot.model.inertia[a] * change[a]
        by_mean += weight * (mean[a] - twist[a])
        by_end += weight * (final[a] - twist[a])
    return p.dt * max(by_mean / by_end - 0.5, 0.0) if by_end > 0.0 else 0.0


@compiled
def solve_problem(
    p: HolonomicProblem,
    plan: Plan,
    latest: Float[Array, "later 3"],
    tolerance: float,
    max_iterations: int,
) -> bool:
    """Solve a problem as :class:`~.solver.HolonomicSolver` does; fill in the plan if it is usable.

    Where a limit is active and the heading error exceeds a right angle, the problem with the other
    turn of the heading is solved as well, unless its optimum without limits costs more already; see
    :func:`~.other_side.replaces` for the choice.

    Args:
        p: The problem; the yaws of its targets become those of the chosen turn.
        plan: Output; may contain ``latest``.
        latest: Velocities of the latest plan from now on; empty: there is none.
        tolerance: See :class:`~.solver.HolonomicSolverSettings`.
        max_iterations: See :class:`~.solver.HolonomicSolverSettings`.

    Returns:
        Whether problem and plan consist of finite numbers.
    """
    if not isfinite(p.start.sum() + p.targets.sum()):
        return False
    velocities, multipliers, iterations, code = minimise(p, latest, tolerance, max_iterations)
    states, cost, residual, violation = assess(p, velocities, multipliers)
    if not isfinite(cost + residual + violation):
        return False
    error = p.targets[0, 2] - p.start[2]
    if iterations > 0 and abs(error) > 0.5 * pi:
        turn = -2.0 * pi if error > 0.0 else 2.0 * pi
        _turn_targets(p, turn)
        better, other = False, unconstrained_velocities(p)
        if (1.0 - HYSTERESIS) * lower_bound(p, other) < cost:
            other, others, spent, end = minimise(p, latest, tolerance, max_iterations)
            assessed = assess(p, other, others)
            usable = end == CONVERGED and isfinite(assessed[1] + assessed[2] + assessed[3])
            better = usable and replaces(p, velocities, cost, other, assessed[1], latest)
            if better:
                velocities, multipliers, iterations, code = other, others, spent, end
                states, cost, residual, violation = assessed
        if not better:
            _turn_targets(p, -turn)
    overwrite(plan.velocities, velocities)
    overwrite(plan.states, states)
    overwrite(plan.multipliers, multipliers)
    figures = plan.figures[0]
    figures.cost, figures.residual, figures.violation = cost, residual, violation
    figures.iterations, figures.exit = iterations, code
    return True


@compiled
def _turn_targets(p: HolonomicProblem, angle: float) -> None:
    """Add an angle, in rad, to the yaw of every target."""
    for k in range(len(p.targets)):
        p.targets[k, 2] += angle


@compiled
def command_stage(  # noqa: PLR0917
    robot: RobotModel,
    memory: MotionMemory,
    plan: Plan,
    stage: int,
    factor: float,
    dt: float,
    approaches: bool,
    may_spin: bool,
) -> Vector:
    """Return the commanded twist that moves the robot as a stage of the plan, and remember it.

    No wheel may spin where poses are noisy, or where the robot responds later than the model on a
    moving reference: commands that make wheels spin would act when the robot shall not accelerate.

    Args:
        robot: The robot.
        memory: State of the motion observer.
        plan: The plan.
        stage: Index of the stage.
        factor: Of the planned twist.
        dt: Sample time, s.
        approaches: Whether the plan approaches a standing target.
        may_spin: Whether wheels may spin, see :func:`~.slip_compensation.compensate`.
    """
    desired = _stage_twist(plan, stage, factor, dt)
    following = _stage_twist(plan, min(stage + 1, len(plan.velocities) - 1), factor, dt)
    _, initial, motors = predict_delayed(robot.model, memory, dt)
    state = memory.state[0]
    noisy = position_variance(state) > NOISY * NOISY
    may_spin = may_spin and not (noisy or (is_late(state) and not approaches))
    corrections = _APPROACH_CORRECTIONS if approaches else CORRECTIONS
    change = (
        0.5 * (following[0] - desired[0]),
        0.5 * (following[1] - desired[1]),
        0.5 * (following[2] - desired[2]),
    )
    end = (desired[0] + change[0], desired[1] + change[1], desired[2] + change[2])
    effective = compensate(robot.model, desired, end, initial, dt, corrections, may_spin)
    mean = without_disturbance(robot.model, state, effective)
    command = _saturate(robot, _command_motors(state, mean, motors, change, dt))
    remember(memory, command)
    return command


@compiled
def _stage_twist(plan: Plan, stage: int, factor: float, dt: float) -> Vector:
    """Return the body twist of a stage, times a factor."""
    vx, vy, rate = plan.velocities[stage]
    ahead, left = arc_twist(dt, plan.states[stage, 2], vx, vy, rate)
    return factor * ahead, factor * left, factor * rate


@compiled
def _command_motors(state: Any, mean: Vector, motors: Vector, change: Vector, dt: float) -> Vector:
    """Return the command with which the motors have a mean twist over a sample.

    The mean of ``lag dm/dt = gain u - m``, without a jump of m.

    Args:
        state: Estimates of the observer.
        mean: The mean twist.
        motors: Twist of the motors at the start of the sample.
        change: From the mean twist to that at the end of the sample.
        dt: Sample time, s.
    """
    lead, yaw_lead, gains = state.lead / dt, state.yaw_lead / dt, state.drive.gains
    return (
        (mean[0] + lead * (mean[0] + change[0] - motors[0])) / gains[0],
        (mean[1] + lead * (mean[1] + change[1] - motors[1])) / gains[1],
        (mean[2] + yaw_lead * (mean[2] + change[2] - motors[2])) / gains[2],
    )


@compiled
def _saturate(robot: RobotModel, twist: Vector) -> Vector:
    """Return the largest multiple of a twist, at most 1, within the maximum wheel speed."""
    vx, vy, rate = twist
    fastest = fastest_wheel(robot, twist)
    if fastest <= robot.max_wheel_speed:
        return vx, vy, rate
    factor = robot.max_wheel_speed / fastest
    return factor * vx, factor * vy, factor * rate
