"""The closed loop in simulated time."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from omnidrive.control import (
    CommandValue,
    Controller,
    LimitedController,
    Pipeline,
    PipelineStep,
)
from omnidrive.control.controller import STOP, check_controller, failed_command, limits_notice
from omnidrive.control.pipeline import PartFailed
from omnidrive.control.supervision import NullSupervisor, Supervisor
from omnidrive.errors import InvalidInput, kind_of, one_line
from omnidrive.estimation import LatestFix, StateEstimator
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
from omnidrive.simulation.run_log import RunLog
from omnidrive.simulation.sensors import PerfectSensors, Sensors

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
    log = RunLog(pipeline)
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


def _duration(environment: Environment, pipeline: Pipeline, log: RunLog) -> float:
    """Return the duration of the run, s, and log the reason if it is not the reference's."""
    duration = environment.duration
    with Guard(Outcome.CONTROLLER_FAILED, call="retime", limit=guard.PART_TIMEOUT):
        tracked, notice = pipeline.retime(environment.reference)
        later = duration if tracked is environment.reference else tracked.duration
        if not are_finite((later,)):
            raise ValueError(f"the duration of a Retiming must be finite, not {later}")
    log.note(notice)
    return max(duration, later)


def _note_limits(environment: Environment, controller: Controller, dt: float, log: RunLog) -> None:
    """Log a warning if the reference exceeds the limits of the controller."""
    if isinstance(controller, LimitedController):
        with Guard(Outcome.CONTROLLER_FAILED, call="command_limits", limit=guard.PART_TIMEOUT):
            log.note(limits_notice(controller, environment.reference, dt))


def _loop(
    environment: Environment,
    pipeline: Pipeline,
    state: PlantState,
    samples: Iterable[tuple[float, float, bool]],
    log: RunLog,
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
