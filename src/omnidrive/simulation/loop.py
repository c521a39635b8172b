"""The closed loop in simulated time."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import nan
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import (
    CommandValue,
    Controller,
    LimitedController,
    Pipeline,
    PipelineStep,
    WheelSpeeds,
    WheelTorques,
)
from omnidrive.control.controller import STOP, check_controller, failed_command, limits_notice
from omnidrive.control.pipeline import PartFailed
from omnidrive.control.supervision import Event, NullSupervisor, Supervisor
from omnidrive.errors import InvalidInput, kind_of, one_line
from omnidrive.estimation import LatestFix, State, StateEstimator
from omnidrive.estimation.state import check_start
from omnidrive.geometry import BodyTwist, Pose, check_heading
from omnidrive.parameter import are_finite, check_sample_time
from omnidrive.reference import Reference
from omnidrive.simulation import guard
from omnidrive.simulation.disturbances import Schedule
from omnidrive.simulation.disturbances.schedule import sample_times
from omnidrive.simulation.environment import Environment
from omnidrive.simulation.guard import Guard, RunEnded, run_timer
from omnidrive.simulation.plant import Plant, PlantState, check_command
from omnidrive.simulation.run import Outcome, Run
from omnidrive.simulation.sensors import PerfectSensors, Sensors

_logger = logging.getLogger("omnidrive")
_UNKNOWN = (nan, nan, nan)
_BEFORE_START = -1.0  # s; a time before the first sample
_FAILED = {
    "reference": Outcome.REFERENCE_FAILED,
    "estimator": Outcome.ESTIMATOR_FAILED,
    "supervisor": Outcome.SUPERVISOR_FAILED,
    "controller": Outcome.CONTROLLER_FAILED,
}


def simulate(
    plant: Plant,
    controller: Controller | Pipeline,
    reference: Reference,
    *,
    start: Pose,
    dt: float,
    sensors: Sensors | None = None,
    estimator: StateEstimator | None = None,
    supervisor: Supervisor | None = None,
    schedule: Schedule | None = None,
    rng: np.random.Generator | None = None,
) -> Run:
    """Simulate a closed loop until the reference ends.

    A retiming controller may make it longer, a limited one may be slower than the reference: a
    warning and an event at 0 s say so. An exception or a malformed result of a part ends the run,
    not the program: the outcome, the reason and the traceback are in the returned log.

    Args:
        plant: The simulated robot; the caller closes it.
        controller: The controller, or a whole pipeline.
        reference: The motion to track.
        start: Pose at t = 0, at rest.
        dt: Sample time, s; the reference ends at the nearest multiple.
        sensors: Simulated sensors; by default exact poses, encoders and currents.
        estimator: By default the latest pose fix.
        supervisor: By default none.
        schedule: Faults and their times; by default none.
        rng: Generator for jitter of the sample time; None: no jitter.

    Raises:
        InvalidInput: ``dt`` is not 1e-9 to 3600 s or not that of the controller, a part lacks a
            method, the start is not a usable pose, the initial heading seems to be in degrees, a
            fault begins after the end or needs a plant with other capabilities, or a pipeline is
            combined with an estimator or a supervisor.
        OmnidriveError: The plant cannot start.
    """
    check_sample_time(dt)
    pipeline = _pipeline(controller, estimator, supervisor)
    environment = Environment(plant, sensors or PerfectSensors(), reference, schedule)
    log = _Log(pipeline)
    try:
        with run_timer():
            environment.check()
            _check_start(pipeline.controller, reference, start, dt)
            _prepare(pipeline)
            state = environment.reset(start)
            _reset(pipeline, start)
            duration = _duration(environment, pipeline, log)
            _note_limits(environment, pipeline.controller, dt, log)
            samples = sample_times(duration, dt, schedule.faults if schedule else (), rng)
            _loop(environment, pipeline, state, samples, log)
    except RunEnded as end:
        log.end = end
        if not log.rows:
            log.add_failed_start(start)
    return log.run(environment.events)


def _pipeline(
    controller: Controller | Pipeline,
    estimator: StateEstimator | None,
    supervisor: Supervisor | None,
) -> Pipeline:
    """Return the pipeline of a run."""
    if not isinstance(controller, Pipeline):
        return Pipeline(controller, estimator or LatestFix(), supervisor or NullSupervisor())
    if estimator is not None or supervisor is not None:
        raise InvalidInput("a pipeline holds its own estimator and supervisor; give only it")
    return controller


def _check_start(controller: Controller, reference: Reference, start: Pose, dt: float) -> None:
    """Check the controller, the start, and the initial heading of the reference.

    Raises:
        InvalidInput: One of them cannot be meant.
        RunEnded: The reference fails.
    """
    check_controller(controller, dt)
    if not isinstance(start, Pose):
        raise InvalidInput(f"the start is {kind_of(start)}: pass Pose(x, y, yaw), in m, m, rad")
    check_start(start)
    check_heading("the start's heading", start.yaw)
    with Guard(Outcome.REFERENCE_FAILED, call="pose", t=0.0, limit=guard.PART_TIMEOUT):
        first = reference.at(0.0).pose
    if isinstance(first, Pose) and are_finite(first):  # otherwise the run reports it
        check_heading("the reference's heading at its start", first.yaw)


def _prepare(pipeline: Pipeline) -> None:
    """Compile and allocate what the controller needs."""
    limit = 10.0 * guard.PART_TIMEOUT
    with Guard(Outcome.CONTROLLER_FAILED, call="preparation", limit=limit):
        pipeline.prepare()


def _reset(pipeline: Pipeline, start: Pose) -> None:
    """Start the parts of the pipeline; raise RunEnded if one fails."""
    try:
        pipeline.reset(start)
    except PartFailed as error:
        raise RunEnded(_FAILED[error.part], *_reason(error.message)) from None


def _duration(environment: Environment, pipeline: Pipeline, log: _Log) -> float:
    """Return the duration of the run, s, and log the reason if it is not the reference's."""
    duration = environment.duration
    with Guard(Outcome.CONTROLLER_FAILED, call="retime", limit=guard.PART_TIMEOUT):
        tracked, notice = pipeline.retime(environment.reference)
        later = duration if tracked is environment.reference else tracked.duration
        if not are_finite((later,)):
            raise ValueError(f"the duration of a Retiming must be finite, not {later}")
    log.note(notice)
    return max(duration, later)


