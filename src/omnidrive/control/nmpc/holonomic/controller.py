"""NMPC of holonomic robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from math import inf, isfinite, nan

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import CompiledFunction, entry_point
from omnidrive.control.compiled_law import (
    UNKNOWN_TWIST,
    UNKNOWN_VARIANCES,
    CompiledLaw,
    SampleState,
    SetpointWindow,
    leaves,
)
from omnidrive.control.controller import Command, Retiming, Status
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.nmpc.common.checks import check_settings
from omnidrive.control.nmpc.common.exit import CAPPED, CONVERGED, EXITS, Exit
from omnidrive.control.nmpc.holonomic.actuation import Actuation
from omnidrive.control.nmpc.holonomic.keep_out_zone import (
    FixedKeepOuts,
    KeepOutForecast,
    stack_keep_outs,
)
from omnidrive.control.nmpc.holonomic.law import (
    CalledLaw,
    LawData,
    LawMemory,
    begin,
    call_law,
    finish,
    latest_velocities,
    law,
    law_memory,
    stage_problem,
)
from omnidrive.control.nmpc.holonomic.parameters import HolonomicParameters
from omnidrive.control.nmpc.holonomic.solution import HolonomicOptimizer, HolonomicSolution
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, HolonomicSolverSettings
from omnidrive.control.preparation import run_once
from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.control.reference_governor import ReferenceGovernor
from omnidrive.control.reference_window import ReferenceWindow
from omnidrive.estimation import State
from omnidrive.estimation.drive.drive_identification import START, DriveSample, identify
from omnidrive.estimation.drive.identification_state import command_count, identification_memory
from omnidrive.estimation.drive_estimate import (
    DELAYS,
    DRIVE_UNITS,
    DriveEstimate,
    DriveSettings,
    check_start,
    drive_estimate,
)
from omnidrive.estimation.motion.caution import max_gain
from omnidrive.estimation.motion.motion_memory import (
    ObservedMotion,
    observed_motion,
)
from omnidrive.estimation.motion.robot_model import RobotModel
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference
from omnidrive.robot import Chassis
from omnidrive.robot.drive_model import DriveModel

_LARGEST = 1e6
"""Largest speed (m/s, rad/s) and variance (m^2, rad^2) of a state that is not a fault."""
_STATUSES = tuple(Status)


@dataclass(slots=True)
class HolonomicController(GuardedController):
    """A :class:`~omnidrive.control.Controller` that solves a :class:`HolonomicProblem` every step.

    The target of every state is the reference's pose at that time. The feedforward velocity of a
    stage is the difference of its two targets over ``dt``, so that a robot on the reference stays
    on it. The planned twist of a stage is the constant body twist from its first to its last state,
    along an arc. If the reference stands and the robot cannot be there at once, the targets are
    those of the fastest motion on a straight line, which passes the target in no coordinate; see
    :func:`~.minimum_time_targets.minimum_time_targets`. A reference that ends in motion is followed
    up to its end, behind which the robot stops.

    The first state and the twist before the first stage are those of the motion observer
    (:mod:`~omnidrive.estimation.motion.motion_observer`), which compares the measured poses with
    the motion that the earlier commands cause in the model of the robot, lag, slip and delay
    included. It estimates also a disturbance, the twist that the model lacks, and the variance of
    the noise of the measured poses where the state does not tell it. The commanded twist is the one
    with which the model makes the planned motion, minus the disturbance: constant disturbances and
    errors of the model leave no error of the pose (Maeder, Borrelli & Morari, "Linear offset-free
    model predictive control", Automatica 45, 2009). A twist in the state replaces the observed one.

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
        adaptation: Bounds and forgetting of the identification of the drive. None: gains, lag and
            delay are those of ``actuation``.
    """

    dt: float
    horizon: int
    parameters: HolonomicParameters
    chassis: Chassis
    actuation: Actuation
    solver: HolonomicOptimizer
    keep_outs: KeepOutForecast
    governor: ReferenceGovernor | None = None
    adaptation: DriveSettings | None = None
    _delay: float = field(default=0.0, init=False, repr=False)
    """Delay of the governed reference in the last step, s."""
    _solution: HolonomicSolution | None = field(default=None, init=False, repr=False)
    """The latest plan of another solver than the compiled one."""
    _data: LawData = field(init=False, repr=False)
    _stacked: FixedKeepOuts | None = field(default=None, init=False, repr=False)
    """The zones of ``_data`` if they are the same in all steps."""
    _memory: LawMemory = field(init=False, repr=False)
    _outputs: tuple[Float[Array, " 3"], Float[Array, " details"]] = field(init=False, repr=False)
    """Command and details of a step."""
    _window: ReferenceWindow = field(init=False, repr=False)
    _law: Callable[..., int] | None = field(default=None, init=False, repr=False)
    """Machine code of :func:`~.law.law`."""

    def __post_init__(self) -> None:
        check_settings(self.dt, self.horizon, self.parameters)
        actuation, stages = self.actuation, self.horizon
        limits, points = actuation.limits(self.chassis, self.dt), stages + 1
        model = actuation.slip_model
        faces = actuation.acceleration_faces
        if model is None:
            model = DriveModel.without_slip(self.chassis, actuation.lag)
        commands = command_count(actuation.delay, self.dt)
        identified = identification_memory(0 if self.adaptation is None else commands)
        self._memory = law_memory(stages, len(limits.bounds), commands, identified)
        robot = RobotModel(
            model,
            np.ascontiguousarray(self.chassis.jacobian, dtype=float),
            np.empty((0, 3)) if faces is None else np.ascontiguousarray(faces, dtype=float),
            float(self.chassis.max_wheel_speed),
            actuation.drive.parameters,
            self._identify(model),
            self.adaptation or DriveSettings(),
        )
        self._data = LawData(
            robot,
            float(self.dt),
            self.parameters.state_weights(points, self.dt),
            self.parameters.with_gain_limit(max_gain(self.dt), self.dt).state_weights(
                points, self.dt
            ),
            self.parameters.control_weights(),
            limits,
            stack_keep_outs((), points),
            limits._replace(
                bounds=actuation.limits(self.chassis, self.dt, actuation.reserve).bounds
            ),  # the matrices are the same
            HolonomicSolverSettings(),
            actuation.reserve,
            actuation.may_spin,
        )
        self._outputs = np.zeros(3), np.zeros(len(self.detail_units))
        self._window = self._new_window()

    def _identify(self, model: DriveModel) -> CompiledFunction | None:
        """Return the identification of the drive as machine code; None: there is none."""
        settings = self.adaptation
        if settings is None:
            return None
        known, memory = self.actuation.drive, self._memory.motion.identified
        check_start(settings, known)
        zero = (0.0, 0.0, 0.0)
        sample = DriveSample(zero, 0.0, zero, zero, zero, False)
        return CompiledFunction(identify, START, model, settings, known.parameters, memory, sample)

    def _new_window(self) -> ReferenceWindow:
        """Return a window that also covers the longest delay that can be identified."""
        return ReferenceWindow(self.horizon + DELAYS, self.dt)

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Names and units of the details of a command.

        ``fallback_level`` is a :class:`FallbackLevel`. Without a new plan ``solver_iterations`` is
        0 and ``kkt_residual`` is NaN. ``disturbance_...`` is the estimated twist, along the axes of
        B, that is missing in the motion which the commands cause in the model; ``pose_noise`` is
        the standard deviation of the measured positions, estimated from the innovations;
        ``reference_delay`` is the delay of the governed reference. With ``adaptation`` the
        identified parameters follow, with their standard errors:
        :data:`~omnidrive.estimation.drive_estimate.DRIVE_UNITS`.
        """
        units = {
            "fallback_level": "1",
            "solver_iterations": "1",
            "kkt_residual": "1",
            "disturbance_vx": "m/s",
            "disturbance_vy": "m/s",
            "disturbance_yaw_rate": "rad/s",
            "pose_noise": "m",
            "reference_delay": "s",
        }
        return units if self.adaptation is None else {**units, **DRIVE_UNITS}

    @property
    def solution(self) -> HolonomicSolution | None:
        """The latest plan; None if there is none since ``reset``."""
        if not self._memory.last["plan_steps"][0] or self._solution is not None:
            return self._solution
        velocities, states, multipliers, figures = (each.copy() for each in self._memory.plan)
        cost, residual, violation = (
            float(figures[name][0]) for name in ("cost", "residual", "violation")
        )
        iterations, code = int(figures["iterations"][0]), int(figures["exit"][0])
        return HolonomicSolution(
            velocities, states, multipliers, cost, residual, violation, iterations, EXITS[code]
        )

    @property
    def drive(self) -> DriveEstimate:
        """Identified gains, lag and delay of the drive at the last step."""
        if self.adaptation is None or not self._memory.last["started"][0]:
            return self.actuation.drive
        return drive_estimate(self._memory.motion.identified.state["estimate"][0])

    @property
    def motion(self) -> ObservedMotion:
        """Estimates of the motion observer at the last step."""
        return observed_motion(self._memory.motion)

    def reset(self, state: State) -> None:
        """Clear the latest plan and the observed motion; the robot is at rest."""
        self._delay = 0.0
        if self.governor is not None:
            self.governor.reset()
        self._solution = None
        self._window = self._new_window()
        for each in leaves(self._memory):
            each[...] = 0.0

    def prepare(self) -> None:
        """Compile the kernels of a step, also those that a deadline could skip in the first one."""
        if self.governor is not None:
            self.governor.prepare()
        run_once(self)
        if isinstance(self.solver, HolonomicSolver) and self.solver.deadline is not None:
            self.solver.precompile(stage_problem(self._data, self._memory))

    def retime(self, reference: Reference) -> Retiming:
        """Return the governed reference."""
        if self.governor is None:
            return Retiming(reference)
        return self.governor.retime(reference)

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law for compiled loops.

        None: a solver of another class, one with a deadline, or keep-out zones that may move.
        """
        solver, zones = self.solver, self.keep_outs
        if type(solver) is not HolonomicSolver or solver.deadline is not None:
            return None
        if not isinstance(zones, FixedKeepOuts):
            return None
        points, memory = self._window.points, self._memory
        keep_outs = stack_keep_outs(zones.zones, self.horizon + 1)
        data = self._data._replace(keep_outs=keep_outs, settings=solver.settings)
        now = SampleState(0.0, (0.0, 0.0, 0.0), UNKNOWN_TWIST, UNKNOWN_VARIANCES, 0.0, 0.0, 0)
        examples = (data, memory, now, np.zeros((points, 6)), *self._outputs)
        function = CompiledFunction(law, *examples)
        window = SetpointWindow(self.actuation.delay, points, self.dt, ahead=True)
        return CompiledLaw(call_law, CalledLaw(function, data), memory, window)

    def with_reduced_drive(self, drive: ReducedDrive) -> HolonomicController:
        """Return a controller in the same state that plans with the wheels that still drive."""
        actuation = self.actuation.with_reduced_drive(drive)
        other = replace(self, chassis=drive.chassis, actuation=actuation)
        other._copy_state(self)
        return other

    def _copy_state(self, other: HolonomicController) -> None:
        """Take over the memory of another controller of the same sample time and horizon."""
        self._solution, self._window = other._solution, copy(other._window)
        for ours, theirs in zip(leaves(self._memory), leaves(other._memory), strict=True):
            if ours.shape == theirs.shape:  # the multipliers of fewer wheels are others
                ours[...] = theirs

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s)."""
        if self.governor is not None:
            self._delay = self.governor.delay(reference, t)
            reference = self.governor.govern(reference)
        begin = t + self.actuation.delay
        if self.keep_outs is not self._stacked:
            self._stack_keep_outs(begin)
        first, last = self._window.find(begin, reference)
        setpoints = self._window.rows[first : first + self._window.points]
        return self._command(self._sample(t, state, last), setpoints, "no usable solution")

    def _stack_keep_outs(self, begin: float) -> None:
        """Use the keep-out zones over the horizon; fixed ones are those of all later steps.

        ``begin`` (s) is the time at which a command takes effect after the known delay.
        """
        later = max(
            float(self._memory.motion.state["drive"]["delay"][0]) - self.actuation.delay, 0.0
        )
        points = self.horizon + 1
        zones = self.keep_outs(begin + later, points, self.dt)
        if zones or len(self._data.keep_outs.radii):
            self._data = self._data._replace(keep_outs=stack_keep_outs(zones, points))
        self._stacked = self.keep_outs if isinstance(self.keep_outs, FixedKeepOuts) else None

    def _sample(self, t: float, state: State, last: int) -> SampleState:
        """Return what the law uses of a state."""
        twist, variances = UNKNOWN_TWIST, UNKNOWN_VARIANCES
        if state.covariance is not None:
            (xx, _, _), (_, yy, _), (_, _, yaw) = state.covariance.tolist()
            if 0.0 <= xx <= _LARGEST and 0.0 <= yy <= _LARGEST and 0.0 <= yaw <= _LARGEST:
                variances = (xx, yy, yaw)
        if state.twist is not None and all(abs(each) <= _LARGEST for each in state.twist):
            vx, vy, yaw_rate = state.twist
            twist = (float(vx), float(vy), float(yaw_rate))
        x, y, heading = state.pose
        pose = (float(x), float(y), float(heading))
        age = float(state.fix_age)
        return SampleState(float(t), pose, twist, variances, age, self._delay, last)

    def fall_back(self, reason: str) -> Command:
        """Return a command along the latest plan, the slower the older it is, or zero twist.

        The motion observer predicts the motion since the last step, without a measurement.
        """
        unknown_pose = (nan, nan, nan)
        no_measurement = SampleState(
            nan, unknown_pose, UNKNOWN_TWIST, UNKNOWN_VARIANCES, inf, self._delay, 0
        )
        return self._command(no_measurement, self._window.rows[: self._window.points], reason)

    def _command(
        self, now: SampleState, setpoints: Float[Array, "points 6"], reason: str
    ) -> Command:
        """Return the command of the law; its message is the reason if there is none."""
        solver = self.solver
        if isinstance(solver, HolonomicSolver) and solver.deadline is None:
            if self._data.settings is not solver.settings:
                self._data = self._data._replace(settings=solver.settings)
            arguments = (self._data, self._memory, now, setpoints, *self._outputs)
            if self._law is None:
                self._law = entry_point(law, *arguments)
            code = self._law(*arguments)
        else:
            code = self._law_with(solver, now, setpoints)
        value, details = self._outputs
        status = _STATUSES[code]
        message = reason if status is Status.FAILED else ""
        return Command(BodyTwist(*value.tolist()), status, tuple(details.tolist()), message)

    def _law_with(
        self, solver: HolonomicOptimizer, now: SampleState, setpoints: Float[Array, "points 6"]
    ) -> int:
        """Do the same as :func:`~.law.law` with any solver."""
        data, memory = self._data, self._memory
        usable = begin(data, memory, now, setpoints)
        problem = stage_problem(data, memory)
        usable = usable and isfinite(problem.start.sum() + problem.targets.sum())
        solution = None
        if usable and isinstance(solver, HolonomicSolver):
            solution = solver.solve(problem, latest_velocities(memory))
        elif usable:
            solution = solver.solve(problem)
        solved = solution is not None and solution.exit is not Exit.UNUSABLE
        if solution is not None and solved:
            self._solution, plan = solution, memory.plan
            plan.velocities[:], plan.states[:] = solution.velocities, solution.states
            for name in ("cost", "residual", "violation", "iterations"):
                plan.figures[name] = getattr(solution, name)
            plan.figures["exit"] = CONVERGED if solution.exit is Exit.CONVERGED else CAPPED
        return finish(data, memory, solved, now.delay, *self._outputs)
