"""The closed loop on a robot, in real time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from omnidrive.control import Pipeline
from omnidrive.control.controller import check_controller
from omnidrive.control.pipeline import PartFailed
from omnidrive.control.supervision import Event
from omnidrive.deploy.clock import Clock, MonotonicClock, SimulatedClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive_loop import DriveLoop
from omnidrive.deploy.drive_progress import DriveProgress
from omnidrive.deploy.drive_state import DriveState, StateChange
from omnidrive.deploy.log.drive_log import DriveLog, DriveStart, LogSummary
from omnidrive.deploy.loop_timing import LoopTiming
from omnidrive.deploy.realtime import Measure, realtime
from omnidrive.deploy.robot_link import RobotLink
from omnidrive.errors import InvalidInput, OmnidriveError, one_line
from omnidrive.estimation import LatestFix, PoseFix, SensorReadings
from omnidrive.estimation.state import check_start
from omnidrive.files.str_path import StrPath
from omnidrive.geometry import Pose
from omnidrive.notebook import facts_html
from omnidrive.parameter import Bounds, check_number
from omnidrive.reference import Reference
from omnidrive.simulation import Outcome, Run
from omnidrive.simulation.guard import run_timer

RATES = Bounds(1.0, 1000.0, "Hz")
"""Range of the rate of the loop."""
_WARM_UP = 5  # samples


@dataclass(frozen=True, eq=False, slots=True)
class DriveResult:
    """Result of a drive.

    Attributes:
        run: Log of the samples in which the controller drove the robot. Its true pose is the
            estimated one; twists and work are NaN.
        changes: History of the state.
        timing: Punctuality of the loop.
        measures: What was done for punctuality, and what the system refused.
        limited: Number of commands that were scaled down to the limits of the robot.
        log: What became of the log; None: there is none.
    """

    run: Run
    changes: tuple[StateChange, ...]
    timing: LoopTiming
    measures: tuple[Measure, ...]
    limited: int
    log: LogSummary | None = None

    @property
    def finished(self) -> bool:
        """Whether the robot reached the end of the reference in time."""
        return self.run.outcome is Outcome.FINISHED

    @property
    def ending(self) -> str:
        """Why the drive ended, in one line."""
        return self.changes[-1].reason

    @property
    def ran(self) -> bool:
        """Whether the controller drove the robot at all."""
        return any(change.state is DriveState.RUNNING for change in self.changes)

    def _repr_html_(self) -> str:
        """Return states, punctuality, drawing and main results for notebooks."""
        timing = self.timing.summary()
        facts = {
            "ended": self.ending,
            "states": "; ".join(f"{t:g} s {state.value}" for t, state, _ in self.changes),
            "missed deadlines": f"{timing.misses} of {timing.samples} samples",
            "jitter": f"median {1e6 * timing.jitter_median:.0f} us, "
            f"99 % below {1e6 * timing.jitter_p99:.0f} us",
            "refused": ", ".join(each.name for each in self.measures if each.refusal),
        }
        shown = {name: text for name, text in facts.items() if text}
        return facts_html("Drive", shown) + (self.run._repr_html_() if self.ran else "")


def drive(
    link: RobotLink,
    pipeline: Pipeline,
    reference: Reference,
    *,
    rate: float,
    start: Pose | None = None,
    controls: DriveControls | None = None,
    clock: Clock | None = None,
    cpu: int | None = None,
    log: DriveLog | StrPath | None = None,
) -> DriveResult:
    """Drive a robot along a reference with the pipeline that was simulated.

    Samples have absolute deadlines. A sample that ends after the next one was due is a miss; those
    in between are skipped, never made up for. The robot is held (ramped to zero speed) if readings
    or estimate are older than :data:`~omnidrive.deploy.drive_loop.MAX_AGE`; it goes on only when it
    is armed again. Without ``controls`` no user can arm it, so that the drive ends when the ramp
    does. There, and on a simulated clock, a drive in which the robot is not driven for
    :data:`~omnidrive.deploy.drive_loop.MAX_WAIT` ends. The robot is stopped however the drive ends;
    if this process is killed, by the watchdog of the link.

    Args:
        link: Connection to the robot; it is opened, and closed at the end.
        pipeline: Estimator, supervisor and controller.
        reference: The motion to track.
        rate: Rate of the loop, 1 to 1000 Hz; the controller's sample time is its inverse.
        start: Pose of the robot at the start, in W; m, m, rad. None: its first pose fix.
        controls: Requests of the user. None: the robot is armed at once, and a hold ends the drive.
        clock: Clock of the loop. None: the monotonic clock, with this process prepared for
            punctuality, see :func:`~omnidrive.deploy.realtime.realtime`.
        cpu: Number of the processor to run on; None: any.
        log: Log of every sample, or its file name with the suffix .mcap. None: none.

    Raises:
        InvalidInput: The rate is out of range or not that of the controller, the start is not a
            usable pose, or it is missing and the link measures no poses; the suffix of the log is
            another one.
        MissingExtra: A log needs the package mcap, which is not installed.
        CannotWrite: The log cannot be written at the start.
        LinkLost: The robot cannot be reached at the start.
        OmnidriveError: A part of the pipeline fails before the robot is armed.
    """
    sink = log if isinstance(log, DriveLog) or log is None else DriveLog(log)
    check_number("rate", rate, RATES)
    dt = 1.0 / rate
    check_controller(pipeline.controller, dt)
    _check_pose(link, pipeline, start)
    warm_up(pipeline, reference, dt, len(link.robot.mounts))
    attended, controls = controls is not None, controls or DriveControls(arm=True)
    progress, clock = DriveProgress(reference, dt), clock or MonotonicClock()
    loop = DriveLoop(link, pipeline, progress, start, controls, clock, sink, attended)
    with (
        loop.controls.of_signals(),
        loop.connected(),  # what the link starts keeps its own scheduling
        _prepared(loop.clock, cpu) as measures,
        run_timer(),
    ):
        summary = _run(loop, measures)
    return _result(loop, measures, summary)


def _result(loop: DriveLoop, measures: list[Measure], log: LogSummary | None) -> DriveResult:
    changes = loop.machine.changes
    return DriveResult(
        loop.log.run([Event(c.t, f"{c.state.value}: {c.reason}") for c in changes]),
        tuple(changes),
        loop.timing,
        tuple(measures),
        loop.gate.limited,
        log,
    )


def _run(loop: DriveLoop, measures: list[Measure]) -> LogSummary | None:
    """Run the loop, and write its log from the begin to the end."""
    sink = loop.sink
    if sink is None:
        loop.run()
        return None
    progress = loop.progress
    sink.open(
        DriveStart(
            loop.link, loop.pipeline, progress.reference, loop.dt, loop.clock, tuple(measures)
        )
    )
    try:
        loop.run()
    finally:
        summary = sink.close()
    return summary


def _check_pose(link: RobotLink, pipeline: Pipeline, start: Pose | None) -> None:
    """Raise InvalidInput unless the pose is known at the start and later."""
    if start is not None:
        check_start(start)
    if link.capabilities.measures_pose:
        return
    if start is None:
        raise InvalidInput("this link measures no pose: give the start of the robot, x, y and yaw")
    if isinstance(pipeline.estimator, LatestFix):
        raise InvalidInput(
            "this link measures no pose: the pipeline needs an estimator that reckons from the "
            "wheels, such as PoseEstimator (on the command line: --estimator)"
        )


@contextmanager
def _prepared(clock: Clock, cpu: int | None) -> Iterator[list[Measure]]:
    """Prepare the process, unless the clock is simulated."""
    if isinstance(clock, SimulatedClock):
        yield []
    else:
        with realtime(cpu=cpu) as measures:
            yield measures


def warm_up(pipeline: Pipeline, reference: Reference, dt: float, wheels: int) -> None:
    """Compile all kernels and allocate all buffers, by samples at rest at the start.

    Raises:
        OmnidriveError: A part of the pipeline fails.
    """
    pipeline.prepare()
    pose = reference.at(0.0).pose
    try:
        pipeline.reset(pose)
    except PartFailed as error:
        raise OmnidriveError(one_line(str(error))) from error
    for k in range(_WARM_UP):
        t = k * dt
        readings = SensorReadings(t, (0.0,) * wheels, (), None, (PoseFix(t, pose, 0.01, 0.01),))
        step = pipeline.step(t, readings, reference, dt)
        if step.failed:
            reason = one_line(step.command.message.partition("\n")[0])
            raise OmnidriveError(f"the {step.failed} failed: {reason}")
