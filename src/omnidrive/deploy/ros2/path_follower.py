"""Drives along paths and to goals that come over ROS 2."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import Clock, MonotonicClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import DriveResult, drive
from omnidrive.deploy.links.ros2 import Ros2Link
from omnidrive.deploy.log.drive_log import LogFolder
from omnidrive.deploy.realtime import schedule_below_loop
from omnidrive.deploy.robot_link import LinkLost
from omnidrive.deploy.ros2.drive_files import reference_file
from omnidrive.deploy.ros2.drive_reports import ERROR, OK, WARN, DriveReports
from omnidrive.deploy.ros2.node import Node, Subscription
from omnidrive.deploy.ros2.path_continuation import PathContinuation
from omnidrive.deploy.ros2.path_reference import is_same_ahead, path_poses, path_reference
from omnidrive.deploy.ros2.planar_messages import grid_of, pose_of
from omnidrive.deploy.ros2.qos import LATCHED_QOS
from omnidrive.deploy.ros2.ros_time import SimulatedTimeClock
from omnidrive.errors import InvalidInput, OmnidriveError, one_line
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import PathOptions, Waypoint, plan
from omnidrive.reference import MotionLimits, Reference, time_within_limits

_log = logging.getLogger("omnidrive")
_POLL = 0.02  # s
_NEW_PATH = "a new path"


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
    """

    link: Ros2Link
    pipeline: Pipeline
    rate: float
    requests: DriveRequests
    speed: float | None = None
    margin: float = 0.1
    logs: LogFolder | None = None
    reports: DriveReports | None = None
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
        self.requests.pass_on(DriveControls())
        if self.reports is not None:
            self.reports.repeat()

    def refuse(self, reason: str, level: int = ERROR) -> None:
        """Log and publish why a path or goal is not driven."""
        if reason != self._refusal:
            _log.warning("%s", reason)
        self._refusal = reason
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

        def check() -> None:
            """Pass requests of the graph on, and call ``watch``."""
            self.requests.pass_on(controls)
            watch(controls)

        log = None
        if self.logs is not None:
            log = self.logs.next(reference_file(reference, 1.0 / self.rate))
        self.continuation.pipeline, self.continuation.speed = self.pipeline, self.speed
        self.continuation.clock = self.clock or MonotonicClock()
        self.continuation.is_logged = log is not None
        with self._reported_drive(), _repeating(check, controls):  # the thread ends first
            result = drive(
                self.link,
                self.pipeline,
                reference,
                rate=self.rate,
                controls=controls,
                clock=self.clock,
                log=log,
            )
        if self.reports is not None:
            self.reports.report(OK if result.finished else ERROR, result.ending)
        return result

    @contextmanager
    def _reported_drive(self) -> Iterator[None]:
        """Report a drive; abandon what is computed for new paths at its end."""
        self._refusal = ""
        if self.reports is not None:
            self.reports.begin()
        try:
            yield
        except LinkLost as error:
            if self.reports is not None:
                self.reports.report(ERROR, one_line(str(error)))
            raise
        finally:
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
            least_inflation=robot.body_radius,
        )
        limits = MotionLimits.of_robot(robot, max_speed=self.speed)
        return time_within_limits(found.spline, robot.chassis, limits)


