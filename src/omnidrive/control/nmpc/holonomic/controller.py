"""NMPC of holonomic robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from enum import IntEnum
from math import isfinite, isnan, nan, sqrt
from typing import Literal

import numpy as np

from omnidrive.compiled import entry_point
from omnidrive.control.controller import STOP, Command, Retiming, Status
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.nmpc.common.checks import check_settings
from omnidrive.control.nmpc.common.exit import CAPPED, CONVERGED, EXITS, Exit
from omnidrive.control.nmpc.holonomic.actuation import Actuation
from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt
from omnidrive.control.nmpc.holonomic.keep_out_zone import (
    KeepOutForecast,
    KeepOutZone,
    forecast_keep_outs,
    stack_keep_outs,
)
from omnidrive.control.nmpc.holonomic.motion_observer import (
    MotionMemory,
    ObservedMotion,
    motion_memory,
    observed_motion,
    remember,
)
from omnidrive.control.nmpc.holonomic.parameters import HolonomicParameters
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.reference_window import ReferenceWindow
from omnidrive.control.nmpc.holonomic.slip_model import SlipModel
from omnidrive.control.nmpc.holonomic.solution import HolonomicOptimizer, HolonomicSolution
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, HolonomicSolverSettings
from omnidrive.control.nmpc.holonomic.step import (
    Measurement,
    Plan,
    RobotModel,
    command_stage,
    fill_problem,
    observe,
    step,
)
from omnidrive.control.preparation import run_once
from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.control.reference_governor import ReferenceGovernor
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import check_choice
from omnidrive.reference import Reference
from omnidrive.robot import Chassis

SolverName = Literal["sqp", "rti", "casadi"]

RTI_ITERATIONS = 4
"""With the solver ``rti``: most iterations of the active-set and of the interior-point method."""
_SOLVERS: dict[SolverName, Callable[[], HolonomicOptimizer]] = {
    "sqp": HolonomicSolver,
    "rti": lambda: HolonomicSolver(HolonomicSolverSettings(max_iterations=RTI_ITERATIONS)),
    "casadi": HolonomicIpopt,
}

_LARGEST = 1e6
"""Largest speed (m/s, rad/s) and variance (m^2, rad^2) of a state that is not a fault."""
_NO_TWIST = (0.0, 0.0, 0.0)
_UNKNOWN_TWIST = (nan, nan, nan)
_UNKNOWN_VARIANCES = (-1.0, -1.0, -1.0)

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
    along an arc. If the reference stands and the robot cannot be there at once, the targets are
    those of the fastest motion on a straight line (:func:`~.approach.approach`), which passes the
    target in no coordinate. A reference that ends in motion is followed up to its end, behind which
    the robot stops.

    The first state and the twist before the first stage are those of the motion observer
    (:mod:`~.motion_observer`), which compares the measured poses with the motion that the earlier
    commands cause in the model of the robot, lag, slip and delay included. It estimates also a
    disturbance, the twist that the model lacks, and the variance of the noise of the measured
    poses where the state does not tell it. The commanded twist is the one with which the model
    makes the planned motion, minus the disturbance: constant disturbances and errors of the model
    leave no error of the pose (Maeder, Borrelli & Morari, "Linear offset-free model predictive
    control", Automatica 45, 2009). A twist in the state replaces the observed one.

    There is no warm start. If the solver finds no usable plan, the latest one is followed for a few
    steps, and then the robot is stopped. The details of a command contain its
    :class:`FallbackLevel`.

    Attributes:
        dt: Sample time and length of a stage, in s.
        horizon: N, number of stages.
        parameters: Weights of the cost.
        chassis: The wheels and their maximum speed.
        actuation: Response of the robot to commanded twists.
        solver: Solver of the optimal control problem.
        keep_outs: Keep-out zones over the horizon.
        governor: Delays references that the robot cannot follow in time. None: no governor.
    """

    dt: float
    horizon: int
    parameters: HolonomicParameters
    chassis: Chassis
    actuation: Actuation
    solver: HolonomicOptimizer
    keep_outs: KeepOutForecast
    governor: ReferenceGovernor | None = None
    _delay: float = field(default=0.0, init=False, repr=False)
    """Delay of the governed reference in the last step, s."""
    _solution: HolonomicSolution | None = field(default=None, init=False, repr=False)
    """The latest plan of another solver than the compiled one."""
    _age: int = field(default=-1, init=False)
    """Number of steps since the one that computed the latest plan; -1: there is none."""
    _time: float = field(default=nan, init=False)
    """Time of the last step, s; NaN: none."""
    _pose: Pose = field(default=Pose(nan, nan, nan), init=False, repr=False)
    """Pose in the last step."""
    _steady: bool = field(default=True, init=False)
    """Whether the last plan was none that approaches a standing target."""
    _robot: RobotModel = field(init=False, repr=False)
    _memory: MotionMemory = field(init=False, repr=False)
    _problem: HolonomicProblem = field(init=False, repr=False)
    _plan: Plan = field(init=False, repr=False)
    _window: ReferenceWindow = field(init=False, repr=False)
    _step: Callable[..., tuple[bool, bool, tuple[float, float, float]]] | None = field(
        default=None, init=False, repr=False
    )
    """Machine code of :func:`~.step.step`."""

    def __post_init__(self) -> None:
        check_settings(self.dt, self.horizon, self.parameters)
        actuation, stages = self.actuation, self.horizon
        limits, points = actuation.limits(self.chassis, self.dt), stages + 1
        model = actuation.slip_model
        faces = actuation.acceleration_faces
        self._robot = RobotModel(
            SlipModel.without_slip(self.chassis, actuation.lag) if model is None else model,
            np.ascontiguousarray(self.chassis.jacobian, dtype=float),
            np.empty((0, 3)) if faces is None else np.ascontiguousarray(faces, dtype=float),
            float(self.chassis.max_wheel_speed),
            float(actuation.delay),
        )
        self._memory = motion_memory(int(actuation.delay / self.dt))
        self._problem = HolonomicProblem(
            float(self.dt),
            np.zeros(3),
            np.zeros(3),
            np.zeros((points, 3)),
            np.zeros((stages, 3)),
            self.parameters.state_weights(points, self.dt),
            self.parameters.control_weights(),
            limits,
            stack_keep_outs((), points),
        )
        rows = len(limits.bounds)
        self._plan = Plan(
            np.zeros((stages, 3)), np.zeros((points, 3)), np.zeros((stages, rows)), np.zeros(5)
        )
        self._window = ReferenceWindow(points, self.dt)

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Names and units of the details of a command.

        ``fallback_level`` is a :class:`FallbackLevel`. Without a new plan ``solver_iterations`` is
        0 and ``kkt_residual`` is NaN. ``disturbance_...`` is the estimated twist, along the axes of
        B, that is missing in the motion which the commands cause in the model; ``pose_noise`` is
        the standard deviation of the measured positions, estimated from the innovations;
        ``reference_delay`` is the delay of the governed reference.
        """
        return {
            "fallback_level": "1",
            "solver_iterations": "1",
            "kkt_residual": "1",
            "disturbance_vx": "m/s",
            "disturbance_vy": "m/s",
            "disturbance_yaw_rate": "rad/s",
            "pose_noise": "m",
            "reference_delay": "s",
        }

    @property
    def solution(self) -> HolonomicSolution | None:
        """The latest plan; None if there is none since ``reset``."""
        if self._age < 0 or self._solution is not None:
            return self._solution
        velocities, states, multipliers, figures = (each.copy() for each in self._plan)
        cost, residual, violation, iterations, code = figures.tolist()
        return HolonomicSolution(
            velocities,
            states,
            multipliers,
            cost,
            residual,
            violation,
            int(iterations),
            EXITS[int(code)],
        )

    @property
    def motion(self) -> ObservedMotion:
        """Estimates of the motion observer at the last step."""
        return observed_motion(self._memory)

    def reset(self, state: State) -> None:
        """Clear the latest plan and the observed motion; the robot is at rest."""
        self._delay = 0.0
        if self.governor is not None:
            self.governor.reset()
        self._solution, self._age, self._time, self._steady = None, -1, nan, True
        self._pose = Pose(nan, nan, nan)
        self._window = ReferenceWindow(self.horizon + 1, self.dt)
        for each in self._memory:
            each[:] = 0.0

    def prepare(self) -> None:
        """Compile the kernels of a step, also those that a deadline could skip in the first one."""
        if self.governor is not None:
            self.governor.prepare()
        run_once(self)
        if isinstance(self.solver, HolonomicSolver) and self.solver.deadline is not None:
            self.solver.precompile(self._problem)

    def retime(self, reference: Reference) -> Retiming:
        """Return the governed reference."""
        if self.governor is None:
            return Retiming(reference)
        return self.governor.retime(reference)

    def with_reduced_drive(self, drive: ReducedDrive) -> HolonomicController:
        """Return a controller in the same state that plans with the wheels that still drive."""
        actuation = self.actuation.with_reduced_drive(drive)
        other = replace(self, chassis=drive.chassis, actuation=actuation)
        other._copy_state(self)
        return other

    def _copy_state(self, other: HolonomicController) -> None:
        """Take over what another controller of the same sample time and horizon remembers."""
        self._solution, self._age, self._steady = other._solution, other._age, other._steady
        self._time, self._pose, self._window = other._time, other._pose, copy(other._window)
        for ours, theirs in zip(self._memory, other._memory, strict=True):
            ours[:] = theirs
        for ours, theirs in zip(self._plan, other._plan, strict=True):
            if ours.shape == theirs.shape:  # the multipliers of fewer wheels are others
                ours[:] = theirs

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s)."""
        if self.governor is not None:
            reference = self.governor.govern(reference)
            self._delay = self.governor.delay(t)
        now, begin = self._measurement(t, state), t + self.actuation.delay
        zones = self.keep_outs(begin, self.horizon + 1, self.dt)
        if zones or len(self._problem.keep_outs.radii):
            self._problem = self._problem._replace(
                keep_outs=stack_keep_outs(zones, self.horizon + 1)
            )
        first = self._window.find(begin, reference)
        last = self._window.last(begin, reference)
        solver = self.solver
        if isinstance(solver, HolonomicSolver) and solver.deadline is None:
            arguments = (
                self._robot,
                self._memory,
                now,
                self._problem,
                self._plan,
                self._window.rows,
                first,
                last,
                self._steady,
                *solver.settings,
            )
            if self._step is None:
                self._step = entry_point(step, *arguments)
            usable, approaching, value = self._step(*arguments)
        else:
            usable, approaching, value = self._step_with(solver, now, first, last)
        self._steady = not approaching
        if not usable:
            return self._follow("no usable solution")
        self._age = 0
        converged = self._plan.figures[4] == CONVERGED
        level = FallbackLevel.CONVERGED if converged else FallbackLevel.FEASIBLE
        status = Status.OK if converged else Status.FALLBACK
        return Command(BodyTwist(*value), status, self._details(level, new=True))

    def _measurement(self, t: float, state: State) -> Measurement:
        """Return what a step measures, and remember it."""
        elapsed, self._time = t - self._time, t
        pose, twist, variances = state.pose, _UNKNOWN_TWIST, _UNKNOWN_VARIANCES
        fresh = state.fix_age <= 0.0 or pose != self._pose
        self._pose = pose
        if state.covariance is not None:
            (xx, _, _), (_, yy, _), (_, _, yaw) = state.covariance.tolist()
            if 0.0 <= xx <= _LARGEST and 0.0 <= yy <= _LARGEST and 0.0 <= yaw <= _LARGEST:
                variances = (xx, yy, yaw)
        if state.twist is not None and all(abs(each) <= _LARGEST for each in state.twist):
            vx, vy, yaw_rate = state.twist
            twist = (float(vx), float(vy), float(yaw_rate))
        x, y, heading = pose
        return Measurement(elapsed, (float(x), float(y), float(heading)), twist, variances, fresh)

    def _step_with(
        self, solver: HolonomicOptimizer, now: Measurement, first: int, last: int
    ) -> tuple[bool, bool, tuple[float, float, float]]:
        """Do the same as :func:`~.step.step` with any solver."""
        robot, memory, problem, plan = self._robot, self._memory, self._problem, self._plan
        observe(robot, memory, now, self.dt, self._steady)
        approaching = fill_problem(robot, memory, problem, self._window.rows, first, last)
        usable = isfinite(problem.start.sum() + problem.targets.sum())
        solution = solver.solve(problem) if usable else None
        if solution is None or solution.exit is Exit.UNUSABLE:
            return False, approaching, _NO_TWIST
        self._solution = solution
        plan.velocities[:], plan.states[:] = solution.velocities, solution.states
        code = CONVERGED if solution.exit is Exit.CONVERGED else CAPPED
        plan.figures[:] = (
            solution.cost,
            solution.residual,
            solution.violation,
            solution.iterations,
            code,
        )
        return True, approaching, command_stage(robot, memory, plan, 0, 1.0, self.dt)

    def fall_back(self, reason: str) -> Command:
        """Return a command along the latest plan, the slower the older it is, or zero twist.

        The motion observer predicts the motion since the last step, without a measurement.
        """
        if not isnan(self._time):
            self._time += self.dt
            pose = self._memory.pose
            unknown = Measurement(
                self.dt, tuple(pose.tolist()), _UNKNOWN_TWIST, _UNKNOWN_VARIANCES, False
            )
            observe(self._robot, self._memory, unknown, self.dt, False)
        return self._follow(reason)

    def _follow(self, reason: str) -> Command:
        """Return a command along the latest plan, for a step without a new one."""
        age, max_age = self._age + 1 if self._age >= 0 else -1, OLD_PLAN_STEPS + RAMP_STEPS
        self._age = age
        if not 0 <= age <= max_age or age >= self.horizon:
            remember(self._memory, _NO_TWIST)
            details = self._details(FallbackLevel.STOP, new=False)
            return Command(STOP, Status.FAILED, details, reason)
        factor = min(1.0, (max_age - age + 1) / (RAMP_STEPS + 1))
        value = command_stage(self._robot, self._memory, self._plan, age, factor, self.dt)
        level = FallbackLevel.OLD_PLAN if factor == 1.0 else FallbackLevel.RAMP
        return Command(BodyTwist(*value), Status.FALLBACK, self._details(level, new=False))

    def _details(self, level: FallbackLevel, *, new: bool) -> tuple[float, ...]:
        """Return the details, as in ``detail_units``, of a step with a new plan or without."""
        _, residual, _, iterations, _ = self._plan.figures.tolist()
        memory = self._memory
        noise = sqrt(max(float(memory.noise[0]), 0.0))
        plan = (iterations, residual) if new else (0.0, nan)
        return (float(level), *plan, *memory.disturbance.tolist(), noise, self._delay)


def holonomic_nmpc(
    chassis: Chassis,
    dt: float,
    horizon: int = 15,
    *,
    parameters: HolonomicParameters | None = None,
    solver: SolverName | HolonomicOptimizer = "sqp",
    actuation: Actuation | None = None,
    keep_outs: KeepOutForecast | Sequence[KeepOutZone] = (),
    governor: bool = True,
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
        governor: Whether the robot stays on the path of a reference that it cannot follow in time,
            and arrives later, see :class:`~omnidrive.control.ReferenceGovernor`.

    Raises:
        InvalidInput: An argument is outside its domain.
        MissingExtra: ``solver`` is ``casadi``, which is not installed.
    """
    if isinstance(solver, str):
        check_choice("solver", solver, _SOLVERS)
        solver = _SOLVERS[solver]()
    actuation = actuation or Actuation()
    controller = HolonomicController(
        dt,
        horizon,
        parameters or HolonomicParameters(),
        chassis,
        actuation,
        solver,
        forecast_keep_outs(keep_outs),
        ReferenceGovernor(chassis, actuation.acceleration_faces) if governor else None,
    )
    controller.prepare()
    return controller
