"""The law of the controller: command and details of a sample, with and without a usable plan."""

from __future__ import annotations

from enum import IntEnum
from math import isfinite, nan, sqrt
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compilable, compiled
from omnidrive.compiled.views import uncounted
from omnidrive.control.compiled_law import SampleState
from omnidrive.control.nmpc.common.exit import CONVERGED
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, KeepOutArrays, Limits
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolverSettings
from omnidrive.control.nmpc.holonomic.step import (
    FIGURES,
    Plan,
    command_stage,
    fill_problem,
    solve_problem,
)
from omnidrive.estimation.drive.identification_state import IdentificationMemory
from omnidrive.estimation.drive_estimate import write_estimate
from omnidrive.estimation.motion.acceleration_ratio import limit_ratio
from omnidrive.estimation.motion.disturbance import disturbance_at
from omnidrive.estimation.motion.motion_memory import MotionMemory, motion_memory, remember
from omnidrive.estimation.motion.observation import Measurement, observe
from omnidrive.estimation.motion.pose_noise import position_variance
from omnidrive.estimation.motion.robot_model import RobotModel

OLD_PLAN_STEPS, RAMP_STEPS = 3, 5
"""Without a new plan: number of steps that follow the latest plan at its full speed, and number of
the steps after them in which the speed decreases; then the robot is stopped."""

_OK, _FALLBACK, _FAILED = 0, 1, 2  # the values of Status


class FallbackLevel(IntEnum):
    """How a command was computed, in descending order of preference."""

    CONVERGED = 0
    """A locally optimal plan."""
    FEASIBLE = 1
    """A plan that is not known to be optimal; that of a :class:`HolonomicSolver` satisfies the
    limits."""
    OLD_PLAN = 2
    """The latest plan, computed in an earlier step: without feedback."""
    RAMP = 3
    """As ``OLD_PLAN``, with decreasing speed."""
    STOP = 4
    """No plan that can still be followed: zero twist."""


_OPTIMAL, _FEASIBLE, _OLD_PLAN, _RAMP, _STOP = map(int, FallbackLevel)


class LawData(NamedTuple):
    """Parameters of the law."""

    robot: RobotModel
    dt: float
    """This and the next four are parts of the problem, see :class:`HolonomicProblem`."""
    state_weights: Float[Array, "points 3"]
    cautious_weights: Float[Array, "points 3"]
    """As ``state_weights``, where the delay of the response is unknown."""
    control_weights: Float[Array, " 3"]
    limits: Limits
    keep_outs: KeepOutArrays
    approach_limits: Limits
    """As ``limits``, with the reserve of acceleration: for approaches to a standing target."""
    settings: HolonomicSolverSettings
    reserve: float
    """Largest acceleration of an approach over the limits of acceleration, at least 1."""
    may_spin: bool
    """Whether wheels may spin, see :func:`~.slip_compensation.compensate`."""


STEP = np.dtype([
    ("started", "i8"),
    ("t", "f8"),
    ("pose", "f8", 3),
    ("approaches", "i8"),
    ("plan_steps", "i8"),
], align=True)  # fmt: skip
"""Whether there was a step; its time (s) and pose (m, m, rad); whether its plan approaches a
standing target; and the number of steps along the latest plan, 0 without a plan."""


DETAILS = np.dtype([
    ("fallback_level", "f8"),
    ("solver_iterations", "f8"),
    ("kkt_residual", "f8"),
    ("disturbance", "f8", 3),
    ("pose_noise", "f8"),
    ("reference_delay", "f8"),
])  # fmt: skip
"""Details of a command without those of the identification, see
``HolonomicController.detail_units``."""

_COLUMNS = DETAILS.itemsize // 8


class LawMemory(NamedTuple):
    """What the law keeps from one sample to the next, all zero at the start."""

    motion: MotionMemory
    plan: Plan
    start: Float[Array, " 3"]
    """This and the next four are arrays of the problem, see :class:`HolonomicProblem`."""
    previous: Float[Array, " 3"]
    targets: Float[Array, "points 3"]
    feedforward: Float[Array, "stages 3"]
    state_weights: Float[Array, "points 3"]
    bounds: Float[Array, " rows"]
    """Of the limits, without those of an approach."""
    last: Any
    """The last step, a record of :data:`STEP`."""


