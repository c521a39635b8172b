"""The loop of a drive: one sample after the other, on absolute deadlines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import floor, inf, isfinite, nan

from omnidrive.control import CommandValue, Pipeline, PipelineStep
from omnidrive.control.controller import STOP
from omnidrive.control.pipeline import PartFailed
from omnidrive.control.supervision import Event
from omnidrive.deploy.clock import Clock, SimulatedClock
from omnidrive.deploy.command_gate import RAMP_TIME, CommandGate
from omnidrive.deploy.controls import DriveControls, Tracked
from omnidrive.deploy.drive_progress import DriveProgress
from omnidrive.deploy.drive_state import REFERENCE_ENDS, DriveState, StateMachine
from omnidrive.deploy.latest_readings import MAX_AHEAD, LatestReadings
from omnidrive.deploy.log.drive_log import DriveLog
from omnidrive.deploy.log.logged_event import Continued, File
from omnidrive.deploy.log.logged_sample import LoggedSample, Segment
from omnidrive.deploy.loop_timing import LoopTiming
from omnidrive.deploy.pose_jump import PoseJump
from omnidrive.deploy.robot_link import ExplainingLink, LinkLost, RobotLink
from omnidrive.errors import one_line
from omnidrive.estimation import PoseFix, SensorReadings
from omnidrive.estimation.plausibility import usable_fix
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.simulation import Outcome, PlantState
from omnidrive.simulation.guard import RunEnded
from omnidrive.simulation.run_log import RunLog

MAX_AGE = 0.5
"""Age of the estimate, of the readings and of the last command from which the robot is held, s, as
``cmd_vel_timeout`` of ros2_controllers."""
MAX_WAIT = 60.0
"""Time without driving after which a drive ends that no user can arm, s: one on a simulated clock,
or without controls of the user."""
_TIMED_SAMPLES = 1_000_000
_ALIGN_TIME = 2.0  # s; longest wait for the first readings
_POLL = 0.0002  # s
_MARGIN = 0.001  # s from the arrival of readings to a sample
_STOPS = 3  # zero commands at the end, because one may be lost
_MAX_SPLICE_DELAY = 0.2  # s; later, the pose of another motion would be too far ahead
_NOTHING = LoggedSample(0, DriveState.IDLE, 0.0, 0.0)


@dataclass(slots=True)
class DriveLoop:
    """The samples of one drive.

    Attributes:
        link: Connection to the robot.
        pipeline: Estimator, supervisor and controller.
        progress: The reference, and how much of it is tracked.
        start: Pose of the robot at the start, in W; m, m, rad. None: its first pose fix.
        controls: Requests of the user.
        clock: Clock of the loop.
        sink: Log that every sample is appended to. None: none.
        attended: Whether a user can arm the robot again after it was held.
        machine: State of the drive and its history.
        timing: Punctuality.
        gate: Last check of the commands.
        log: Samples in which the controller drove the robot.
    """

    link: RobotLink
    pipeline: Pipeline
    progress: DriveProgress
    start: Pose | None
    controls: DriveControls
    clock: Clock
    sink: DriveLog | None = None
    attended: bool = True
    machine: StateMachine = field(default_factory=StateMachine)
    timing: LoopTiming = field(init=False)
    gate: CommandGate = field(init=False)
    log: RunLog = field(init=False)
    _readings: LatestReadings = field(default_factory=LatestReadings, init=False)
    _begin: float = field(default=0.0, init=False)
    """Time of the first sample on the clock, s."""
    _fixed: float = field(default=-inf, init=False)
    """Stamp of the newest pose fix that arrived and can be used, s on the clock."""
    _pose: Pose | None = field(default=None, init=False)
    """Last estimated pose."""
    _jump: PoseJump = field(init=False)
    _previous: int = field(default=-1, init=False)
    """Number of the last sample."""
    _busy: float = field(default=0.0, init=False)
    """Time that the last sample took, s."""
    _sample: LoggedSample = field(default=_NOTHING, init=False)
    """What the present sample has logged so far."""
    _events: int = field(default=0, init=False)
    """Number of events of the supervisor that are logged."""

    def __post_init__(self) -> None:
        samples = 4.0 * self.progress.reference.duration / self.progress.dt
        self.timing = LoopTiming(int(min(max(samples, 1000.0), _TIMED_SAMPLES)))
        self.gate = CommandGate(self.link.robot)
        self.log = RunLog(self.pipeline)
        self._jump = PoseJump(self.link.robot, self.dt)

    @property
    def dt(self) -> float:
        """Sample time, s."""
        return self.progress.dt

    @contextmanager
    def connected(self) -> Iterator[None]:
        """Open the link; at the end of the context, stop the robot and disconnect."""
        try:
            self.link.open(self.clock)
            yield
        finally:
            for _ in range(_STOPS):
                with suppress(Exception):
                    self.link.stop()
            self.link.close()

    def run(self) -> None:
        """Sample until the drive ends; the link is connected."""
        number = 0
        try:
            self._begin = self._readings.arrived = self._first_deadline()
            if self.sink is not None:
                self.sink.begin(self._begin)
            self.controls.connected = True
            while self.machine.state is not DriveState.STOPPED:
                number = self._sample_at(number)
        except BaseException as error:
            if self.machine.state is not DriveState.STOPPED and self.machine.changes:
                self._stop(number, one_line(f"{type(error).__name__}: {error}"))
            raise

    def _first_deadline(self) -> float:
        """Return the time of the first sample: soon after readings arrive, if their rate is ours.

        So the readings of every sample are young.
        """
        now = self.clock.now()
        if isinstance(self.clock, SimulatedClock):
            return now
        self.link.read()  # what arrived before
        give_up = now + _ALIGN_TIME
        while now < give_up:
            if self.link.read() is not None:
                return now + self.dt + min(0.1 * self.dt, _MARGIN)
            self.clock.sleep_until(now + _POLL)
            now = self.clock.now()
        return now

    def _sample_at(self, number: int) -> int:
        """Wait for a sample and process it; return the number of the next one.

        If the loop wakes so late that later samples are due, it processes the last of them.
        """
        first = self._begin + number * self.dt
        self.clock.sleep_until(first)
        began = self.clock.now()
        late = began - first
        passed = max(0, floor(late / self.dt))
        number += passed
        deadline = self._begin + number * self.dt
        self._sample = _NOTHING
        try:
            self._process(number, deadline, began)
        except LinkLost as error:
            lost = f"the link is lost: {one_line(str(error))}"
            self._stop(number, self.controls.stop_reason or lost)  # a signal ends a robot here too
        self._previous = number
        ended = self.clock.now()
        self._busy = ended - began
        self.timing.add(late, self._busy)
        if self.sink is not None:
            noted = self._sample._replace(number=number, state=self.machine.state)
            self.sink.add(noted._replace(late=late, busy=self._busy))
        behind = floor((ended - deadline) / self.dt)
        if passed + behind > 0:
            self.timing.misses += 1
            self.timing.skipped += passed + behind
        return number + 1 + behind

    def _process(self, number: int, now: float, began: float) -> None:
        """Read at the time ``began``, decide on the state of the sample of ``now`` and command."""
        read = self.link.read()
        self._readings.take(read, now, began)
        fix = self._usable_fix(now)
        if fix is not None:
            self._fixed = max(self._fixed, fix.stamp)
        self._sample = self._sample._replace(read=read)
        self.controls.poll()
        controls, state = self.controls, self.machine.state
        if controls.stop_reason is not None:
            self._stop(number, controls.stop_reason)
            return
        if state is DriveState.RUNNING and controls.hold_reason is not None:
            self._hold(number, controls.hold_reason)
            return
        if state in {DriveState.IDLE, DriveState.HOLDING} and controls.arm_requested:
            controls.arm_requested = False
            self._change(number, DriveState.ARMED, "armed by the user")
        if self.machine.state is DriveState.ARMED:
            self._try_to_start(number, now)
        if self.machine.state is DriveState.RUNNING:
            self._control(number, now)
        elif self.machine.state is not DriveState.STOPPED:
            self._wait(number)

    def _wait(self, number: int) -> None:
        """Send the ramp to zero speed, or zero; end a drive that no user can arm."""
        limit = inf if self.attended and not isinstance(self.clock, SimulatedClock) else MAX_WAIT
        if not self.attended and self.machine.state is DriveState.HOLDING:
            limit = RAMP_TIME
        if ending := self.machine.waits_too_long(number * self.dt, limit):
            self._stop(number, ending)
        else:
            self._send(self.gate.ramp(self.dt))

    def _try_to_start(self, number: int, now: float) -> None:
        """Begin to run if the pose is known, at rest at it."""
        pose = self._known_pose() if self.progress.done > 0.0 else self.start
        fix = self._usable_fix(now)
        if pose is None and fix is not None and now - fix.stamp <= MAX_AGE:
            pose = fix.pose
        if pose is None or not abs(now - self._readings.stamp) <= MAX_AGE:
            return
        self._readings.zero_wheels()
        try:
            self.pipeline.reset(pose)
        except PartFailed as error:
            self._stop(number, one_line(str(error)))
            return
        self._jump.reset(pose)
        self.progress.begin(number, self.pipeline)
        self._events = 0
        if self.sink is not None:
            self.sink.add(Segment(number, pose, self.progress.done, self.progress.log_time(0.0)))
        self._change(number, DriveState.RUNNING, "the pose is known: " + _text(pose))

    def _usable_fix(self, now: float) -> PoseFix | None:
        """Return the last pose fix that arrived with the sample of ``now``, if it is usable."""
        return self._readings.fix and usable_fix(self._readings.fix, now + MAX_AHEAD)

    def _known_pose(self) -> Pose | None:
        """Return the pose after the robot was held, if the link measures no pose.

        It is the last estimate, moved by the wheels' angles since then as one arc, as of the ramp.
        """
        pose, turned = self._pose, self._readings.turned
        if self.link.capabilities.measures_pose or pose is None:
            return None
        if turned and all(map(isfinite, turned)):
            pose = move(pose, self.link.robot.chassis.twist(turned), 1.0)
        return pose

    def _control(self, number: int, now: float) -> None:
        """Run the pipeline and send its command."""
        gap = (number - self._previous) * self.dt
        if gap > MAX_AGE and number > self.progress.first:
            reason = f"no command for {gap:.2f} s, more than {MAX_AGE:g} s: " + (
                f"the sample before took {self._busy:.2f} s"
                if self._busy > 0.5 * gap
                else "this process was stopped"
            )
            self._hold(number, reason, since=self._previous + 1, at_once=True)
            return
        k = number - self.progress.first
        t = k * self.dt
        readings = self._readings.at(t, self._begin + self.progress.first * self.dt)
        self._continue(number, t)
        tracked = self.progress.tracked
        if k >= self.progress.last:
            step = self.pipeline.observe(t, readings, tracked)
            self._note(t, readings, step)
            self._stop(number, REFERENCE_ENDS, finished=step.failed is None)
            return
        step = self.pipeline.step(t, readings, tracked, self.dt)
        self._note(t, readings, step)
        if step.failed:
            reason = step.command.message.partition("\n")[0]
            self._stop(number, f"the {step.failed} failed: {one_line(reason)}")
            return
        fault = self._too_old(now, step) or self._jump.fault(step.state)
        if fault:
            self._hold(number, fault, at_once=self._is_silent(now))
            return
        value = self.gate.passed(step.command.value)
        if value is None:
            self._stop(number, f"the command is not finite: {step.command.value}")
            return
        self._send(value)
        supervisor = self.pipeline.supervisor
        if supervisor.at_rest and value == STOP:
            self._stop(number, supervisor.stopped or "the supervisor stopped the robot")

    def _continue(self, number: int, t: float) -> None:
        """Track another motion if one is requested; ``t``: time since the segment began, s."""
        progress, controls = self.progress, self.controls
        wanted = controls.continuation
        if (
            wanted is not None
            and wanted.tracked is progress.tracked
            and t <= wanted.spliced.switch_time + _MAX_SPLICE_DELAY
        ):
            progress.continue_along(wanted.spliced, self.pipeline)
            if self.sink is not None:
                for name, data in wanted.files.items():
                    self.sink.add(File(name, data))
                    self.sink.add(Continued(number, wanted.spliced.switch_time, name))
        controls.starts = False
        controls.tracked = Tracked(progress.tracked, progress.governed, t)
        if wanted is not None:  # last: another thread then looks at what is tracked
            controls.continuation = None

    def _too_old(self, now: float, step: PipelineStep) -> str:
        """Return what is too old to drive on, and why; empty: nothing."""
        readings, age = self._readings, step.state.fix_age
        if self._is_silent(now):
            silent = max(now - readings.arrived, now - readings.stamp)
            old = f"no readings for {silent:.2f} s"
        elif age > MAX_AGE and self.link.capabilities.measures_pose:
            old = f"the last usable pose fix is {age:.2f} s old"
        else:
            return ""
        cause = self.link.fault if isinstance(self.link, ExplainingLink) else ""
        if not cause and not self._is_silent(now) and now - self._fixed <= MAX_AGE:
            cause = "newer ones arrive, but the estimator does not use them"
        return f"{old}, more than {MAX_AGE:g} s" + (f": {one_line(cause)}" if cause else "")

    def _is_silent(self, now: float) -> bool:
        """Return whether the readings are so old that commands may not reach the robot either."""
        return now - min(self._readings.arrived, self._readings.stamp) > MAX_AGE

    def _send(self, value: CommandValue) -> None:
        """Send a command and note it."""
        self.link.send(value)
        self._sample = self._sample._replace(sent=value)

    def _note(self, t: float, given: SensorReadings, step: PipelineStep) -> None:
        """Append the sample to the log."""
        self._pose = step.state.pose
        twist = step.state.twist or BodyTwist(nan, nan, nan)
        state = PlantState(step.state.pose, twist, nan)
        self.log.add(self.progress.log_time(t), state, step)
        if self.sink is None:
            return
        covariance = step.state.covariance
        if covariance is not None:  # estimators may write to it again
            step = step._replace(state=step.state._replace(covariance=covariance.copy()))
        self._sample = self._sample._replace(t=t, given=given, step=step)
        events = self.pipeline.supervisor.events
        for event in events[self._events :]:
            self.sink.add(Event(self.progress.first * self.dt + event.t, event.what))
        self._events = len(events)

    def _hold(
        self, number: int, reason: str, *, since: int | None = None, at_once: bool = False
    ) -> None:
        """Send the first command of the ramp to zero speed, and note that the robot is held.

        Args:
            number: Number of the sample.
            reason: Why.
            since: Number of the first sample in which it was not driven; None: this one.
            at_once: Whether zero speed follows at once, because the robot may have stopped by its
                watchdog: a ramp would move it again.
        """
        self.progress.end(number if since is None else since)
        self.controls.arm_requested, self.controls.tracked = False, None
        if at_once:
            self.gate.sent = STOP
        self.gate.hold()
        try:
            self._send(self.gate.ramp(self.dt))
        finally:  # a handler of the log may wait, such as for a terminal
            self._change(number, DriveState.HOLDING, reason)

    def _stop(self, number: int, reason: str, *, finished: bool = False) -> None:
        """Stop the robot for good."""
        self.controls.starts, self.controls.tracked = False, None
        with suppress(Exception):
            self.link.stop()
            self._sample = self._sample._replace(sent=STOP)
        self._change(number, DriveState.STOPPED, reason)
        if not finished:
            self.log.end = RunEnded(Outcome.STOPPED, reason)
        if not self.log.rows:
            self.log.add_failed_start(self.start or Pose(nan, nan, nan))

    def _change(self, number: int, state: DriveState, reason: str) -> None:
        self.machine.change(number * self.dt, state, reason)
        if state is not DriveState.STOPPED:
            self.controls.held = reason if state is DriveState.HOLDING else None
        if self.sink is not None:
            self.sink.add(self.machine.changes[-1])


def _text(pose: Pose) -> str:
    return f"x {pose.x:.3f} m, y {pose.y:.3f} m, heading {pose.yaw:.3f} rad"
