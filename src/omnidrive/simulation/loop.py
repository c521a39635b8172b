"""The closed loop in simulated time."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isclose, isfinite, nan
from numbers import Real
from typing import NamedTuple, TypeVar, cast

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import (
    Command,
    CommandValue,
    Controller,
    Pipeline,
    PipelineStep,
    Status,
    WheelSpeeds,
    WheelTorques,
)
from omnidrive.control.supervision import Event, NullSupervisor, Supervisor
from omnidrive.errors import InvalidInput, OmnidriveError, PlantLost
from omnidrive.estimation import LatestFix, SensorReadings, State, StateEstimator
from omnidrive.geometry import BodyTwist, Pose, check_heading
from omnidrive.parameter import check_sample_time
from omnidrive.reference import Reference
from omnidrive.simulation.disturbances import Schedule
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.disturbances.schedule import sample_times
from omnidrive.simulation.plant import (
    DisturbablePlant,
    Plant,
    PlantState,
    check_command,
    check_state,
)
from omnidrive.simulation.run import Outcome, Run
from omnidrive.simulation.sensors import PerfectSensors, Sensors

T = TypeVar("T")

_STOP = BodyTwist(0.0, 0.0, 0.0)
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

    An exception or a malformed result of a part ends the run, not the program: the outcome, the
    reason and the traceback are in the returned log.

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
        InvalidInput: ``dt`` is not a positive number of seconds or not that of the controller, the
            controller has no ``step`` or ``reset``, the initial heading seems to be in degrees, a
            fault begins after the end or needs a plant with other capabilities, or a pipeline is
            combined with an estimator or a supervisor.
        OmnidriveError: The plant cannot start.
    """
    check_sample_time(dt)
    if isinstance(controller, Pipeline):
        if estimator is not None or supervisor is not None:
            raise InvalidInput("a pipeline holds its own estimator and supervisor; give only it")
        pipeline = controller
    else:
        pipeline = Pipeline(controller, estimator or LatestFix(), supervisor or NullSupervisor())
    environment = _Environment(plant, sensors or PerfectSensors(), reference, schedule)
    environment.check()
    _check_start(pipeline.controller, reference, start, dt)
    log = _Log(pipeline)
    samples = sample_times(reference.duration, dt, schedule.faults if schedule else (), rng)
    try:
        _guarded(Outcome.CONTROLLER_FAILED, pipeline.prepare)
        state = _guarded(Outcome.PLANT_FAILED, lambda: environment.reset(start))
        _guarded(Outcome.CONTROLLER_FAILED, lambda: pipeline.reset(start))
        _loop(environment, pipeline, state, samples, log)
    except _Ended as end:
        log.end = end
        if not log.rows:
            log.add_failed_start(start)
    return log.run(environment.events)


def _check_start(controller: Controller, reference: Reference, start: Pose, dt: float) -> None:
    """Raise InvalidInput for a controller, a start or a reference that cannot be meant."""
    if isinstance(controller, type):
        raise InvalidInput(
            f"the controller is the class {controller.__name__}: pass an object, such as "
            f"{controller.__name__}()"
        )
    missing = [name for name in ("reset", "step") if not hasattr(controller, name)]
    if missing:
        raise InvalidInput(
            f"a controller needs the methods reset(state) and step(t, state, reference): "
            f"{type(controller).__name__} has no {' and no '.join(missing)}"
        )
    built_for = getattr(controller, "dt", None)
    if isinstance(built_for, Real) and not isclose(built_for, dt, rel_tol=1e-6):
        raise InvalidInput(
            f"the controller is built for a sample time of {built_for:g} s, but the loop runs with "
            f"dt={dt:g} s: build the controller with dt={dt:g}, or simulate with dt={built_for:g}"
        )
    if not isinstance(start, Pose):
        raise InvalidInput(
            f"the start is a {type(start).__name__}: pass Pose(x, y, yaw), in m, m, rad"
        )
    check_heading("the start's heading", start.yaw)
    try:
        first = reference.at(0.0).pose.yaw
    except Exception:  # the run reports it
        return
    check_heading("the reference's heading at its start", first)


class _Ended(Exception):
    """The run ends before its reference."""

    def __init__(self, outcome: Outcome, reason: str = "", traceback_: str = "") -> None:
        super().__init__(reason)
        self.outcome, self.reason, self.traceback = outcome, reason, traceback_


def _guarded(outcome: Outcome, call: Callable[[], T]) -> T:
    """Return the result of a call of a user's part; an exception in it ends the run.

    An :class:`OmnidriveError` other than :class:`PlantLost` is raised: it concerns every run.
    """
    try:
        return call()
    except PlantLost as error:
        raise _Ended(Outcome.PLANT_LOST, str(error)) from None
    except OmnidriveError:
        raise
    except Exception as error:
        raise _Ended(outcome, _first_line(error), traceback.format_exc(limit=-4).rstrip()) from None