def law_memory(
    stages: int, rows: int, commands: int, identified: IdentificationMemory | None = None
) -> LawMemory:
    """Return the memory for plans of a number of stages, with ``rows`` limits in each.

    ``commands`` is the number of commands to remember, ``identified`` the memory of the
    identification of the drive.
    """
    points, figures = stages + 1, np.zeros(1, FIGURES)
    plan = Plan(np.zeros((stages, 3)), np.zeros((points, 3)), np.zeros((stages, rows)), figures)
    return LawMemory(
        motion_memory(commands, identified),
        plan,
        np.zeros(3),
        np.zeros(3),
        np.zeros((points, 3)),
        np.zeros((stages, 3)),
        np.zeros((points, 3)),
        np.zeros(rows),
        np.zeros(1, STEP),
    )


@compilable
def stage_problem(data: LawData, memory: LawMemory) -> HolonomicProblem:
    """Return the problem that :func:`begin` has filled in."""
    approaches = memory.last[0]["approaches"]  # in Python, a record has no attributes
    return _problem(data, memory, data.approach_limits if approaches else _limits(data, memory))


@compilable
def latest_velocities(memory: LawMemory) -> Float[Array, "later 3"]:
    """Return the velocities of the latest plan from now on; empty: there is none."""
    steps, velocities = memory.last[0]["plan_steps"], memory.plan.velocities
    return velocities[steps if steps > 0 else len(velocities) :]


@compilable
def _limits(data: LawData, memory: LawMemory) -> Limits:
    """Return the limits with the bounds of this step."""
    return Limits(data.limits.now, data.limits.before, memory.bounds, data.limits.inertial)


@compilable
def _problem(data: LawData, memory: LawMemory, limits: Limits) -> HolonomicProblem:
    return HolonomicProblem(
        data.dt,
        memory.start,
        memory.previous,
        memory.targets,
        memory.feedforward,
        memory.state_weights,
        data.control_weights,
        limits,
        data.keep_outs,
    )