@dataclass
class PlanFollower:
    """Follows the paths on ``/plan`` and drives to the goals on ``/goal_pose`` with ``/map``.

    A path that leads where the present one does is ignored. Along another one the drive continues
    without a stop, with the pose and twist of the present motion, if the limits of the robot permit
    it; otherwise, and for a goal, the robot stops first. A goal without a map is refused.

    Attributes:
        follower: Drives along references.
        plan_topic: Topic of paths.
        goal_topic: Topic of goals.
        map_topic: Topic of the map.
    """

    follower: PathFollower
    plan_topic: str = "/plan"
    goal_topic: str = "/goal_pose"
    map_topic: str = "/map"
    _plans: Subscription = field(init=False)
    _goals: Subscription = field(init=False)
    _maps: Subscription = field(init=False)
    _grid: OccupancyGrid | None = field(default=None, init=False)
    _next: Any = field(default=None, init=False)
    """Path poses or goal pose to drive next."""
    _present: Float[Array, "poses 3"] | None = field(default=None, init=False)
    """Path that is driven."""
    _following: Float[Array, "poses 3"] | None = field(default=None, init=False)
    """Path along which the drive is about to continue."""
    _done: int = field(default=0, init=False)
    """Number of paths and goals that are driven or replaced."""

    def __post_init__(self) -> None:
        node = self.follower.link.node
        self._plans = node.subscription(self.plan_topic, "nav_msgs/msg/Path")
        self._goals = node.subscription(self.goal_topic, "geometry_msgs/msg/PoseStamped")
        self._maps = node.subscription(self.map_topic, "nav_msgs/msg/OccupancyGrid", LATCHED_QOS)

    def run(self, drives: int | None = None) -> Iterator[DriveResult]:
        """Yield the result of each drive, until a stop is requested.

        Args:
            drives: Number of drives after which it ends; None: no limit.
        """
        self._done = 0
        while not self.follower.requests.stopped and (drives is None or self._done < drives):
            if self._next is None:
                self._take()
                self.follower.idle()
                if self._next is None:
                    time.sleep(_POLL)
                    continue
            task, self._next = self._next, None
            try:
                reference = self._reference(task)
            except OmnidriveError as error:
                self._present = None  # the same path may come again
                self.follower.refuse(f"not driven: {error}")
                continue
            result = self.follower.drive(reference, watch=self._watch)
            if self._next is None:  # not decided in time
                self._next = self._following
            self._present = self._following = None
            self._done += 1
            yield result
            if result.ending.startswith("signal"):
                return

    def _reference(self, task: Any) -> Reference:
        if isinstance(task, Pose):
            if self._grid is None:
                raise InvalidInput(f"a goal needs a map on {self.map_topic}")
            return self.follower.reference_to(task, self._grid)
        self._present = task
        return self.follower.reference_along(task)

    def _watch(self, controls: DriveControls) -> None:
        """Continue along another path, or stop the present drive for it or for a goal."""
        self._take()
        continuation = self.follower.continuation
        if self._following is not None:
            continues = continuation.poll(controls)
            if continues is None:
                return
            if continues:
                self._present = self._following
                self._done += 1
            elif self._next is None:
                self._next = self._following
            self._following = None
            if not continues:
                controls.stop(_NEW_PATH)
            return
        if self._next is None:
            return
        begun = False if isinstance(self._next, Pose) else continuation.begin(self._next, controls)
        if begun:
            self._following, self._next = self._next, None
        elif begun is False:
            controls.stop(_NEW_PATH)

    def _take(self) -> None:
        """Take over new maps, paths and goals; malformed ones are reported."""
        poses = self.follower.link.poses
        for received in self._maps.take():
            with self._reported(self.map_topic):
                self._grid = grid_of(received.message)
        for received in self._plans.take():
            with self._reported(self.plan_topic):
                found = path_poses(received.message, poses.frames.world, poses.tree)
                position = poses.tree.pose(poses.frames.base, poses.frames.world)
                old = self._present if self._following is None else self._following
                is_new = old is None or position is None or not is_same_ahead(found, old, position)
                if is_new or not isinstance(self._next, Pose | None):  # the last path replaces it
                    self._next = found
        for received in self._goals.take():
            with self._reported(self.goal_topic):
                message: Any = received.message
                goal, frame = pose_of(message.pose), message.header.frame_id.removeprefix("/")
                if frame not in {"", poses.frames.world} or not all(map(isfinite, goal)):
                    raise InvalidInput(
                        f"a goal in the frame {one_line(frame, 60)}, need finite numbers in "
                        f"{poses.frames.world}"
                    )
                self._next = goal

    @contextmanager
    def _reported(self, topic: str) -> Iterator[None]:
        """Report an invalid message instead of raising."""
        try:
            yield
        except OmnidriveError as error:
            self.follower.refuse(f"{topic}: {error}", WARN)


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
