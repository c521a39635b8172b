"""Drives along references with a robot in a graph of ROS 2, with the requests of its nodes."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import Clock, MonotonicClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import DriveResult, drive
from omnidrive.deploy.drive_state import EVENT
from omnidrive.deploy.log.drive_log import LogFolder
from omnidrive.deploy.realtime import schedule_below_loop
from omnidrive.deploy.robot_link import LinkLost
from omnidrive.deploy.ros2.drive_files import reference_file
from omnidrive.deploy.ros2.drive_reports import ERROR, OK, DriveReports
from omnidrive.deploy.ros2.path_continuation import PathContinuation
from omnidrive.deploy.ros2.path_reference import path_reference
from omnidrive.deploy.ros2.ros2_link import Ros2Link
from omnidrive.errors import one_line
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import PathOptions, Waypoint, plan
from omnidrive.reference import MotionLimits, Reference, time_within_limits
from omnidrive.ros2.node import Node, Subscription
from omnidrive.ros2.ros_time import SimulatedTimeClock

_log = logging.getLogger("omnidrive")
_POLL = 0.02  # s


@dataclass
class DriveRequests:
    """Requests of other nodes during a drive: ``/e_stop`` and ``~/arm``, both ``std_msgs/Bool``.

    Attributes:
        node: The node.
        stop_topic: Topic on which true ends the drive.
    """

    node: Node
    stop_topic: str = "/e_stop"
    stopped: bool = False
    """Whether a stop was requested."""
    _stop: Subscription = field(init=False)
    _arm: Subscription = field(init=False)

    def __post_init__(self) -> None:
        self._stop = self.node.subscription(self.stop_topic, "std_msgs/msg/Bool")
        self._arm = self.node.subscription("~/arm", "std_msgs/msg/Bool")

    @property
    def arm_topic(self) -> str:
        """Topic on which true arms a robot that was held."""
        return f"{self.node.full_name}/arm"

    def how_held_ends(self) -> str:
        """Return which messages let a robot that is held move again, or end the drive."""
        return (
            f"held: true on {self.arm_topic} lets the robot move again, true on "
            f"{self.stop_topic} ends the drive (std_msgs/msg/Bool)"
        )

    def pass_on(self, controls: DriveControls) -> None:
        """Pass new requests to the controls of a drive."""
        if any(each.message.data for each in self._stop.take()):
            self.stopped = True
            controls.stop(f"stop requested on {self.stop_topic}")
        if any(each.message.data for each in self._arm.take()):
            controls.arm()


class NoPose(LinkLost):
    """No pose of the robot arrives."""


@dataclass
class PathFollower:
    """Drives a robot along references, and along the paths and to the goals of other nodes.

    Attributes:
        link: The robot.
        pipeline: Estimator, supervisor and controller.
        rate: Rate of the loop, Hz.
        requests: Requests of other nodes.
        speed: Limit of the speed, m/s; None: that of the robot.
        margin: Distance from obstacles of a map, m, in addition to the robot's radius.
        logs: Folder of the logs. None: none are written.
        reports: What is published of the drives. None: nothing.
        held: Why the last drive was held when it ended; no other one begins until a user arms the
            robot. Empty: it was not held.
    """

    link: Ros2Link
    pipeline: Pipeline
    rate: float
    requests: DriveRequests
    speed: float | None = None
    margin: float = 0.1
    logs: LogFolder | None = None
    reports: DriveReports | None = None
    held: str = ""
    _refusal: str = ""
    """Why the last path was not driven; it is logged once."""
    continuation: PathContinuation = field(init=False)
    """New paths during a drive."""

    def __post_init__(self) -> None:
        self.continuation = PathContinuation(
            self.link.robot, self.pipeline, 1.0 / self.rate, self.speed
        )

    @property
    def clock(self) -> Clock | None:
        """Clock of the drives: that of the simulation, or None for the monotonic clock."""
        if self.link.settings.use_sim_time:
            return SimulatedTimeClock(self.link.ros_clock)
        return None

    def current_pose(self) -> Pose:
        """Return the pose of the robot in W.

        Raises:
            NoPose: None arrives in the time for which the link waits.
        """
        found: list[Pose] = []
        timeout = self.link.settings.timeout

        def arrives() -> bool:
            """Return whether a pose has arrived."""
            fix = self.link.poses.read()
            if fix is not None:
                found.append(fix.pose)
            return bool(found)

        if not self.link.node.wait_for(arrives, timeout):
            frames = self.link.settings.frames
            reasons = list(self.link.poses.refused)[-3:] or ["none arrives"]
            raise NoPose(
                f"no pose of {frames.base} in {frames.world} within {timeout:g} s: "
                f"{'; '.join(reasons)}; see: omnidrive ros2 doctor"
            )
        return found[-1]

    def idle(self) -> None:
        """Read poses and requests between drives, and publish the state again."""
        self.link.poses.read()
        controls = DriveControls()
        self.requests.pass_on(controls)
        if self.held and controls.arm_requested:
            self.held = ""
            self._report(OK, "armed by the user")
        if self.reports is not None:
            self.reports.repeat()

    def refuse(self, reason: str, level: int = ERROR) -> None:
        """Log and publish why a path or goal is not driven."""
        if reason != self._refusal:
            _log.warning("%s", reason, extra=EVENT)
        self._refusal = reason
        self._report(level, reason)

    def held_sentence(self, reason: str) -> str:
        """Return that the robot is held for a reason, and how it moves again."""
        arm = self.requests.arm_topic
        return f"the robot is held: {reason}; it moves again after true on {arm}"

    def _report(self, level: int, reason: str) -> None:
        """Publish the state of the drive."""
        if self.reports is not None:
            self.reports.report(level, one_line(reason))

    def drive(
        self,
        reference: Reference,
        *,
        watch: Callable[[DriveControls], None] = lambda _: None,
        controls: DriveControls | None = None,
    ) -> DriveResult:
        """Drive along a reference.

        Args:
            reference: The motion in W.
            watch: Called 50 times a second, in another thread, with the controls of the drive.
            controls: Requests of the user; None: the robot is armed at once.
        """
        controls = controls or DriveControls(arm=True)
        reported: str | None = None

        def check() -> None:
            """Pass requests of the graph on, report a hold, and call ``watch``."""
            nonlocal reported
            self.requests.pass_on(controls)
            held = controls.held
            if held is not None and reported is None:
                _log.warning("%s", self.requests.how_held_ends(), extra=EVENT)
            if held != reported and self.reports is not None:
                if held is None:
                    self.reports.begin()
                else:
                    self._report(ERROR, self.held_sentence(held))
            elif held is not None and self.reports is not None:
                self.reports.repeat()
            reported = held
            watch(controls)

        log = None
        if self.logs is not None:
            log = self.logs.next(reference_file(reference, 1.0 / self.rate))
        self.continuation.pipeline, self.continuation.speed = self.pipeline, self.speed
        self.continuation.clock = self.clock or MonotonicClock()
        self.continuation.is_logged = log is not None
        with self._reported_drive(controls), _repeating(check, controls):  # the thread ends first
            result = drive(
                self.link,
                self.pipeline,
                reference,
                rate=self.rate,
                controls=controls,
                clock=self.clock,
                log=log,
            )
        self._report(OK if result.finished else ERROR, result.ending)
        return result

    @contextmanager
    def _reported_drive(self, controls: DriveControls) -> Iterator[None]:
        """Report a drive; at its end note a hold, and abandon what is computed for new paths."""
        self._refusal = ""
        if self.reports is not None:
            self.reports.begin()
        try:
            yield
        except LinkLost as error:
            self._report(ERROR, str(error))
            raise
        finally:
            self.held = controls.held or ""
            self.continuation.abandon()

    def reference_along(self, poses: Float[Array, "poses 3"]) -> Reference:
        """Return the motion along a path in W from the robot's present pose."""
        return path_reference(poses, self.current_pose(), self.link.robot, speed=self.speed)

    def reference_to(self, goal: Pose, grid: OccupancyGrid) -> Reference:
        """Return the motion to a goal in W on a map, from the robot's present pose.

        Raises:
            InvalidInput: Start or goal is in collision or outside the map.
            NoPathFound: There is no path.
        """
        start, robot = self.current_pose(), self.link.robot
        found = plan(
            grid,
            Waypoint(*start),
            Waypoint(*goal),
            inflation=robot.body_radius + self.margin,
            options=PathOptions(),
            inflation_note=f"body radius {robot.body_radius:g} m and margin {self.margin:g} m",
            min_inflation=robot.body_radius,
        )
        limits = MotionLimits.of_robot(robot, max_speed=self.speed)
        return time_within_limits(found.spline, robot.chassis, limits)


@contextmanager
def _repeating(action: Callable[[], None], controls: DriveControls) -> Iterator[None]:
    """Call a function 50 times a second in a thread; what it raises stops the drive."""
    ended = threading.Event()

    def repeat() -> None:
        """Call the action until the context ends."""
        schedule_below_loop()
        while not ended.wait(_POLL):
            try:
                action()
            except Exception as error:
                _log.exception("requests cannot be read")
                controls.stop(f"requests cannot be read: {one_line(str(error))}")
                return

    thread = threading.Thread(target=repeat, daemon=True, name="omnidrive requests")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
