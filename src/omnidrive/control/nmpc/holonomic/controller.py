"""NMPC of holonomic robots."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from math import isfinite
from typing import Literal

import numpy as np

from omnidrive.control.controller import STOP, Command, Status
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.nmpc.common.checks import check_settings
from omnidrive.control.nmpc.common.exit import Exit
from omnidrive.control.nmpc.holonomic.actuation import Actuation
from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt
from omnidrive.control.nmpc.holonomic.keep_out_zone import KeepOutZone
from omnidrive.control.nmpc.holonomic.parameters import HolonomicParameters
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, Limits
from omnidrive.control.nmpc.holonomic.solution import HolonomicOptimizer, HolonomicSolution
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, HolonomicSolverSettings
from omnidrive.control.nmpc.holonomic.tracking import tracking_problem
from omnidrive.control.preparation import run_once
from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.parameter import check_choice
from omnidrive.reference import Hold, Reference
from omnidrive.robot import Chassis

SolverName = Literal["sqp", "rti", "casadi"]
KeepOutForecast = Callable[[float, int, float], Sequence[KeepOutZone]]
"""``keep_outs(t, points, dt)``: keep-out zones over a horizon that starts at ``t`` (s).

A moving zone has one centre for each of the ``points`` times t, t + dt, ...; see
:class:`KeepOutZone`."""

RTI_ITERATIONS = 4
"""With the solver ``rti``: most iterations of the active-set and of the interior-point method."""
_SOLVERS: dict[SolverName, Callable[[], HolonomicOptimizer]] = {
    "sqp": HolonomicSolver,
    "rti": lambda: HolonomicSolver(HolonomicSolverSettings(max_iterations=RTI_ITERATIONS)),
    "casadi": HolonomicIpopt,
}

OLD_PLAN_STEPS, RAMP_STEPS = 3, 5
"""Without a new plan: number of steps that follow the latest plan at its full speed, and number of
the steps after them in which the speed decreases; then the robot is stopped."""


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


@dataclass(slots=True)
class HolonomicController(GuardedController):
    """A :class:`~omnidrive.control.Controller` that solves a :class:`HolonomicProblem` every step.

    The target of every state is the reference's pose at that time. The feedforward velocity of a
    stage is the difference of its two targets over ``dt``, so that a robot on the reference stays
    on it. The planned twist of a stage is the constant body twist from its first to its last state,
    along an arc; the commanded twist also compensates the lag of the robot or the slip of its
    wheels. Delay compensation: the first state of a plan is predicted from the measured pose with
    the body twists that earlier commands cause during the delay.

    There is no warm start, so that an invalid measurement does not affect later solves. If the
    solver finds no usable plan, the latest one is followed for a few steps, and then the robot is
    stopped. The details of a command contain its :class:`FallbackLevel`.

    Attributes:
        dt: Sample time and length of a stage, in s.
        horizon: N, number of stages.
        parameters: Weights of the cost.
        chassis: The wheels and their maximum speed.
        actuation: Response of the robot to commanded twists.
        solver: Solver of the optimal control problem.
        keep_outs: Keep-out zones over the horizon.
        solution: The latest plan; None if there is none since ``reset``.

    Raises:
        InvalidInput: ``dt``, ``horizon`` or a parameter is outside its domain.
    """

    dt: float
    horizon: int
    parameters: HolonomicParameters
    chassis: Chassis
    actuation: Actuation
    solver: HolonomicOptimizer
    keep_outs: KeepOutForecast
    solution: HolonomicSolution | None = field(default=None, init=False)
    _age: int = field(default=0, init=False)
    """Number of steps since the one that computed the latest plan."""
    _twists: deque[BodyTwist] = field(init=False, repr=False)
    """Predicted body twists, oldest first: from the one in effect at the next measurement to the
    one that the latest command causes."""
    _final_twist: BodyTwist = field(init=False, repr=False)
    """Predicted body twist at the time at which the next command takes effect; zero without a slip
    model, which alone uses it."""
    _limits: Limits = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_settings(self.dt, self.horizon, self.parameters)
        self._limits = self.actuation.limits(self.chassis, self.dt)
        self._twists = deque(maxlen=int(self.actuation.delay / self.dt) + 1)
        self._clear()

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Names and units of the details of a command.

        ``fallback_level`` is a :class:`FallbackLevel`. Without a new plan ``solver_iterations`` is
        0 and ``kkt_residual`` is NaN.
        """
        return {"fallback_level": "1", "solver_iterations": "1", "kkt_residual": "1"}

    def reset(self, state: State) -> None:
        """Clear the latest plan and the predicted twists; the robot is at rest."""
        self._clear()

    def prepare(self) -> None:
        """Compile the kernels of a step, also those that a deadline could skip in the first one."""
        run_once(self)
        if isinstance(self.solver, HolonomicSolver) and self.solver.deadline is not None:
            origin = Pose(0.0, 0.0, 0.0)
            self.solver.precompile(self._problem(0.0, origin, Hold(origin, 1.0)))

    def with_reduced_drive(self, drive: ReducedDrive) -> HolonomicController:
        """Return a controller in the same state that plans with the wheels that still drive."""
        actuation = self.actuation.with_reduced_drive(drive)
        other = replace(self, chassis=drive.chassis, actuation=actuation)
        other.solution, other._age = self.solution, self._age
        other._final_twist = self._final_twist
        other._twists.extend(self._twists)
        return other

    def _clear(self) -> None:
        self.solution, self._age, self._final_twist = None, 0, STOP
        self._twists.extend([STOP] * (self._twists.maxlen or 0))

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s); only its pose is used."""
        pose = state.pose
        problem = self._problem(t + self.actuation.delay, self._predict(pose), reference)
        usable = isfinite(problem.start.sum() + problem.targets.sum())
        solution = self.solver.solve(problem) if usable else None
        if solution is None or solution.exit is Exit.UNUSABLE:
            return self.fall_back("no usable solution")
        self.solution, self._age = solution, 0
        converged = solution.exit is Exit.CONVERGED
        level = FallbackLevel.CONVERGED if converged else FallbackLevel.FEASIBLE
        status = Status.OK if converged else Status.FALLBACK
        twist = self._compensate(self._planned_twist(solution, 0))
        return Command(twist, status, self._details(level, solution))

    def _problem(self, t: float, pose: Pose, reference: Reference) -> HolonomicProblem:
        return tracking_problem(
            self.parameters,
            t,
            pose,
            reference,
            horizon=self.horizon,
            dt=self.dt,
            previous=self._twists[-1],
            limits=self._limits,
            keep_outs=self.keep_outs(t, self.horizon + 1, self.dt),
        )

    def _predict(self, pose: Pose) -> Pose:
        """Return the predicted pose at the time at which the next command takes effect."""
        if self.actuation.delay > 0.0:
            first, *others = self._twists
            pose = move(pose, first, self.actuation.delay - len(others) * self.dt)
            for twist in others:
                pose = move(pose, twist, self.dt)
        return pose

    def fall_back(self, reason: str) -> Command:
        """Return a command along the latest plan, the slower the older it is, or zero twist."""
        self._age += 1
        plan, age, max_age = self.solution, self._age, OLD_PLAN_STEPS + RAMP_STEPS
        if plan is None or age > max_age or age >= len(plan.velocities):
            self._twists.append(STOP)
            self._final_twist = STOP
            return Command(STOP, Status.FAILED, self._details(FallbackLevel.STOP, None), reason)
        factor = min(1.0, (max_age - age + 1) / (RAMP_STEPS + 1))
        vx, vy, yaw_rate = self._planned_twist(plan, age)
        twist = self._compensate(BodyTwist(factor * vx, factor * vy, factor * yaw_rate))
        level = FallbackLevel.OLD_PLAN if factor == 1.0 else FallbackLevel.RAMP
        return Command(twist, Status.FALLBACK, self._details(level, None))

    def _planned_twist(self, plan: HolonomicSolution, stage: int) -> BodyTwist:
        """Return the constant body twist from the first to the last state of a stage."""
        start, end = plan.states[stage : stage + 2].tolist()
        return twist_between(Pose(*start), Pose(*end), self.dt)

    def _compensate(self, twist: BodyTwist) -> BodyTwist:
        """Return the commanded twist that moves the robot as ``twist`` would without lag and slip.

        ``twist`` is appended to the predicted twists.
        """
        before = self._twists[-1]
        self._twists.append(twist)
        if self.actuation.slip_model is not None:
            commanded, self._final_twist = self.actuation.slip_model.command(
                twist, self._final_twist, self.dt
            )
            return self.chassis.saturate(commanded)  # whose limit may be lower than the model's
        translation_gain, rotation_gain = (lag / self.dt for lag in self.actuation.lag)
        commanded = BodyTwist(
            twist.vx + translation_gain * (twist.vx - before.vx),
            twist.vy + translation_gain * (twist.vy - before.vy),
            twist.yaw_rate + rotation_gain * (twist.yaw_rate - before.yaw_rate),
        )
        return self.chassis.saturate(commanded)  # plans may exceed the limit from a fast start

    def _details(
        self, level: FallbackLevel, plan: HolonomicSolution | None
    ) -> tuple[float, float, float]:
        """Return the details, as in ``detail_units``; ``plan`` is None if there is no new plan."""
        if plan is None:
            return float(level), 0.0, np.nan
        return float(level), float(plan.iterations), plan.residual


def holonomic_nmpc(
    chassis: Chassis,
    dt: float,
    horizon: int = 15,
    *,
    parameters: HolonomicParameters | None = None,
    solver: SolverName | HolonomicOptimizer = "sqp",
    actuation: Actuation | None = None,
    keep_outs: KeepOutForecast | Sequence[KeepOutZone] = (),
) -> HolonomicController:
    """Return the NMPC of a holonomic robot with limited wheel speeds, with its kernels compiled.

    Args:
        chassis: The wheels and their maximum speed.
        dt: Sample time and length of a stage, in s.
        horizon: N, number of stages.
        parameters: Weights of the cost. None: the default weights.
        solver: ``sqp``: :class:`HolonomicSolver`, an active-set and an interior-point method;
            ``rti``: the same with at most :data:`RTI_ITERATIONS` iterations of each: plans satisfy
            all limits, but are not always optimal if one is active; ``casadi``: IPOPT; or a solver
            object, for example one with a deadline.
        actuation: Acceleration limits, lag, slip and delay. None: there are none of them.
        keep_outs: Keep-out zones that are the same in every step, or a function that returns the
            zones over the horizon.

    Raises:
        InvalidInput: An argument is outside its domain.
        MissingExtra: ``solver`` is ``casadi``, which is not installed.
    """
    if isinstance(solver, str):
        check_choice("solver", solver, _SOLVERS)
        solver = _SOLVERS[solver]()
    controller = HolonomicController(
        dt,
        horizon,
        parameters or HolonomicParameters(),
        chassis,
        actuation or Actuation(),
        solver,
        keep_outs if callable(keep_outs) else _fixed(keep_outs),
    )
    controller.prepare()
    return controller


def _fixed(zones: Sequence[KeepOutZone]) -> KeepOutForecast:
    return lambda t, points, dt: zones
