"""The closed loop on a robot, in real time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import floor, nan

from omnidrive.control import Pipeline, PipelineStep
from omnidrive.control.controller import STOP, check_controller
from omnidrive.control.pipeline import PartFailed
from omnidrive.control.supervision import Event
from omnidrive.deploy.clock import Clock, MonotonicClock, SimulatedClock
from omnidrive.deploy.command_gate import CommandGate
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive_state import DriveState, StateChange, StateMachine
from omnidrive.deploy.loop_timing import LoopTiming
from omnidrive.deploy.realtime import Measure, realtime
from omnidrive.deploy.remaining_reference import RemainingReference
from omnidrive.deploy.robot_link import LinkLost, RobotLink
from omnidrive.errors import InvalidInput, OmnidriveError, one_line
from omnidrive.estimation import LatestFix, PoseFix, SensorReadings
from omnidrive.estimation.state import check_start
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import Bounds, check_number
from omnidrive.reference import Reference
from omnidrive.simulation import Outcome, PlantState, Run
from omnidrive.simulation.guard import RunEnded, run_timer
from omnidrive.simulation.run_log import RunLog

RATES = Bounds(1.0, 1000.0, "Hz")
"""Range of the rate of the loop."""
MAX_AGE = 0.5
"""Age of the estimate and of the readings from which the robot is held, s, as ``cmd_vel_timeout``
of ros2_controllers."""
_TIMED_SAMPLES = 1_000_000
_WARM_UP = 5  # samples
_INSTANT = 1e-6  # s
_FAR = 5.0  # periods of the readings for which wheel angles are extrapolated
_ALIGN_TIME = 2.0  # s; longest wait for the first readings
_POLL = 0.0002  # s
_MARGIN = 0.001  # s from the arrival of readings to a sample
_STOPS = 3  # zero commands at the end, because one may be lost


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
    """

    run: Run
    changes: tuple[StateChange, ...]
    timing: LoopTiming
    measures: tuple[Measure, ...]
    limited: int

    @property
    def finished(self) -> bool:
        """Whether the robot reached the end of the reference in time."""
        return self.run.outcome is Outcome.FINISHED

    @property
    def ending(self) -> str:
        """Why the drive ended, in one line."""
        return self.changes[-1].reason


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
) -> DriveResult:
    """Drive a robot along a reference with the pipeline that was simulated.

    Samples have absolute deadlines. A sample that ends after the next one was due is a miss; those
    in between are skipped, never made up for. The robot is held (ramped to zero speed) if readings
    or estimate are older than :data:`MAX_AGE`; it goes on only when it is armed again. It is
    stopped however the drive ends; if this process is killed, by the watchdog of the link.

    Args:
        link: Connection to the robot; it is opened, and closed at the end.
        pipeline: Estimator, supervisor and controller.
        reference: The motion to track.
        rate: Rate of the loop, 1 to 1000 Hz; the controller's sample time is its inverse.
        start: Pose of the robot at the start, in W; m, m, rad. None: its first pose fix.
        controls: Requests of the user. None: the robot is armed at once.
        clock: Clock of the loop. None: the monotonic clock, with this process prepared for
            punctuality, see :func:`~omnidrive.deploy.realtime.realtime`.
        cpu: Number of the processor to run on; None: any.

    Raises:
        InvalidInput: The rate is out of range or not that of the controller, the start is not a
            usable pose, or it is missing and the link measures no poses.
        LinkLost: The robot cannot be reached at the start.
        OmnidriveError: A part of the pipeline fails before the robot is armed.
    """
    check_number("rate", rate, RATES)
    dt = 1.0 / rate
    check_controller(pipeline.controller, dt)
    _check_pose(link, pipeline, start)
    _warm_up(pipeline, reference, dt, len(link.robot.mounts))
    loop = _Loop(
        link, pipeline, reference, dt, start, controls or DriveControls(arm=True),
        clock or MonotonicClock(),
    )  # fmt: skip
    with _prepared(loop.clock, cpu) as measures, loop.controls.of_signals(), run_timer():
        loop.run()
    return DriveResult(
        loop.log.run([Event(c.t, f"{c.state.value}: {c.reason}") for c in loop.machine.changes]),
        tuple(loop.machine.changes),
        loop.timing,
        tuple(measures),
        loop.gate.limited,
    )


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
            "wheels, such as PoseEstimator"
        )


@contextmanager
def _prepared(clock: Clock, cpu: int | None) -> Iterator[list[Measure]]:
    """Prepare the process, unless the clock is simulated."""
    if isinstance(clock, SimulatedClock):
        yield []
    else:
        with realtime(cpu=cpu) as measures:
            yield measures


def _warm_up(pipeline: Pipeline, reference: Reference, dt: float, wheels: int) -> None:
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


