"""Localisation by laser scans on the map, for robots without another one."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from typing import Any, NamedTuple

from omnidrive.errors import InvalidMap, one_line
from omnidrive.estimation.scan_matching import ScanMatch, find_scan, match_scan, scan_points
from omnidrive.geometry import BodyTwist, Pose, compose, inverse, move, twist_between
from omnidrive.maps import OccupancyGrid
from omnidrive.ros2.node import Node, Subscription
from omnidrive.ros2.planar_messages import grid_of, pose_of
from omnidrive.ros2.qos import LATCHED_QOS, SENSOR_QOS
from omnidrive.ros2.ros_time import seconds
from omnidrive.ros2.transform_tree import Frames, TransformTree

_log = logging.getLogger("omnidrive")
_FAR = 0.2  # s; longest time from a scan to the odometry before and after it
_LARGEST = 1e6  # m


class StampedPose(NamedTuple):
    """A pose at a time."""

    stamp: float
    """In s."""
    pose: Pose


class Correction(NamedTuple):
    """Pose of the odometry frame in the world frame, by one scan."""

    stamp: float
    """Time of the scan, s."""
    pose: Pose
    """Pose of the odometry frame in W; m, m, rad."""
    sigmas: tuple[float, float]
    """Standard deviations of the robot's position, m, and yaw, rad."""


@dataclass
class ScanLocalisation:
    """Corrects odometry by matching ``/scan`` with ``/map``, from an initial pose on.

    The initial pose is given, or comes on ``/initialpose``, where RViz publishes it for AMCL; it
    is searched within 0.4 m along each axis and 0.4 rad. The mounting of the scanner comes from
    ``/tf_static``.

    Attributes:
        node: The node.
        frames: Names of the frames.
        scan_topic: Topic of the scans.
        map_topic: Topic of the map.
        initial: Initial pose of the robot in W that is not used yet; None: not known, or used.
        fault: Why the last scan did not localise the robot; empty: it did, or none arrived.
    """

    node: Node
    frames: Frames
    scan_topic: str = "/scan"
    map_topic: str = "/map"
    initial: Pose | None = None
    fault: str = ""
    _offset: Pose | None = None
    """Pose of the odometry frame in W."""
    _grid: OccupancyGrid | None = None
    _scans: Subscription = field(init=False)
    _maps: Subscription = field(init=False)
    _initials: Subscription = field(init=False)

    def __post_init__(self) -> None:
        subscribe, posed = self.node.subscription, "geometry_msgs/msg/PoseWithCovarianceStamped"
        self._scans = subscribe(self.scan_topic, "sensor_msgs/msg/LaserScan", SENSOR_QOS)
        self._maps = subscribe(self.map_topic, "nav_msgs/msg/OccupancyGrid", LATCHED_QOS)
        self._initials = subscribe("/initialpose", posed)

    def correct(self, odometry: Sequence[StampedPose], tree: TransformTree) -> Correction | None:
        """Return the correction by the newest scan; None: no scan is new, or it does not fit.

        Args:
            odometry: Poses of the robot in the odometry frame, oldest first.
            tree: Transforms, with the mounting of the scanner.
        """
        self._take_map()
        self._take_initial()
        if self.initial is None and self._offset is None:
            self._scans.take_raw()
            self.fault = "no initial pose: publish it on /initialpose, or give --initial-pose"
            return None
        scan: Any = self._scans.latest()
        if scan is None:
            return None
        stamp = seconds(scan.header.stamp)
        found = self._match(scan, stamp, odometry, tree)
        if found is None:
            return None
        then, match = found
        if not match.is_usable:
            self.fault = f"{match.share:.0%} of the rays of a scan end at walls of the map"
            return None
        self.fault, self.initial = "", None
        self._offset = compose(match.pose, inverse(then))
        return Correction(stamp, self._offset, (match.position_sigma, match.yaw_sigma))

    def forget(self) -> None:
        """Discard the pose and what has arrived, because another localisation is at work.

        When that ends, a pose of long ago is no initial pose.
        """
        self.initial = self._offset = None
        self._initials.take_raw()
        self._scans.take_raw()

    def _match(
        self,
        scan: Any,
        stamp: float,
        odometry: Sequence[StampedPose],
        tree: TransformTree,
    ) -> tuple[Pose, ScanMatch] | None:
        """Return the odometry at a scan and the match; None: there is none, :attr:`fault` is why.

        The motion of the robot while the scanner turns is taken from odometry.
        """
        frame = one_line(scan.header.frame_id.removeprefix("/"), 60)
        mount = tree.pose(frame, self.frames.base)
        sweep = float(scan.time_increment) * len(scan.ranges)
        sweep = sweep if 0.0 < sweep < 1.0 else 0.0
        then, after = odometry_at(odometry, stamp), odometry_at(odometry, stamp + sweep)
        if self._grid is None:
            self.fault = f"no map on {self.map_topic}"
        elif mount is None or not tree.is_level(frame):
            state = "not connected to" if mount is None else "not level with"
            self.fault = f"the scanner's frame {frame} is {state} {self.frames.base}"
        elif then is None:
            self.fault = "no odometry at the time of the scan"
        elif not all(map(isfinite, (scan.angle_min, scan.angle_increment))):
            self.fault = f"{self.scan_topic} has bearings that are not finite"
        else:
            twist = BodyTwist(0.0, 0.0, 0.0)
            if sweep > 0.0 and after is not None:
                twist = twist_between(then, after, sweep)
            points = scan_points(
                scan.ranges.astype(float),
                scan.angle_min,
                scan.angle_increment,
                (scan.range_min, min(scan.range_max, _LARGEST)),
                mount,
                motion=(sweep / max(len(scan.ranges), 1), twist),
            )
            if self.initial is not None:
                match = find_scan(self._grid, points, self.initial)
            else:
                assert self._offset is not None
                match = match_scan(self._grid, points, compose(self._offset, then))
            if match is not None:
                return then, match
            self.fault = f"{len(points)} rays of a scan hit something, or the map has no walls"
        return None

    def _take_map(self) -> None:
        """Take over a new map; its unknown cells are no walls."""
        message: Any = self._maps.latest()
        if message is None:
            return
        try:
            self._grid = replace(grid_of(message, unknown_occupied=False), walled=False)
        except InvalidMap as error:
            _log.warning("%s: %s", self.map_topic, error)

    def _take_initial(self) -> None:
        message: Any = self._initials.latest()
        if message is None:
            return
        pose, frame = pose_of(message.pose.pose), message.header.frame_id.removeprefix("/")
        if frame == self.frames.world and all(isfinite(a) and abs(a) < _LARGEST for a in pose):
            self.initial = pose
        else:
            _log.warning(
                "/initialpose in the frame %s, need finite numbers in %s",
                one_line(frame, 60),
                self.frames.world,
            )


def odometry_at(odometry: Sequence[StampedPose], stamp: float) -> Pose | None:
    """Return the pose at a time, s, between those of odometry; None: none is within 0.2 s."""
    before: StampedPose | None = None
    after: StampedPose | None = None
    for each in reversed(odometry):
        if each.stamp <= stamp:
            before = each
            break
        after = each
    before_age, after_age = (
        abs(each.stamp - stamp) if each is not None else inf for each in (before, after)
    )
    if min(before_age, after_age) > _FAR:
        return None
    if before is None or after is None or max(before_age, after_age) > _FAR:
        near = before if before_age <= after_age else after
        return near.pose if near is not None else None
    share = (stamp - before.stamp) / (after.stamp - before.stamp)
    return move(before.pose, twist_between(before.pose, after.pose, 1.0), share)
