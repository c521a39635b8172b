"""The pipeline from sensor readings to the command, the same in simulation and on a robot."""

from __future__ import annotations

import traceback
from dataclasses import dataclass, field
from math import nan
from time import get_clock_info, perf_counter_ns, thread_time_ns
from typing import Literal, NamedTuple

from omnidrive.control.command_check import checked_command
from omnidrive.control.controller import (
    Command,
    Controller,
    DetailedController,
    PreparableController,
    Status,
)
from omnidrive.control.supervision import NullSupervisor, Supervisor
from omnidrive.estimation import LatestFix, SensorReadings, State, StateEstimator
from omnidrive.estimation.state import state_fault
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Reference

# a thread's own time is not disturbed by other processes; some systems count it too coarsely
_clock = thread_time_ns if get_clock_info("thread_time").resolution < 1e-6 else perf_counter_ns
_STOP = Command(BodyTwist(0.0, 0.0, 0.0))
_FRAMES = 4  # calls shown of a traceback

Part = Literal["reference", "estimator", "supervisor", "controller"]


class PipelineStep(NamedTuple):
    """Result of one sample."""

    state: State
    """Estimate at the sample."""
    target: Pose
    """Reference pose at the sample, in W; m, m, rad."""
    command: Command
    """Command to send; its status is ``FAILED`` if a part failed, and the robot must stop."""
    step_time: float = nan
    """Computing time of ``Controller.step`` in its thread, us; NaN if it was not called."""
    failed: Part | None = None
    """The part that failed; its message or traceback is ``command.message``."""


@dataclass(slots=True)
class Pipeline:
    """Estimator, supervisor and controller in series: one call per sample.

    An exception or an invalid result of a part is reported in the returned step and not raised, so
    that the caller can stop the robot.

    Attributes:
        controller: Computes the command.
        estimator: Computes the state from the readings; by default the latest pose fix.
        supervisor: Checks the state and limits the command; by default no supervisor.
    """

    controller: Controller
    estimator: StateEstimator = field(default_factory=LatestFix)
    supervisor: Supervisor = field(default_factory=NullSupervisor)
    _previous: Command = field(default=_STOP, init=False, repr=False)
    """Command computed in the previous sample."""
    _state: State = field(default=State(0.0, Pose(nan, nan, nan)), init=False, repr=False)
    _details: int | None = field(default=None, init=False, repr=False)

    def prepare(self) -> None:
        """Prepare the controller if it is a :class:`PreparableController`."""
        if isinstance(self.controller, PreparableController):
            self.controller.prepare()

    def reset(self, pose: Pose) -> None:
        """Start a run at rest at ``pose``, which is known exactly."""
        self._state = State(0.0, pose)
        self._previous = _STOP
        self.estimator.reset(pose)
        self.controller.reset(self._state)
        self.supervisor.reset(self.controller)
        self._details = None
        if isinstance(self.controller, DetailedController):
            self._details = len(self.controller.detail_units)

    def observe(self, t: float, readings: SensorReadings, reference: Reference) -> PipelineStep:
        """Estimate and check the state at ``t`` (s) without a command, as at the end of a run."""
        part: Part = "reference"
        target = self._state.pose
        try:
            target = reference.at(t).pose
            part = "estimator"
            state = self.estimator.update(readings)
            fault = state_fault(state)
            if fault is not None:
                return self._failure(part, target, fault)
            self._state = state
            part = "supervisor"
            self._state = self.supervisor.check(t, readings, state, target)
        except Exception:
            return self._failure(part, target, _traceback())
        return PipelineStep(state, target, _STOP)

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
        command, step_time = _STOP, nan
        if self.supervisor.stopped is None:
            command, step_time = self._compute(t, reference)
        command, self._previous = (self._previous if late else command), command
        if command.status is Status.FAILED:
            return PipelineStep(observed.state, observed.target, command, step_time, "controller")
        try:
            command = self.supervisor.limit(command, dt)
        except Exception:
            return self._failure("supervisor", observed.target, _traceback())
        return PipelineStep(observed.state, observed.target, command, step_time)

    def _compute(self, t: float, reference: Reference) -> tuple[Command, float]:
        """Return the command of the controller and its computing time, us."""
        controller = self.supervisor.controller or self.controller
        start = _clock()
        try:
            command = controller.step(t, self._state, reference)
        except Exception:
            return _STOP._replace(status=Status.FAILED, message=_traceback()), nan
        return checked_command(command, self._details), (_clock() - start) * 1e-3

    def _failure(self, part: Part, target: Pose, message: str) -> PipelineStep:
        command = _STOP._replace(status=Status.FAILED, message=message)
        return PipelineStep(self._state, target, command, nan, part)


def _traceback() -> str:
    """Return the traceback of the current exception, with its innermost calls only."""
    return traceback.format_exc(limit=-_FRAMES).rstrip()