@dataclass(slots=True)
class _Loop:
    """The samples of one drive."""

    link: RobotLink
    pipeline: Pipeline
    reference: Reference
    dt: float
    start: Pose | None
    controls: DriveControls
    clock: Clock
    machine: StateMachine = field(default_factory=StateMachine)
    timing: LoopTiming = field(init=False)
    gate: CommandGate = field(init=False)
    log: RunLog = field(init=False)
    _begin: float = 0.0
    """Time of the first sample on the clock, s."""
    _first: int = 0
    """Number of the sample with which the present stretch of running began."""
    _done: float = 0.0
    """Time of the reference that the stretches before it tracked, s."""
    _logged: float = 0.0
    """Time of the log at which the present stretch begins, s."""
    _tracked: Reference = field(init=False)
    """What remained of the reference then."""
    _last: int = 0
    """Number of the last sample of the stretch, from its first."""
    _readings: SensorReadings = field(default=SensorReadings(nan), init=False)
    """Latest readings, with stamps on the clock."""
    _before: tuple[float, tuple[float, ...]] = (nan, ())
    """Time, s, and wheel angles, rad, of the readings before."""
    _zero: tuple[float, ...] = ()
    """Wheel angles at the begin of the stretch, rad."""
    _pose: Pose | None = None
    """Last estimated pose."""
    _arrived: float = 0.0
    """Time at which they arrived, s."""

    def __post_init__(self) -> None:
        samples = 4.0 * self.reference.duration / self.dt
        self.timing = LoopTiming(int(min(max(samples, 1000.0), _TIMED_SAMPLES)))
        self.gate = CommandGate(self.link.robot)
        self.log = RunLog(self.pipeline)
        self._tracked = self.reference

    def run(self) -> None:
        """Connect, sample until the drive ends, stop the robot and disconnect."""
        try:
            self.link.open(self.clock)
            self._begin = self._arrived = self._first_deadline()
            number = 0
            while self.machine.state is not DriveState.STOPPED:
                number = self._sample_at(number)
        except BaseException as error:
            if self.machine.state is not DriveState.STOPPED and self.machine.changes:
                self._stop(number, one_line(f"{type(error).__name__}: {error}"))
            raise
        finally:
            for _ in range(_STOPS):
                with suppress(Exception):
                    self.link.stop()
            self.link.close()

    def _first_deadline(self) -> float:
        """Return the time of the first sample: soon after readings arrive, if their rate is ours.

        So the readings of every sample are young.
        """
        now = self.clock.now()
        if isinstance(self.clock, SimulatedClock):
            return now
        give_up = now + _ALIGN_TIME
        while now < give_up:
            if self.link.read() is not None:
                return now + self.dt + min(0.1 * self.dt, _MARGIN)
            self.clock.sleep_until(now + _POLL)
            now = self.clock.now()
        return now

    def _sample_at(self, number: int) -> int:
        """Wait for a sample and process it; return the number of the next one."""
        deadline = self._begin + number * self.dt
        self.clock.sleep_until(deadline)
        began = self.clock.now()
        try:
            self._sample(number, deadline)
        except LinkLost as error:
            self._stop(number, f"the link is lost: {one_line(str(error))}")
        ended = self.clock.now()
        self.timing.add(began - deadline, ended - began)
        behind = floor((ended - deadline) / self.dt)
        if behind > 0:
            self.timing.misses += 1
            self.timing.skipped += behind
        return number + 1 + behind

    def _sample(self, number: int, now: float) -> None:
        """Read, decide on the state and command."""
        self._read(now)
        self.controls.poll()
        controls, state = self.controls, self.machine.state
        if controls.stop_reason is not None:
            self._stop(number, controls.stop_reason)
            return
        if state is DriveState.RUNNING and controls.hold_reason is not None:
            self._hold(number, controls.hold_reason)
        elif state in {DriveState.IDLE, DriveState.HOLDING} and controls.arm_requested:
            controls.arm_requested = False
            self._change(number, DriveState.ARMED, "armed by the user")
        if self.machine.state is DriveState.ARMED:
            self._try_to_start(number, now)
        if self.machine.state is DriveState.RUNNING:
            self._control(number, now)
        elif self.machine.state is not DriveState.STOPPED:
            self.link.send(self.gate.ramp(self.dt))

    def _read(self, now: float) -> None:
        """Take over new readings."""
        readings = self.link.read()
        if readings is None:
            self._readings = self._readings._replace(fixes=())
            return
        if readings.stamp > self._readings.stamp:
            self._before = self._readings.stamp, self._readings.wheel_angles
        self._readings, self._arrived = readings, now

    def _try_to_start(self, number: int, now: float) -> None:
        """Begin to run if the pose is known, at rest at it."""
        pose = self.start if self._done == 0.0 else self._known_pose()
        fixes = self._readings.fixes
        if pose is None and fixes and now - fixes[-1].stamp <= MAX_AGE:
            pose = fixes[-1].pose
        if pose is None or now - self._readings.stamp > MAX_AGE:
            return
        self._zero = self._readings.wheel_angles
        try:
            self.pipeline.reset(pose)
        except PartFailed as error:
            self._stop(number, one_line(str(error)))
            return
        if self._done:
            self._tracked = RemainingReference(self.reference, self._done)
        tracked = self.pipeline.retime(self._tracked).reference
        duration = max(self._tracked.duration, tracked.duration)
        self._first, self._last = number, round(duration / self.dt)
        self._change(number, DriveState.RUNNING, "the pose is known: " + _text(pose))

    def _known_pose(self) -> Pose | None:
        """Return the last estimate after the robot was held, if the link measures no pose."""
        return None if self.link.capabilities.measures_pose else self._pose

    def _control(self, number: int, now: float) -> None:
        """Run the pipeline and send its command."""
        k = number - self._first
        t = k * self.dt
        readings = self._readings_at(t)
        if k >= self._last:
            step = self.pipeline.observe(t, readings, self._tracked)
            self._note(t, step)
            self._stop(number, "the reference ends", finished=step.failed is None)
            return
        step = self.pipeline.step(t, readings, self._tracked, self.dt)
        self._note(t, step)
        if step.failed:
            reason = step.command.message.partition("\n")[0]
            self._stop(number, f"the {step.failed} failed: {one_line(reason)}")
            return
        old = self._too_old(now, step)
        if old:
            self._hold(number, f"{old}, more than {MAX_AGE:g} s")
            self.link.send(self.gate.ramp(self.dt))
            return
        value = self.gate.passed(step.command.value)
        if value is None:
            self._stop(number, f"the command is not finite: {step.command.value}")
            return
        self.link.send(value)
        supervisor = self.pipeline.supervisor
        if supervisor.at_rest and value == STOP:
            self._stop(number, supervisor.stopped or "the supervisor stopped the robot")

    def _too_old(self, now: float, step: PipelineStep) -> str:
        """Return what is too old to drive on; empty: nothing."""
        silent, age = now - self._arrived, step.state.fix_age
        if silent > MAX_AGE:
            return f"no readings for {silent:.2f} s"
        if age > MAX_AGE and self.link.capabilities.measures_pose:
            return f"the last usable pose fix is {age:.2f} s old"
        return ""

    def _readings_at(self, t: float) -> SensorReadings:
        """Return the readings of the sample at ``t`` (s), with stamps from the stretch's begin."""
        begin = self._begin + self._first * self.dt
        angles = self._angles_at(begin + t)
        if len(angles) == len(self._zero):
            angles = tuple(a - zero for a, zero in zip(angles, self._zero, strict=True))
        stamps = [fix.stamp - begin for fix in self._readings.fixes]
        fixes = tuple(
            fix._replace(stamp=t if abs(stamp - t) < _INSTANT else stamp)  # rounding errors
            for fix, stamp in zip(self._readings.fixes, stamps, strict=True)
        )
        return self._readings._replace(stamp=t, wheel_angles=angles, fixes=fixes)

    def _angles_at(self, now: float) -> tuple[float, ...]:
        """Return the wheel angles at ``now``, extrapolated with the speeds between readings.

        The readings are older than the sample by a part of their period; estimators relate the
        angles to the time of the sample.
        """
        stamp, angles = self._readings.stamp, self._readings.wheel_angles
        since, before = self._before
        late, step = now - stamp, stamp - since
        if not (len(before) == len(angles) and step > _INSTANT and _INSTANT < late < _FAR * step):
            return angles
        return tuple(b + (b - a) * late / step for a, b in zip(before, angles, strict=True))

    def _note(self, t: float, step: PipelineStep) -> None:
        """Append the sample to the log."""
        self._pose = step.state.pose
        twist = step.state.twist or BodyTwist(nan, nan, nan)
        self.log.add(self._logged + t, PlantState(step.state.pose, twist, nan), step)

    def _hold(self, number: int, reason: str) -> None:
        """Begin to ramp the robot to zero speed."""
        t = (number - self._first) * self.dt
        tracked = self._tracked
        self._done += tracked.progress(t) if isinstance(tracked, RemainingReference) else t
        self._logged += t + self.dt
        self.controls.arm_requested = False
        self.gate.hold()
        self._change(number, DriveState.HOLDING, reason)

    def _stop(self, number: int, reason: str, *, finished: bool = False) -> None:
        """Stop the robot for good."""
        with suppress(Exception):
            self.link.stop()
        self._change(number, DriveState.STOPPED, reason)
        if not finished:
            self.log.end = RunEnded(Outcome.STOPPED, reason)
        if not self.log.rows:
            self.log.add_failed_start(self.start or Pose(nan, nan, nan))

    def _change(self, number: int, state: DriveState, reason: str) -> None:
        self.machine.change(number * self.dt, state, reason)


def _text(pose: Pose) -> str:
    return f"x {pose.x:.3f} m, y {pose.y:.3f} m, heading {pose.yaw:.3f} rad"