def _note_limits(environment: Environment, controller: Controller, dt: float, log: _Log) -> None:
    """Log a warning if the reference exceeds the limits of the controller."""
    if isinstance(controller, LimitedController):
        with Guard(Outcome.CONTROLLER_FAILED, call="command_limits", limit=guard.PART_TIMEOUT):
            log.note(limits_notice(controller, environment.reference, dt))


@lru_cache(maxsize=256)
def warn_once(text: str) -> None:
    """Log a warning, unless it has been logged lately in this process."""
    _logger.warning(text)


def _loop(
    environment: Environment,
    pipeline: Pipeline,
    state: PlantState,
    samples: Iterable[tuple[float, float, bool]],
    log: _Log,
) -> None:
    """Read the sensors, compute the command and step the plant, sample by sample."""
    before = _BEFORE_START
    commanded: CommandValue = STOP
    supervisor = pipeline.supervisor
    for t, h, ends in samples:
        readings = environment.read(t, state)
        if ends:
            step = pipeline.observe(t, readings, environment.reference)
        else:
            late = environment.overrun(t)
            step = pipeline.step(t, readings, environment.reference, h, late=late)
            if not isinstance(step.command.value, BodyTwist):  # the pipeline has checked twists
                step = _executable(step, environment.plant, state)
        log.add(t, state, step)
        if step.failed:
            raise RunEnded(_FAILED[step.failed], *_reason(step.command.message))
        if ends or (supervisor.at_rest and commanded == STOP):
            return
        environment.apply(before, t)
        commanded = step.command.value
        state = environment.step(t, commanded, h)
        before = t


def _executable(step: PipelineStep, plant: Plant, state: PlantState) -> PipelineStep:
    """Return ``step``; if the plant cannot execute its command, a failure of the controller."""
    try:
        check_command(step.command.value, plant.capabilities, len(state.wheel_speeds))
    except InvalidInput as error:
        return step._replace(command=failed_command(str(error)), failed=step.failed or "controller")
    return step


def _reason(message: str) -> tuple[str, str]:
    """Return the first line of a message, and the traceback below it; empty without one."""
    reason, _, rest = message.partition("\n")
    return one_line(reason), rest if "Traceback (most recent call last):" in rest else ""


