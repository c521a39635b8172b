"""Drives along the paths and to the goals that other nodes publish."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import DriveResult
from omnidrive.deploy.ros2.drive_reports import WARN
from omnidrive.deploy.ros2.path_follower import PathFollower
from omnidrive.deploy.ros2.path_reference import is_same_ahead, path_poses
from omnidrive.errors import InvalidInput, OmnidriveError, one_line
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Reference
from omnidrive.ros2.node import Subscription
from omnidrive.ros2.planar_messages import grid_of, pose_of
from omnidrive.ros2.qos import LATCHED_QOS

_POLL = 0.02  # s
_NEW_PATH = "a new path"


@dataclass
class PlanFollower:
    """Follows the paths on ``/plan`` and drives to the goals on ``/goal_pose`` with ``/map``.

    A path that leads where the present one does is ignored. Along another one the drive continues
    without a stop, with the pose and twist of the present motion, if the limits of the robot permit
    it; otherwise, and for a goal, the robot stops first. A goal without a map is refused. While the
    robot is held, nothing is driven; when it is armed, the last path or goal that came, or the rest
    of the present motion.

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
            if self._next is None or self.follower.held:
                self._take()
                self.follower.idle()
                if self._next is None or self.follower.held:
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
        if controls.held is not None:
            if self._following is not None:  # it is driven when the robot is armed
                self._next = self._following if self._next is None else self._next
                self._following = None
                continuation.abandon()
            return
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
