"""The pipeline from sensor readings to the command, the same in simulation and on a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, nan
from time import get_clock_info, perf_counter, perf_counter_ns, thread_time_ns
from typing import Literal, NamedTuple

from omnidrive.control.command_check import checked_command
from omnidrive.control.controller import (
    STOP,
    Command,
    Controller,
    DetailedController,
    PreparableController,
    Retiming,
    RetimingController,
    Status,
    WheelSpeeds,
    WheelTorques,
    failed_command,
)
from omnidrive.control.supervision import NullSupervisor, Supervisor
from omnidrive.control.time_limit import TimedOut, TimeLimit
from omnidrive.errors import PART_ERRORS, failure_reason, kind_of, traceback_text
from omnidrive.estimation import LatestFix, SensorReadings, State, StateEstimator
from omnidrive.estimation.state import check_start, is_usable_number, state_fault
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Reference

# a thread's own time is not disturbed by other processes; some systems count it too coarsely
_clock = thread_time_ns if get_clock_info("thread_time").resolution < 1e-6 else perf_counter_ns

STEP_TIMEOUT = 30.0
"""Wall-clock time, s, after which a call of ``Controller.step`` counts as stalled: so long that no
result depends on the speed of the computer. The first call of a run, which may compile, has ten
times as long."""
COMMAND_TIMEOUT = 0.5
"""Age, s, up to which the last command of a stalled controller is held, as ``cmd_vel_timeout`` of
ros2_controllers."""
RAMP_TIME = 0.5
"""Time, s, in which a command that is too old decreases to zero."""

Part = Literal["reference", "estimator", "supervisor", "controller"]


class PipelineStep(NamedTuple):
    """Result of one sample."""

    state: State
    """Estimate at the sample; the last usable one if that at the sample is not usable."""
    target: Pose
    """Reference pose at the sample, in W; m, m, rad."""
    command: Command
    """Command to send; its status is ``FAILED`` if a part failed, and the robot must stop."""
    step_time: float = nan
    """Computing time of ``Controller.step`` in its thread, us; NaN if it was not called."""
    failed: Part | None = None
    """The part that failed; the first line of ``command.message`` is the reason."""


class _Retimed(NamedTuple):
    """A reference and the motion that the controller tracks instead."""

    reference: Reference
    retiming: Retiming


@dataclass(slots=True)
class Pipeline:
    """Estimator, supervisor and controller in series: one call per sample.

    An exception or an invalid result of a part is reported in the returned step and not raised, so
    that the caller can stop the robot.

    An estimate that is not usable (:attr:`~omnidrive.estimation.State.is_usable`) is a lost
    measurement: the last usable one is kept and its age grows, and commands computed from it have
    the status ``FALLBACK`` at best.

    A controller whose step takes longer than :data:`STEP_TIMEOUT` is not called again in the run.
    Its last command is held up to an age of :data:`COMMAND_TIMEOUT`, then ramped to zero in
    :data:`RAMP_TIME`; then the controller has failed.

    Attributes:
        controller: Computes the command.
        estimator: Computes the state from the readings; by default the latest pose fix.
        supervisor: Checks the state and limits the command; by default no supervisor.
        detail_units: Name and unit of each detail of the controller's commands, from ``reset`` on.
    """

    controller: Controller
    estimator: StateEstimator = field(default_factory=LatestFix)
    supervisor: Supervisor = field(default_factory=NullSupervisor)
    detail_units: Mapping[str, str] = field(default_factory=dict, init=False)
    _previous: Command = field(default=Command(STOP), init=False, repr=False)
    """Command computed in the previous sample."""
    _estimate: State = field(default=State(0.0, Pose(nan, nan, nan)), init=False, repr=False)
    """Last usable estimate."""
    _state: State = field(default=State(0.0, Pose(nan, nan, nan)), init=False, repr=False)
    """State for the controller."""
    _computed: tuple[float, Command] | None = field(default=None, init=False, repr=False)
    """Time (s) and value of the last command of the controller."""
    _retiming: _Retimed | None = field(default=None, init=False, repr=False)
    """The latest reference, and what is tracked instead."""
    _stalled: str = field(default="", init=False, repr=False)
    """Description of the step that took too long; empty: none."""

    def prepare(self) -> None:
        """Prepare the controller if it is a :class:`PreparableController`."""
        if isinstance(self.controller, PreparableController):
            self.controller.prepare()

    def reset(self, pose: Pose) -> None:
        """Start a run at rest at ``pose``, which is known exactly.

        Raises:
            InvalidInput: The pose is not usable.
            PartFailed: A part stalls, or raises an exception, which is the cause.
        """
        check_start(pose)
        self._estimate = self._state = State(0.0, pose)
        self._previous, self._computed, self._stalled = Command(STOP), None, ""
        self.detail_units, self._retiming = {}, None
        part: Part = "estimator"
        seconds = 40.0 * STEP_TIMEOUT  # the parts may compile kernels
        try:
            with TimeLimit(seconds):
                self.estimator.reset(pose)
                part = "controller"
                self.controller.reset(self._state)
                part = "supervisor"
                self.supervisor.reset(self.controller)
                part = "controller"
                if isinstance(self.controller, DetailedController):
                    self.detail_units = _checked_units(self.controller.detail_units)
        except TimedOut:
            raise PartFailed(part, f"its reset took longer than {seconds:g} s") from None
        except PART_ERRORS as error:
            raise PartFailed(part, _report(error)) from error

    def retime(self, reference: Reference) -> Retiming:
        """Return the motion that the controller tracks instead of ``reference``."""
        if self._retiming is None or self._retiming.reference is not reference:
            retiming = Retiming(reference)
            if isinstance(self.controller, RetimingController):
                retiming = self.controller.retime(reference)
                if not (
                    isinstance(retiming, Retiming)
                    and isinstance(retiming.reference, Reference)
                    and isinstance(retiming.notice, str)
                ):
                    raise TypeError(f"retime must return a Retiming, not {kind_of(retiming)}")
            self._retiming = _Retimed(reference, retiming)
        return self._retiming.retiming

    def observe(self, t: float, readings: SensorReadings, reference: Reference) -> PipelineStep:
        """Estimate and check the state at ``t`` (s) without a command, as at the end of a run.

        The status of the returned command is ``FALLBACK`` if the estimate is not usable.
        """
        part: Part = "reference"
        target = self._state.pose
        seconds = 4.0 * STEP_TIMEOUT  # the estimator may compile kernels
        try:
            with TimeLimit(seconds):
                target = due = _target(reference, t)
                part = "controller"
                tracked = self.retime(reference).reference
                if tracked is not reference:
                    due = _target(tracked, t)
                part = "estimator"
                state, status = self._update(t, readings)
                part = "supervisor"
                self._state = self.supervisor.check(t, readings, state, due)
        except TimedOut:
            reason = f"its call at {t:g} s took longer than {seconds:g} s"
            return self._failure(part, target, reason)
        except _Malformed as error:
            return self._failure(part, target, str(error))
        except PART_ERRORS as error:
            return self._failure(part, target, _report(error))
        return PipelineStep(state, target, Command(STOP, status))

    def step(
        self,
        t: float,
        readings: SensorReadings,
        reference: Reference,
        dt: float,
        *,
        late: bool = False,
    ) -> PipelineStep:
        """Estimate the state at ``t`` (s) and compute the command for the next ``dt`` seconds.

        Args:
            t: Time of the sample, s.
            readings: Readings up to ``t``.
            reference: The motion to track.
            dt: Time until the next sample, s.
            late: Whether the new command is not ready in time, so that the one computed in the
                previous sample is sent.
        """
        observed = self.observe(t, readings, reference)
        if observed.failed:
            return observed
        command, step_time = observed.command, nan
        if self.supervisor.stopped is None:
            command, step_time = self._compute(t, reference)
            if command.status < observed.command.status:
                command = command._replace(status=observed.command.status)
        command, self._previous = (self._previous if late else command), command
        if command.status is Status.FAILED:
            return PipelineStep(observed.state, observed.target, command, step_time, "controller")
        try:
            command = self.supervisor.limit(command, dt)
        except PART_ERRORS as error:
            return self._failure("supervisor", observed.target, _report(error))
        return PipelineStep(observed.state, observed.target, command, step_time)

    def _update(self, t: float, readings: SensorReadings) -> tuple[State, Status]:
        """Return the estimate at ``t`` (s), or the last usable one and the status ``FALLBACK``."""
        state, last = self.estimator.update(readings), self._estimate
        fault = state_fault(state)
        if fault is not None:
            raise _Malformed(fault)
        if state.is_usable:
            self._estimate = state
            return state, Status.OK
        age = last.fix_age + t - last.stamp
        self._estimate = last._replace(stamp=t, fix_age=age, notice="")
        return self._estimate, Status.FALLBACK

    def _compute(self, t: float, reference: Reference) -> tuple[Command, float]:
        """Return the command of the controller and its computing time, us."""
        if self._stalled:
            return self._aged_command(t), nan
        controller = self.supervisor.controller or self.controller
        step_time, begin = nan, perf_counter()
        seconds = STEP_TIMEOUT if self._computed else 10.0 * STEP_TIMEOUT
        try:
            with TimeLimit(seconds) as limit:
                start = _clock()
                command = controller.step(t, self._state, reference)
                step_time = (_clock() - start) * 1e-3
            in_time = limit.armed or perf_counter() - begin < seconds
        except TimedOut:
            in_time = False
        except PART_ERRORS as error:
            return failed_command(_report(error)), nan
        if not in_time:
            self._stalled = f"its step at {t:g} s took longer than {seconds:g} s"
            return self._aged_command(t), step_time
        checked = checked_command(command, len(self.detail_units) or None)
        self._computed = t, checked
        return checked, step_time

    def _aged_command(self, t: float) -> Command:
        """Return the last command of a stalled controller at ``t`` (s), which is ramped to zero.

        Torques, which do not decrease a speed with their size, are followed by a zero twist.
        """
        computed, last = self._computed or (t, Command(STOP))
        excess = round(t - computed - COMMAND_TIMEOUT, 9)  # times have rounding errors
        share = min(1.0, 1.0 - excess / RAMP_TIME)
        if share <= 0.0 or last.value == STOP:
            return failed_command(self._stalled)
        value = last.value
        if share < 1.0:
            value = STOP if isinstance(value, WheelTorques) else _scaled(value, share)
        return Command(value, Status.FALLBACK)

    def _failure(self, part: Part, target: Pose, message: str) -> PipelineStep:
        """Return the step of a sample in which a part other than the controller failed."""
        return PipelineStep(self._state, target, failed_command(message), nan, part)


class PartFailed(Exception):
    """A part of a pipeline raised an exception or stalled at the start of a run.

    Attributes:
        part: The part.
        message: Reason in the first line; below it the traceback of an exception.
    """

    def __init__(self, part: Part, message: str) -> None:
        super().__init__(f"the {part} failed:\n{message}")
        self.part, self.message = part, message


class _Malformed(Exception):
    """A part returned something other than its interface states; the message says what."""


def _target(reference: Reference, t: float) -> Pose:
    """Return the pose of the reference at ``t`` (s); raise _Malformed if one is not usable."""
    if not is_usable_number(t):
        raise _Malformed(f"the time of the sample is not usable: {t:g} s")
    target = reference.at(t).pose
    if not isinstance(target, Pose):
        raise _Malformed(f"its setpoint holds {kind_of(target)}, not a Pose")
    if not all(map(isfinite, target)):
        raise _Malformed(f"its pose at {t:g} s is not finite: {target}")
    return target


def _scaled(value: BodyTwist | WheelSpeeds, share: float) -> BodyTwist | WheelSpeeds:
    numbers = [share * number for number in value]
    return WheelSpeeds(numbers) if isinstance(value, WheelSpeeds) else BodyTwist(*numbers)


def _checked_units(units: object) -> dict[str, str]:
    """Return ``detail_units`` of a controller; raise TypeError if it is malformed."""
    if isinstance(units, Mapping) and all(isinstance(v, str) for kv in units.items() for v in kv):
        return dict(units)
    raise TypeError(f"detail_units must map names to units, both texts; it is {kind_of(units)}")


def _report(error: BaseException) -> str:
    """Return type and message of an exception in one line, and its traceback below."""
    return f"{failure_reason(error)}\n{traceback_text(error)}"