def _loop(
    environment: _Environment,
    pipeline: Pipeline,
    state: PlantState,
    samples: Iterable[tuple[float, float, bool]],
    log: _Log,
) -> None:
    """Read the sensors, compute the command and step the plant, sample by sample."""
    before = _BEFORE_START
    commanded: CommandValue = _STOP
    supervisor = pipeline.supervisor
    for t, h, ends in samples:
        readings = _guarded(Outcome.SENSORS_FAILED, lambda: environment.read(t, state))  # noqa: B023
        if ends:
            step = pipeline.observe(t, readings, environment.reference)
        else:
            late = environment.overrun(t)
            step = pipeline.step(t, readings, environment.reference, h, late=late)
            if not isinstance(step.command.value, BodyTwist):
                step = environment.checked(step, state)
        log.add(t, state, step)
        if step.failed:
            raise _Ended(_FAILED[step.failed], *_reason(step.command.message))
        if ends or (supervisor.at_rest and commanded == _STOP):
            return
        _guarded(Outcome.PLANT_FAILED, lambda: environment.apply(before, t))  # noqa: B023
        commanded = step.command.value
        state = _guarded(Outcome.PLANT_FAILED, lambda: environment.step(commanded, h))  # noqa: B023
        before = t
        if not all(map(isfinite, (*state.pose, *state.twist))):
            raise _Ended(Outcome.PLANT_FAILED, "its state is not finite")


def _reason(message: str) -> tuple[str, str]:
    """Return the last line of a message, and the whole message if it is a traceback."""
    lines = message.splitlines()
    return (lines[-1], message) if len(lines) > 1 else (message, "")


def _first_line(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".splitlines()[0]


@dataclass(slots=True)
class _Environment:
    """Plant, sensors and the faults that act on them."""

    plant: Plant
    sensors: Sensors
    reference: Reference
    schedule: Schedule | None
    events: list[Event] = field(default_factory=list)
    _applied: Disturbances = field(default_factory=Disturbances)

    def check(self) -> None:
        """Raise InvalidInput for faults that cannot occur in this run."""
        if self.schedule is None:
            return
        self.schedule.check(self.reference.duration)
        if self.schedule.plant_faults and not self.plant.capabilities.disturbable:
            raise InvalidInput(
                f"this plant is not disturbable, so no {', '.join(self.schedule.plant_faults)}; "
                "use a plant with the capability disturbable"
            )

    def reset(self, pose: Pose) -> PlantState:
        """Start plant and sensors at rest at ``pose``."""
        state = check_state(self.plant.reset(pose))
        self.sensors.reset(pose)
        return state

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Simulate the plant with ``command`` for ``dt`` (s)."""
        return check_state(self.plant.step(command, dt))

    def checked(self, step: PipelineStep, state: PlantState) -> PipelineStep:
        """Return ``step``; if the plant cannot execute its command, a failure of the controller."""
        try:
            check_command(step.command.value, self.plant.capabilities, len(state.wheel_speeds))
        except InvalidInput as error:
            refused = Command(_STOP, Status.FAILED, message=str(error))
            return step._replace(command=refused, failed="controller")
        return step

    def read(self, t: float, state: PlantState) -> SensorReadings:
        """Return the sensor readings at ``t`` (s)."""
        if self.schedule is not None:
            self.sensors.apply(self.schedule.sensor_faults(t))
        return self.sensors.read(t, state)

    def overrun(self, t: float) -> bool:
        """Return whether the command of the sample at ``t`` (s) is late."""
        return self.schedule is not None and self.schedule.overrun(t)

    def apply(self, before: float, t: float) -> None:
        """Apply the disturbances at ``t`` (s); ``before``: time of the previous sample (s)."""
        if self.schedule is None:
            return
        for fault in self.schedule.faults:
            if fault.is_active(t) != fault.is_active(before):
                change = "begins" if fault.is_active(t) else "ends"
                self.events.append(Event(t, f"{fault.kind} {change}"))
        disturbances = self.schedule.disturbances(before, t, self.reference)
        at_once = any(disturbances.impulse) or any(disturbances.offset)
        changed = at_once or disturbances != self._applied
        if changed and self.plant.capabilities.disturbable:
            cast(DisturbablePlant, self.plant).apply(disturbances)
            self._applied = disturbances


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
    """Notices of the estimator."""
    end: _Ended = field(default_factory=lambda: _Ended(Outcome.FINISHED))

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
        state = PlantState(start, _STOP, nan)
        step = PipelineStep(
            State(0.0, Pose(*_UNKNOWN)), Pose(*_UNKNOWN), Command(_STOP, Status.FAILED)
        )
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
            events=tuple(sorted([*events, *self.notices, *supervisor.events], key=_time_of)),
            reason=reason,
            traceback=self.end.traceback,
        )


def _time_of(event: Event) -> float:
    return event.t


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
    if not units:
        return {}
    none = (nan,) * len(units)
    columns = np.array([row or none for row in details], dtype=float)
    return {name: columns[:, i] for i, name in enumerate(units)}
