"""Link to a robot in a graph of ROS 2."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from math import isfinite
from typing import Annotated, Any, Literal

from omnidrive.control import CommandValue
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import Clock
from omnidrive.deploy.robot_link import LinkCapabilities, LinkLost
from omnidrive.deploy.ros2.command_rivals import CommandRivals
from omnidrive.deploy.ros2.pose_source import PoseSource
from omnidrive.deploy.ros2.scan_localisation import ScanLocalisation
from omnidrive.errors import InvalidInput
from omnidrive.estimation import SensorReadings
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import Bounds, check_bounds, check_choice
from omnidrive.robot import Robot
from omnidrive.ros2.names import resolve
from omnidrive.ros2.node import Node, Publisher, Subscription
from omnidrive.ros2.planar_messages import set_twist
from omnidrive.ros2.qos import SENSOR_QOS
from omnidrive.ros2.ros_time import RosClock, stamp
from omnidrive.ros2.transform_tree import Frames

_log = logging.getLogger("omnidrive")
_LISTENING_TIME = 0.25
"""Time for which the commands of other publishers are waited for at the first opening, s."""
_TYPES = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist")


@dataclass(frozen=True, slots=True)
class Ros2LinkSettings:
    """Topics and frames of a robot in a graph of ROS 2.

    Raises:
        InvalidInput: A setting is out of range.
    """

    frames: Frames = field(default_factory=Frames)
    """Names of the frames."""
    cmd_vel: str = "/cmd_vel"
    """Topic of commands."""
    command_type: Literal["Twist", "TwistStamped"] | None = None
    """Type of commands; None: that of the robot's subscription."""
    allowed_publishers: tuple[str, ...] = ()
    """Nodes that may send commands besides the drive, such as ``/collision_monitor``."""
    odom: str = "/odom"
    """Topic of odometry."""
    localisation: str = "/amcl_pose"
    """Topic of the pose in the world frame, if ``/tf`` does not give it."""
    map: str = "/map"
    """Topic of the map for the localisation by scans."""
    scan: str = "/scan"
    """Topic of laser scans, which localise the robot if nothing else does."""
    initial_pose: Pose | None = None
    """Pose in W from which scans localise the robot; None: that of ``/initialpose``."""
    joint_states: str = "/joint_states"
    """Topic of the wheels' angles."""
    wheel_joints: tuple[str, ...] = ()
    """Names of the wheels' joints, in the order of ``robot.mounts``; empty: no wheel angles."""
    use_sim_time: bool = False
    """Whether the time is that of ``/clock``."""
    watchdog: Annotated[float, Bounds(0.01, 60.0, "s")] = 0.5
    """Time without a command after which the robot stops by itself: ``cmd_vel_timeout`` of
    ros2_controllers, whose default this is."""
    timeout: Annotated[float, Bounds(0.1, 600.0, "s")] = 10.0
    """Time for which the robot is waited for, s."""

    def __post_init__(self) -> None:
        check_bounds(self)
        if self.command_type is not None:
            check_choice("command type", self.command_type, ("Twist", "TwistStamped"))