@compiled
def law(  # noqa: PLR0917
    data: LawData,
    memory: LawMemory,
    now: SampleState,
    setpoints: Float[Array, "points 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " details"],
) -> int:
    """Compute command and details of a sample; return the status, see :class:`CompiledLaw`.

    A pose or time that is not finite is a lost measurement: the motion is predicted, and the latest
    plan is followed, as after a solver that finds no usable plan.
    """
    d, m = uncounted(data), uncounted(memory)
    solved = False
    if begin(d, m, now, setpoints):
        tolerance, max_iterations = d.settings
        p, latest = stage_problem(d, m), latest_velocities(m)
        solved = solve_problem(p, m.plan, latest, tolerance, max_iterations)
    return finish(d, m, solved, now.delay, command, details)


@compiled
def begin(
    data: LawData, memory: LawMemory, now: SampleState, setpoints: Float[Array, "points 6"]
) -> bool:
    """Observe the motion and fill in the problem; return whether there is one to solve."""
    last, dt, x, y, yaw = memory.last[0], data.dt, now.pose[0], now.pose[1], now.pose[2]
    lost = not isfinite(now.t + x + y + yaw)
    if lost and not last.started:
        return False
    elapsed = now.t - last.t if last.started else nan
    moved = x != last.pose[0] or y != last.pose[1] or yaw != last.pose[2]
    fresh = now.fix_age <= 0.0 or not last.started or moved
    if lost:
        elapsed, fresh = dt, False
    measured = Measurement(elapsed, now.pose, now.twist, now.variances, fresh)
    observe(data.robot, memory.motion, measured, dt, not last.approaches)
    if lost:
        last.t += dt
        return False
    last.started, last.t = 1, now.t
    last.pose[0], last.pose[1], last.pose[2] = x, y, yaw
    _fill_weights(data, memory)
    _fill_bounds(data, memory)
    problem = _problem(data, memory, _limits(data, memory))
    approaches = fill_problem(
        data.robot, memory.motion, problem, setpoints, 0, now.last, data.reserve
    )
    last.approaches = 1 if approaches else 0
    return True


@compiled
def _fill_bounds(data: LawData, memory: LawMemory) -> None:
    """Fill in the bounds of the limits: accelerations are those that the robot is seen to reach."""
    ratio, speeds = limit_ratio(memory.motion.state[0]), len(data.robot.wheels)
    for k in range(len(memory.bounds)):
        memory.bounds[k] = data.limits.bounds[k] * (ratio if k >= speeds else 1.0)


@compiled
def _fill_weights(data: LawData, memory: LawMemory) -> None:
    """Fill in the weights of the states: less feedback where the delay is unknown."""
    caution = memory.motion.state[0].caution
    for k in range(len(memory.state_weights)):
        for a in range(3):
            usual = data.state_weights[k, a]
            cautious = data.cautious_weights[k, a]
            memory.state_weights[k, a] = usual + caution * (cautious - usual)


@compiled
def finish(  # noqa: PLR0917
    data: LawData,
    memory: LawMemory,
    solved: bool,
    delay: float,
    command: Float[Array, " 3"],
    details: Float[Array, " details"],
) -> int:
    """Compute the command along the latest plan, the slower the older it is; return the status.

    Args:
        data: Parameters.
        memory: Its plan is one of this step if ``solved``.
        solved: Whether this step has a usable plan.
        delay: Of the reference, s; for the details.
        command: Output; body twist.
        details: Output, as ``HolonomicController.detail_units``.
    """
    motion, figures, last = memory.motion, memory.plan.figures[0], memory.last[0]
    if solved:
        last.plan_steps = 1
    elif last.plan_steps > 0:
        last.plan_steps += 1
    age, max_age = last.plan_steps - 1, OLD_PLAN_STEPS + RAMP_STEPS
    twist, level, status = (0.0, 0.0, 0.0), _STOP, _FAILED
    if 0 <= age <= max_age and age < len(memory.plan.velocities):
        factor = min(1.0, (max_age - age + 1) / (RAMP_STEPS + 1))
        approaches = last.approaches > 0
        twist = command_stage(
            data.robot, motion, memory.plan, age, factor, data.dt, approaches, data.may_spin
        )
        level, status = (_OLD_PLAN if factor == 1.0 else _RAMP), _FALLBACK
        if solved and figures.exit == CONVERGED:
            level, status = _OPTIMAL, _OK
        elif solved:
            level = _FEASIBLE
    else:
        remember(motion, twist)
    row = details[:_COLUMNS].view(DETAILS)[0]
    row.fallback_level, row.solver_iterations, row.kkt_residual = level, 0.0, nan
    if solved:
        row.solver_iterations, row.kkt_residual = figures.iterations, figures.residual
    disturbance = disturbance_at(data.robot.model, motion.state[0], twist)
    for a in range(3):
        command[a], row.disturbance[a] = twist[a], disturbance[a]
    row.pose_noise, row.reference_delay = sqrt(position_variance(motion.state[0])), delay
    if len(details) > _COLUMNS:
        write_estimate(motion.identified.state[0].estimate, details[_COLUMNS:])
    return status


class CalledLaw(NamedTuple):
    """Parameters of the law in a compiled loop."""

    law: Any
    """:func:`law` as a :class:`~omnidrive.compiled.CompiledFunction`."""
    data: LawData


@compiled
def call_law(  # noqa: PLR0917
    called: CalledLaw,
    memory: LawMemory,
    now: SampleState,
    setpoints: Float[Array, "points 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " details"],
) -> int:
    """Call the machine code of :func:`law`, which need not be compiled again for each loop."""
    for a in range(3):
        command[a] = nan  # remains if the call fails
    status: int = called.law(called.data, memory, now, setpoints, command, details)
    return status
