"""A simulated robot in the graph of ROS 2."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from math import floor, inf, isfinite
from typing import Annotated, Any, Literal, get_args

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.controller import STOP
from omnidrive.estimation import EncoderSettings
from omnidrive.geometry import Pose, compose, inverse, move, wrap
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import Bounds, check_bounds, check_choice
from omnidrive.robot import Robot
from omnidrive.ros2.message import Message, message_type
from omnidrive.ros2.node import Node
from omnidrive.ros2.planar_messages import (
    map_message,
    planar_covariance,
    set_pose,
    set_transform,
    set_twist,
    twist_of,
)
from omnidrive.ros2.qos import LATCHED_QOS, Qos
from omnidrive.ros2.robot_description import robot_description, wheel_joints
from omnidrive.ros2.ros_time import other_time, seconds, stamp
from omnidrive.simulation import Plant, PlantState
from omnidrive.simulation.sensors.encoders import Encoders
from omnidrive.simulation.sensors.lidar import LidarSettings

_log = logging.getLogger("omnidrive")
_SCAN_QOS = Qos(depth=5)
"""Reliable, which also subscriptions of best effort receive, such as those of Nav2."""
CommandType = Literal["Twist", "TwistStamped"]
_ODOMETRY_SIGMAS = (0.01, 0.01, 0.01)  # m, m, rad
_TWIST_SIGMAS = (0.02, 0.02, 0.02)  # m/s, m/s, rad/s


@dataclass(frozen=True, slots=True)
class Ros2RobotSettings:
    """Settings of a simulated robot in the graph.

    Raises:
        InvalidInput: A setting is out of range.
    """

    rate: Annotated[float, Bounds(1.0, 1000.0, "Hz")] = 50.0
    """Rate of steps, odometry, transforms and joint states."""
    speed: Annotated[float, Bounds(0.01, 100.0)] = 1.0
    """Simulated seconds per second."""
    command_timeout: Annotated[float, Bounds(0.01, 3600.0, "s")] = 0.5
    """Age of a command from which the robot stops, as ``cmd_vel_timeout`` of ros2_controllers."""
    command_type: CommandType = "TwistStamped"
    """Type of ``/cmd_vel``: TwistStamped, as of ros2_controllers from Jazzy on, or Twist."""
    localised: bool = True
    """Whether ``/tf`` has the exact transform from ``map`` to ``odom``, as of a localisation."""
    clock: bool = False
    """Whether ``/clock`` is published and stamps are simulated times."""
    scan: LidarSettings = field(default_factory=LidarSettings)
    """Laser scanner, which sees the map."""

    def __post_init__(self) -> None:
        check_bounds(self)
        check_choice("type of /cmd_vel", self.command_type, get_args(CommandType))


class Ros2Robot:
    """A plant that takes commands from the graph and publishes what a robot does.

    It subscribes to ``/cmd_vel`` and publishes ``/odom`` (dead reckoning by wheel encoders, which
    drifts with slip), ``/tf`` (``odom`` to ``base_link``, and ``map`` to ``odom`` such that the
    pose in the map is exact), ``/joint_states``, ``/robot_description``, and with a map ``/map``
    and ``/scan``.

    Args:
        node: The node; the caller closes it.
        plant: The plant; the caller closes it.
        robot: The robot.
        start: Pose at the start, in W, the frame ``map``.
        settings: Rates and types.
        grid: Map that the scanner sees; None: no scanner. Walls around it are published as cells.
        rng: Generator of the scanner's noise.

    Attributes:
        commands: Number of commands that were executed.
        refused: Number of commands that were not: not finite, or too old.
        skipped: Number of steps that were left out because an earlier one took too long.
    """

    def __init__(
        self,
        node: Node,
        plant: Plant,
        robot: Robot,
        start: Pose,
        *,
        settings: Ros2RobotSettings = Ros2RobotSettings(),
        grid: OccupancyGrid | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        self.node, self.plant, self.robot, self.settings = node, plant, robot, settings
        self.commands = self.refused = self.skipped = 0
        self._grid = None if grid is None else grid.bordered()  # what the scanner sees is on /map
        self._rng = rng or np.random.default_rng(0)
        self._reported: set[str] = set()
        self._dt = 1.0 / settings.rate
        self._steps = 0
        self._began = time.time()
        self._state: PlantState = plant.reset(start)
        self._encoders = Encoders(EncoderSettings(), robot.chassis)
        self._encoders.reset(start)
        self._angles = self._encoders.read(self._state)
        self._speeds: tuple[float, ...] = (0.0,) * len(self._angles)
        self._odometry = Pose(0.0, 0.0, 0.0)
        self._twist = self._command = STOP
        self._commanded = -inf
        self._publishers = self._make_publishers()
        kind = f"geometry_msgs/msg/{settings.command_type}"
        self._subscription = node.subscription("cmd_vel", kind)
        self._publish_latched()

    @property
    def state(self) -> PlantState:
        """True state of the plant."""
        return self._state

    @property
    def now(self) -> float:
        """Time of the stamps, s: simulated time, or that of the computer."""
        return self._steps * self._dt if self.settings.clock else time.time()

    def run(self, duration: float = inf) -> None:
        """Step on absolute deadlines for ``duration`` (simulated s), by default for ever."""
        period = self._dt / self.settings.speed
        begin, first = time.monotonic(), self._steps
        due = 0
        while (self._steps - first) * self._dt < duration - 1e-9:
            self.step()
            due += 1
            wait = begin + due * period - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            elif wait < -period:
                late = floor(-wait / period)
                self.skipped += late
                due += late

    def step(self) -> None:
        """Execute the newest command for one step and publish the result."""
        self._take_command()
        self._state = self.plant.step(self._command, self._dt)
        self._steps += 1
        self._update_odometry()
        self._publish()

    def _take_command(self) -> None:
        """Take the newest command; stop if it is too old."""
        now = self._steps * self._dt
        for received in self._subscription.take():
            message: Any = received.message
            stamped = self.settings.command_type == "TwistStamped"
            twist = twist_of(message.twist if stamped else message)
            sent = seconds(message.header.stamp) if stamped else 0.0
            if not all(map(isfinite, twist)):
                self._refuse("not finite", "it is not finite")
                continue
            if sent != 0.0 and abs(self.now - sent) > self.settings.command_timeout:
                reason = other_time(sent, self.now)
                age = f"its stamp is {abs(self.now - sent):.3g} s "
                age += "old" if sent < self.now else "in the future"
                self._refuse("time" if reason else "age", reason or age)
                continue
            self._command, self._commanded = self.robot.drive.saturate(twist), now
            self.commands += 1
        if now - self._commanded > self.settings.command_timeout:
            self._command = STOP

    def _refuse(self, kind: str, reason: str) -> None:
        """Count a refused command; a reason of each kind is reported once."""
        self.refused += 1
        if kind not in self._reported:
            self._reported.add(kind)
            _log.warning("a command is refused: %s", reason)

    def _update_odometry(self) -> None:
        angles = self._encoders.read(self._state)
        self._speeds = tuple(
            (after - before) / self._dt for after, before in zip(angles, self._angles, strict=True)
        )
        self._angles = angles
        self._twist = self.robot.chassis.twist(self._speeds)
        self._odometry = move(self._odometry, self._twist, self._dt)

    def _make_publishers(self) -> dict[str, Any]:
        kinds = {
            "odom": "nav_msgs/msg/Odometry",
            "/tf": "tf2_msgs/msg/TFMessage",
            "joint_states": "sensor_msgs/msg/JointState",
        }
        made = {name: self.node.publisher(name, kind) for name, kind in kinds.items()}
        if self.settings.clock:
            made["/clock"] = self.node.publisher("/clock", "rosgraph_msgs/msg/Clock")
        if self._grid is not None:
            made["scan"] = self.node.publisher("scan", "sensor_msgs/msg/LaserScan", _SCAN_QOS)
            made["map"] = self.node.publisher("map", "nav_msgs/msg/OccupancyGrid", LATCHED_QOS)
            made["/tf_static"] = self.node.publisher(
                "/tf_static", "tf2_msgs/msg/TFMessage", LATCHED_QOS
            )
        made["robot_description"] = self.node.publisher(
            "robot_description", "std_msgs/msg/String", LATCHED_QOS
        )
        return made

    def _publish_latched(self) -> None:
        """Publish description, map and the place of the scanner, once."""
        made = self._publishers
        text = robot_description(self.robot)
        made["robot_description"].publish(made["robot_description"].message(data=text))
        if self._grid is not None:
            chart = made["map"].message()
            chart.header.frame_id, chart.header.stamp = "map", self._stamp()
            made["map"].publish(map_message(self._grid, chart))
            laser = self._transform(self._stamp(), "base_link", "laser", Pose(0.0, 0.0, 0.0))
            laser.transform.translation.z = self.settings.scan.height
            made["/tf_static"].publish(made["/tf_static"].message(transforms=[laser]))

    def _publish(self) -> None:
        made, now = self._publishers, self._stamp()
        if self.settings.clock:
            made["/clock"].publish(made["/clock"].message(clock=now))
        odometry = made["odom"].message()
        odometry.header.stamp, odometry.header.frame_id = now, "odom"
        odometry.child_frame_id = "base_link"
        set_pose(odometry.pose.pose, self._odometry)
        odometry.pose.covariance = planar_covariance(_ODOMETRY_SIGMAS)
        set_twist(odometry.twist.twist, self._twist)
        odometry.twist.covariance = planar_covariance(_TWIST_SIGMAS)
        made["odom"].publish(odometry)
        transforms = [self._transform(now, "odom", "base_link", self._odometry)]
        if self.settings.localised:
            offset = compose(self._state.pose, inverse(self._odometry))
            transforms.append(self._transform(now, "map", "odom", offset))
        made["/tf"].publish(made["/tf"].message(transforms=transforms))
        joints = made["joint_states"].message()
        joints.header.stamp = now
        joints.name = list(wheel_joints(self.robot))
        joints.position, joints.velocity = np.array(self._angles), np.array(self._speeds)
        made["joint_states"].publish(joints)
        if self._grid is not None and self._is_scan_due():
            made["scan"].publish(self._scan(now))

    def _is_scan_due(self) -> bool:
        """Return whether a multiple of the scanner's period lies within the last step."""
        rate = self.settings.scan.rate
        now, before = self._steps * self._dt, (self._steps - 1) * self._dt
        return floor(now * rate + 1e-9) > floor(before * rate + 1e-9)

    def _scan(self, now: Message) -> Message:
        settings = self.settings.scan
        grid = self._grid
        assert grid is not None
        bearings = settings.bearings
        ranges = scan_ranges(grid, self._state.pose, bearings, settings.max_range)
        noisy = ranges + settings.sigma * self._rng.standard_normal(len(ranges))
        scan: Message = self._publishers["scan"].message()
        scan.header.stamp, scan.header.frame_id = now, "laser"
        scan.angle_min, scan.angle_max = float(bearings[0]), float(bearings[-1])
        scan.angle_increment = float(bearings[1] - bearings[0]) if len(bearings) > 1 else 0.0
        scan.scan_time, scan.range_max = 1.0 / settings.rate, settings.max_range
        scan.ranges = np.maximum(noisy, 0.0).astype(np.float32)
        return scan

    def _stamp(self) -> Message:
        return stamp(self.now, self.node.distribution)

    def _transform(self, now: Message, parent: str, child: str, pose: Pose) -> Message:
        made = message_type("geometry_msgs/msg/TransformStamped", self.node.distribution)()
        made.header.stamp, made.header.frame_id = now, parent
        made.child_frame_id = child
        set_transform(made.transform, pose._replace(yaw=wrap(pose.yaw)))
        return made


def scan_ranges(
    grid: OccupancyGrid, pose: Pose, bearings: Float[Array, " rays"], max_range: float
) -> Float[Array, " rays"]:
    """Return the distances at which rays meet occupied cells, to half a cell; infinite without.

    Args:
        grid: The map.
        pose: Pose of the scanner, in W.
        bearings: Bearing of each ray from the x axis of the scanner, rad.
        max_range: Largest distance of a hit, m.
    """
    distances = np.arange(0.0, max_range, 0.5 * grid.resolution)
    angles = pose.yaw + bearings
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.array([pose.x, pose.y]) + distances[:, None, None] * directions
    hits = grid.occupied_at(points.reshape(-1, 2)).reshape(len(distances), len(bearings))
    first = hits.argmax(axis=0)
    return np.where(hits.any(axis=0), distances[first], np.inf)