class _Row(NamedTuple):
    """One sample of the log; the fields are those of :class:`Run`."""

    t: float
    pose: tuple[float, ...]
    measured: tuple[float, ...]
    position_sigma: float
    yaw_sigma: float
    target: tuple[float, ...]
    command: tuple[float, ...]
    twist: tuple[float, ...]
    wheel_speed: tuple[float, ...]
    wheel_torque: tuple[float, ...]
    saturated: int
    wheel_speed_command: tuple[float, ...]
    wheel_torque_command: tuple[float, ...]
    work: float
    step_time: float
    status: int
    collisions: int
    details: tuple[float, ...]


@dataclass(slots=True)
class _Log:
    """Rows of the log, one per sample."""

    pipeline: Pipeline
    rows: list[_Row] = field(default_factory=list)
    notices: list[Event] = field(default_factory=list)
    """Notices of the controller at the start, and of the estimator."""
    end: RunEnded = field(default_factory=lambda: RunEnded(Outcome.FINISHED))

    def note(self, notice: str) -> None:
        """Log a notice of the controller at the start as a warning, and as an event at 0 s."""
        if notice:
            warn_once(notice)
            self.notices.append(Event(0.0, notice))

    def add(self, t: float, state: PlantState, step: PipelineStep) -> None:
        """Append one sample."""
        estimate, command = step.state, step.command
        value = command.value
        if estimate.notice:
            self.notices.append(Event(t, estimate.notice))
        self.rows.append(
            _Row(
                t,
                state.pose,
                estimate.pose,
                estimate.position_sigma,
                estimate.yaw_sigma,
                step.target,
                value if isinstance(value, BodyTwist) else _UNKNOWN,
                state.twist,
                state.wheel_speeds,
                state.wheel_torques,
                state.saturated,
                value if isinstance(value, WheelSpeeds) else (),
                value if isinstance(value, WheelTorques) else (),
                state.work,
                step.step_time,
                command.status,
                state.collisions,
                command.details,
            )
        )

    def add_failed_start(self, start: Pose) -> None:
        """Append the only row of a run that fails before its first sample, at rest at ``start``."""
        state = PlantState(start, STOP, nan)
        step = PipelineStep(State(0.0, Pose(*_UNKNOWN)), Pose(*_UNKNOWN), failed_command(""))
        self.add(0.0, state, step)

    def run(self, events: Sequence[Event]) -> Run:
        """Return the log of the run."""
        columns = dict(zip(_Row._fields, zip(*self.rows, strict=True), strict=True))
        supervisor, units = self.pipeline.supervisor, self.pipeline.detail_units
        outcome, reason = self.end.outcome, supervisor.stopped or self.end.reason
        if reason and outcome is Outcome.FINISHED:
            outcome = Outcome.STOPPED
        return Run(
            **{name: np.array(columns[name], dtype=float) for name in _REAL},
            **{name: np.array(columns[name], dtype=np.int64) for name in _WHOLE},
            **{name: _columns(columns[name]) for name in _PER_WHEEL},
            outcome=outcome,
            details=_detail_columns(columns["details"], units),
            detail_units=dict(units),
            events=tuple(sorted([*events, *self.notices, *supervisor.events], key=attrgetter("t"))),
            reason=reason,
            traceback=self.end.traceback,
        )


_REAL = (
    "t", "pose", "measured", "position_sigma", "yaw_sigma", "target", "command", "twist", "work",
    "step_time",
)  # fmt: skip
_WHOLE = ("saturated", "status", "collisions")
_PER_WHEEL = ("wheel_speed", "wheel_torque", "wheel_speed_command", "wheel_torque_command")


def _columns(rows: Sequence[tuple[float, ...]]) -> Float[Array, "rows wheels"]:
    """Return the rows as an array, without columns if all are empty; NaN in shorter rows."""
    wheels = max(map(len, rows))
    if min(map(len, rows)) < wheels:
        rows = [row if len(row) == wheels else (nan,) * wheels for row in rows]
    return np.array(rows, dtype=float)


def _detail_columns(
    details: Sequence[tuple[float, ...]], units: Mapping[str, str]
) -> dict[str, Float[Array, " rows"]]:
    """Return the details by name; NaN in rows without details."""
    if not units:
        return {}
    none = (nan,) * len(units)
    columns = np.array([row or none for row in details], dtype=float)
    return {name: columns[:, i] for i, name in enumerate(units)}
