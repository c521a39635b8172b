"""The robot's pose in the graph of ROS 2: transforms, odometry and localisation, by frame names."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, nan, sqrt
from typing import Any

from omnidrive.deploy.drive_state import EVENT
from omnidrive.deploy.ros2.scan_localisation import ScanLocalisation, StampedPose
from omnidrive.errors import one_line
from omnidrive.estimation import PoseFix
from omnidrive.geometry import Pose, compose, inverse, wrap
from omnidrive.robot import Robot
from omnidrive.ros2.names import resolve
from omnidrive.ros2.node import Node, Subscription
from omnidrive.ros2.planar_messages import is_level, pose_of, transform_of
from omnidrive.ros2.qos import LATCHED_QOS, SENSOR_QOS
from omnidrive.ros2.ros_time import other_time, seconds
from omnidrive.ros2.transform_tree import MAX_FRAMES, Frames, Transform, TransformTree

_log = logging.getLogger("omnidrive")
MAX_AGE = 0.5
"""Age of a pose from which it is refused, s, as ``cmd_vel_timeout`` of ros2_controllers."""
MAX_AHEAD = 0.1
"""Time by which a stamp may be in the future, s."""
JUMP_PAUSE = 1.0
"""Time without poses after odometry jumped, s: longer than the age at which a drive is held."""
_JUMP_SHARE, _JUMP_DISTANCE, _JUMP_ANGLE = 1.5, 0.1, 0.2  # of the top speeds; m; rad
_LARGEST = 1e6  # m
_HISTORY = 1000  # odometry poses, to compare with a localisation that comes later
MAX_WORLD_AGE = 2.0
"""Age of the transform between world and odometry from which poses are refused, s: localisations
publish it again and again."""


@dataclass
class PoseSource:
    """Poses of the robot in the world frame, from ``/tf``, odometry and localisation.

    The pose is the chain of transforms from the world frame to that of the robot. ``/odom`` is
    the transform of its frame to its child; ``/amcl_pose`` gives that from the world to the
    odometry frame if ``/tf`` does not, and scans if neither does.

    Poses are refused, with a warning, if they are not finite, too old, from the future, earlier
    than the last one, or in frames that are not connected, if the localisation is silent, and for
    :data:`JUMP_PAUSE` after odometry jumped farther than the robot can drive.

    Attributes:
        node: The node.
        robot: The robot, whose top speeds tell a motion from a jump.
        frames: Names of the frames.
        now: Function that returns the time of ROS, s; None: not known yet.
        odometry_topic: Topic of odometry.
        localisation_topic: Topic of a localisation.
        scans: Localisation by scans; None: none.
        refused: Number of refused poses by reason.
    """

    node: Node
    robot: Robot
    frames: Frames
    now: Callable[[], float | None]
    odometry_topic: str = "/odom"
    localisation_topic: str = "/amcl_pose"
    scans: ScanLocalisation | None = None
    refused: dict[str, int] = field(default_factory=dict)
    tree: TransformTree = field(default_factory=TransformTree)
    _last: float = -inf
    """Stamp of the last pose, s."""
    _odometry: deque[StampedPose] = field(default_factory=lambda: deque(maxlen=_HISTORY))
    _paused_until: float = -inf
    """Monotonic time until which poses are refused after a jump, s."""
    _world_by_tf: float = -inf
    """Monotonic time at which ``/tf`` last gave the world frame, s."""
    _sigmas: tuple[float, float] = (nan, nan)
    _warned: str = ""
    _reason: str = ""
    """Why the last poses were refused; empty: they were not."""
    _localised: bool = False
    """Whether the localisation's topic gave the pose of the odometry frame."""
    _heard: bool = False
    _stamps: dict[str, float] = field(default_factory=dict)
    """Last stamp on each topic, s."""
    _subscriptions: list[tuple[Subscription, Callable[[Any], None]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        tf = "tf2_msgs/msg/TFMessage"
        odometry = "nav_msgs/msg/Odometry"
        localisation = "geometry_msgs/msg/PoseWithCovarianceStamped"
        static_qos = LATCHED_QOS._replace(depth=100)
        subscribe, amcl = self.node.subscription, self._take_localisation
        self._subscriptions = [
            (subscribe("/tf_static", tf, static_qos), self._take_static),
            (subscribe("/tf", tf, SENSOR_QOS._replace(depth=100)), self._take_transforms),
            (subscribe(self.odometry_topic, odometry, SENSOR_QOS), self._take_odometry),
            # AMCL latches its pose, others do not: a pose that comes twice changes nothing
            (subscribe(self.localisation_topic, localisation, LATCHED_QOS), amcl),
            (subscribe(self.localisation_topic, localisation, SENSOR_QOS), amcl),
        ]

    def read(self) -> PoseFix | None:
        """Return the newest pose in the world frame, stamped in the time of ROS; None: none new."""
        for subscription, take in self._subscriptions:
            for received in subscription.take(1000):
                self._heard = True
                take(received.message)
        self._correct_by_scans()
        moving = self._newest_stamp()
        if moving is None and self._heard and not self._warned:
            known = ", ".join(self.tree.names()[:10])
            self._refuse(f"frame {self.frames.base} is not known; there are {known}")
        if moving is None or moving <= self._last:
            return None
        pose = self.tree.pose(self.frames.base, self.frames.world)
        if pose is None:
            chain = " in ".join(self.tree.chain(self.frames.base))
            reason = f"frame {self.frames.world} is not connected: known is {chain}"
            self._refuse(f"{reason}{self._scan_fault}")
            return None
        if not self._is_recent(moving) or self._is_localisation_lost():
            return None
        self._last = moving
        if time.monotonic() < self._paused_until:
            return None
        if self._warned:
            _log.warning("poses of the robot are usable again", extra=EVENT)
            self._warned = self._reason = ""
        return PoseFix(moving, pose, *self._sigmas)

    def _newest_stamp(self) -> float | None:
        """Return the stamp of the robot's transform in the odometry or world frame, s."""
        for name in self.tree.chain(self.frames.base)[:-1]:
            found = self.tree.get(name)
            if found is not None and found.stamp != inf:
                return found.stamp
        return None

    def _is_recent(self, stamp: float) -> bool:
        now = self.now()
        if now is None:
            return False
        age = now - stamp
        mixed = other_time(stamp, now)
        if mixed:
            self._refuse(f"a pose is not of this time: {mixed}")
        elif age > MAX_AGE:
            self._refuse(f"poses are {age:.3g} s old; are the computers' clocks synchronised?")
        elif age < -MAX_AHEAD:
            self._refuse(f"poses are {-age:.3g} s in the future; use_sim_time must be alike")
        else:
            return True
        return False

    @property
    def fault(self) -> str:
        """Why no poses arrive, in one line; empty: not known."""
        if self._reason:
            return self._reason
        wanted = {self.odometry_topic: "nav_msgs/msg/Odometry", "/tf": "tf2_msgs/msg/TFMessage"}
        seen = self.node.graph().topics()
        for topic, kind in wanted.items():
            name = resolve(topic, self.node.namespace, node=self.node.name)
            others = seen.get(name, set()) - {kind}
            if others:
                return f"{name} is {', '.join(sorted(others))}, need {kind}"
        return ""

    def _is_localisation_lost(self) -> bool:
        """Refuse poses whose correction is not renewed, or whose localisation has left."""
        odom, now = self.frames.odom, self.now()
        found = self.tree.get(odom)
        if odom == self.frames.world or found is None or now is None:
            return False
        if odom not in self.tree.chain(self.frames.base):
            return False
        age = now - found.stamp
        if age > MAX_WORLD_AGE:
            self._refuse(f"{odom} in {found.parent} is {age:.3g} s old{self._scan_fault}")
        elif self._localised and not self._is_published():
            self._refuse(f"nothing publishes {self.localisation_topic} any more")
        else:
            return False
        return True

    @property
    def _scan_fault(self) -> str:
        return f"; {self.scans.fault}" if self.scans and self.scans.fault else ""

    def _is_published(self) -> bool:
        """Return whether the localisation is in the graph."""
        return any(each.matched > 0 for each, _ in self._subscriptions[-2:])

    def _correct_by_scans(self) -> None:
        """Correct the odometry frame by a scan, if there is no other localisation."""
        if self.scans is None or self.frames.odom == self.frames.world:
            return
        by_tf = time.monotonic() - self._world_by_tf <= MAX_WORLD_AGE
        if by_tf or (self._localised and self._is_published()):
            self.scans.forget()
            return
        correction = self.scans.correct(self._odometry, self.tree)
        if correction is not None:
            self._localised, self._sigmas = False, correction.sigmas
            self._set(self.frames.odom, self.frames.world, correction.pose, correction.stamp)

    def _take_static(self, message: Any) -> None:
        for each in message.transforms[:MAX_FRAMES]:
            child, pose = each.child_frame_id, transform_of(each.transform)
            level = is_level(each.transform.rotation)
            self._set(child, each.header.frame_id, pose, inf, level=level)

    def _take_transforms(self, message: Any) -> None:
        for each in message.transforms[:MAX_FRAMES]:
            child, parent = _name(each.child_frame_id), _name(each.header.frame_id)
            stamp, pose = seconds(each.header.stamp), transform_of(each.transform)
            if child == self.frames.odom and parent == self.frames.world:
                self._world_by_tf, self._sigmas = time.monotonic(), (nan, nan)
                self._localised = False
            if child == self.frames.base:
                self._move("/tf", parent, pose, stamp)
            else:
                self._set(child, parent, pose, stamp, level=is_level(each.transform.rotation))

    def _take_odometry(self, message: Any) -> None:
        child, parent = _name(message.child_frame_id), _name(message.header.frame_id)
        stamp, pose = seconds(message.header.stamp), pose_of(message.pose.pose)
        if child == self.frames.base:
            self._move(self.odometry_topic, parent, pose, stamp)
        else:
            self._set(child, parent, pose, stamp)

    def _take_localisation(self, message: Any) -> None:
        """Correct the odometry frame by a pose in the world frame and the odometry of its time."""
        parent, pose = _name(message.header.frame_id), pose_of(message.pose.pose)
        covariance = message.pose.covariance
        position, yaw = max(covariance[0], covariance[7]), covariance[35]
        if parent != self.frames.world:
            self._refuse(f"{self.localisation_topic} is in {one_line(parent, 60)}")
        elif not _is_usable(pose):
            self._refuse(f"{self.localisation_topic} is not finite")
        elif self._odometry and time.monotonic() - self._world_by_tf > MAX_WORLD_AGE:
            stamp = seconds(message.header.stamp)
            then = min(self._odometry, key=lambda each: abs(each.stamp - stamp))
            self._set(self.frames.odom, parent, compose(pose, inverse(then.pose)), inf)
            self._localised = True
            self._sigmas = (
                (sqrt(position), sqrt(yaw))
                if 0.0 < position < 1e6 and 0.0 < yaw < 1e6
                else (nan, nan)
            )

    def _move(self, topic: str, parent: str, pose: Pose, stamp: float) -> None:
        """Take a pose of the robot in its parent frame; it must move no faster than it can."""
        if not (_is_usable(pose) and isfinite(stamp)):
            self._refuse("a pose of the robot is not finite")
            return
        last_stamp, self._stamps[topic] = self._stamps.get(topic, -inf), stamp
        if stamp < last_stamp:
            self._refuse(f"stamps on {topic} go back by {last_stamp - stamp:.3g} s")
            return
        if self._odometry and parent == self.frames.odom:
            before, last = self._odometry[-1]
            if stamp <= before:  # it comes on two topics
                return
            speed, turn = (_JUMP_SHARE * each for each in self.robot.top_speeds)
            distance = hypot(pose.x - last.x, pose.y - last.y)
            angle = abs(wrap(pose.yaw - last.yaw))
            dt = stamp - before
            if distance > speed * dt + _JUMP_DISTANCE or angle > turn * dt + _JUMP_ANGLE:
                self._paused_until = time.monotonic() + JUMP_PAUSE
                self._refuse(f"odometry jumps by {distance:.3g} m and {angle:.3g} rad")
        if parent == self.frames.odom:
            self._odometry.append(StampedPose(stamp, pose))
        self._set(self.frames.base, parent, pose, stamp)

    def _set(
        self, child: str, parent: str, pose: Pose, stamp: float, *, level: bool = True
    ) -> None:
        child, parent = _name(child), _name(parent)
        if _is_usable(pose) and child and parent and child != parent:
            self.tree.set(child, Transform(parent, pose, stamp, level))
        else:
            self._refuse(f"the transform of {one_line(child, 60)} is not usable")

    def _refuse(self, reason: str) -> None:
        """Count and report a refused pose; a reason is reported once, until poses are usable."""
        kind = "".join(each for each in reason if not each.isdigit())
        if len(self.refused) < MAX_FRAMES:
            self.refused[reason] = self.refused.get(reason, 0) + 1
        self._reason = reason
        if kind != self._warned:
            _log.warning("poses of the robot are refused: %s", reason, extra=EVENT)
            self._warned = kind


def _name(frame: str) -> str:
    """Return the name of a frame without the leading slash of ROS 1."""
    return frame.removeprefix("/")


def _is_usable(pose: Iterable[float]) -> bool:
    return all(isfinite(each) and abs(each) < _LARGEST for each in pose)