class Ros2Link:
    """A robot that takes twists on ``/cmd_vel`` and reports its pose in the graph.

    A command of another node is an error: one program drives the robot. Publishers that are idle
    do not disturb. If poses or the robot's subscription are lost, no readings arrive, and a drive
    holds the robot.

    Args:
        node: The node; the caller closes it.
        robot: The robot.
        settings: Topics and frames.

    Raises:
        InvalidInput: The number of wheel joints is not that of the wheels, or the topic of commands
            or an allowed node has no name of ROS 2.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        settings: Ros2LinkSettings = Ros2LinkSettings(),
    ) -> None:
        if settings.wheel_joints and len(settings.wheel_joints) != len(robot.mounts):
            raise InvalidInput(
                f"{len(settings.wheel_joints)} wheel joints, but the robot has "
                f"{len(robot.mounts)} wheels"
            )
        self.node, self._robot, self.settings = node, robot, settings
        self.ros_clock = RosClock(node, simulated=settings.use_sim_time)
        frames, scan = settings.frames, settings.scan
        self.scans = ScanLocalisation(node, frames, scan, settings.map, settings.initial_pose)
        topics = settings.odom, settings.localisation
        self.poses = PoseSource(node, robot, frames, self.ros_clock.now, *topics, self.scans)
        self._clock: Clock | None = None
        self._commands: Publisher | None = None
        self._rivals: CommandRivals | None = None
        self._allowed = {resolve(f"/{n.strip('/')}") for n in settings.allowed_publishers}
        self._topic = resolve(settings.cmd_vel, node.namespace, node=node.name)
        self._joints: Subscription | None = None
        if settings.wheel_joints:
            self._joints = node.subscription(
                settings.joint_states, "sensor_msgs/msg/JointState", SENSOR_QOS
            )
        self._angles: tuple[float, ...] = ()
        self.sent: BodyTwist = STOP
        """The last command."""

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def capabilities(self) -> LinkCapabilities:
        """It takes twists and measures the pose; the robot has a watchdog."""
        return LinkCapabilities(self.settings.watchdog, measures_pose=True)

    def open(self, clock: Clock) -> None:
        """Wait for the robot and find the type of its commands.

        Raises:
            LinkLost: No robot is found, or another node commands it.
        """
        self._clock = clock
        if self._commands is None:
            commands = self.node.publisher(self._topic, self._command_type())
            self._commands = commands
            self._rivals = CommandRivals(self.node, commands, self._allowed)
            self.node.wait_for(lambda: self._robots() > 0, self.settings.timeout)
            self._note_rivals(self._rivals)
        elif self._rivals is not None:
            self._rivals.forget()
        if self.settings.use_sim_time and not self.node.wait_for(
            lambda: self.ros_clock.now() is not None, self.settings.timeout
        ):
            raise LinkLost(
                f"no time on /clock within {self.settings.timeout:g} s: start the simulation, or "
                "leave out --use-sim-time"
            )

    def read(self) -> SensorReadings | None:
        """Return the newest pose and wheel angles; None: no new pose arrived.

        Raises:
            LinkLost: Another node sends commands.
        """
        self._check_rivals()
        self._read_joints()
        if self._robots() == 0:
            return None
        fix = self.poses.read()
        clock, now = self._opened(), self.ros_clock.now()
        if fix is None or now is None:
            return None
        here = clock.now()
        fix = fix._replace(stamp=fix.stamp + here - now)
        return SensorReadings(here, self._angles, (), None, (fix,))

    @property
    def fault(self) -> str:
        """Why no poses arrive, in one line; empty: not known."""
        if self._robots() == 0:
            return f"nothing subscribes to {self._topic} any more"
        return self.poses.fault

    def send(self, value: CommandValue) -> None:
        """Publish a body twist.

        Raises:
            InvalidInput: It is no body twist, or not finite.
        """
        if not isinstance(value, BodyTwist) or not all(map(isfinite, value)):
            raise InvalidInput(f"{self._topic} takes finite body twists, got {value}")
        if self._commands is None:
            return
        self.sent = value
        message: Any = self._commands.message()
        if self._commands.type == _TYPES[0]:
            message.header.stamp = stamp(self.ros_clock.now() or 0.0, self.node.distribution)
            message.header.frame_id = self.settings.frames.base
            set_twist(message.twist, value)
        else:
            set_twist(message, value)
        self._commands.publish(message)

    def stop(self) -> None:
        """Command zero speed."""
        self.send(STOP)

    def close(self) -> None:
        """Stop the robot; the node stays in the graph, and the link can be opened again."""
        self.stop()
        if self._commands is not None:
            self._commands.wait_until_received(0.2)

    def _opened(self) -> Clock:
        if self._clock is None:
            raise LinkLost("the link is not open")
        return self._clock

    def _command_type(self) -> str:
        """Return the type of the robot's subscription.

        Raises:
            LinkLost: Nothing subscribes to the topic, or with another type.
        """
        topic = self._topic
        if self.settings.command_type is not None:
            return f"geometry_msgs/msg/{self.settings.command_type}"
        end = time.monotonic() + self.settings.timeout
        seen: set[str] = set()
        while time.monotonic() < end:
            seen = {each.type for each in self.node.graph().subscriptions(topic)}
            for kind in _TYPES:
                if kind in seen:
                    return kind
            time.sleep(0.02)
        if seen:
            raise LinkLost(f"{topic} is {', '.join(sorted(seen))}, need Twist or TwistStamped")
        raise LinkLost(
            f"nothing subscribes to {topic} in domain {self.node.domain} within "
            f"{self.settings.timeout:g} s: start the robot, or see: omnidrive ros2 doctor"
        )

    def _robots(self) -> int:
        """Return the number of subscriptions of the commands, without that of this link."""
        return self._commands.matched - 1 if self._commands else 0

    def _note_rivals(self, rivals: CommandRivals) -> None:
        """Note other publishers of commands, and raise LinkLost if one is not idle."""
        names = rivals.names()
        if names:
            end = time.monotonic() + _LISTENING_TIME
            while time.monotonic() < end:
                self._check_rivals()
                time.sleep(0.01)
            _log.warning(
                "%s can also command %s: a drive ends when one of them does",
                ", ".join(names),
                self._topic,
            )

    def _check_rivals(self) -> None:
        """Raise LinkLost if another node has sent a command."""
        name = self._rivals.heard() if self._rivals is not None else ""
        if name:
            allow = f", or allow it: --allow-publisher {name}" if name.startswith("/") else ""
            raise LinkLost(
                f"{name} also commands {self._topic}: stop it, one program drives the robot{allow}"
            )

    def _read_joints(self) -> None:
        """Take over the newest angles of the wheels."""
        message: Any = self._joints.latest() if self._joints is not None else None
        if message is None:
            return
        found = dict(zip(message.name, message.position.tolist(), strict=False))
        angles = tuple(found.get(name, float("nan")) for name in self.settings.wheel_joints)
        self._angles = angles
