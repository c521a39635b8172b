"""The contents of a log as messages of ROS, for viewers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import cos, hypot, isfinite, sin
from typing import Any, NamedTuple

from omnidrive.control import CommandValue, PipelineStep, Status, WheelSpeeds
from omnidrive.control.supervision import Event
from omnidrive.deploy.drive_state import DriveState, StateChange
from omnidrive.deploy.log.logged_sample import LoggedSample
from omnidrive.estimation import PoseFix, SensorReadings
from omnidrive.geometry import BodyTwist, Pose, wrap
from omnidrive.robot import Robot
from omnidrive.ros2.message import Message, message_type
from omnidrive.ros2.planar_messages import (
    planar_covariance,
    set_pose,
    set_transform,
    set_twist,
)
from omnidrive.ros2.robot_description import wheel_joints

WORLD, BODY = "map", "base_link"
"""Frames W and B (REP 105)."""
TOPICS = {
    "/drive/wheels": "sensor_msgs/msg/JointState",
    "/drive/imu": "sensor_msgs/msg/Imu",
    "/drive/fix": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/drive/estimate": "nav_msgs/msg/Odometry",
    "/drive/reference": "geometry_msgs/msg/PoseStamped",
    "/drive/command": "geometry_msgs/msg/TwistStamped",
    "/drive/wheel_command": "sensor_msgs/msg/JointState",
    "/drive/sent": "geometry_msgs/msg/TwistStamped",
    "/drive/wheels_sent": "sensor_msgs/msg/JointState",
    "/drive/plan": "nav_msgs/msg/Path",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/rosout": "rcl_interfaces/msg/Log",
    "/robot_description": "std_msgs/msg/String",
}
"""Types of the topics for viewers."""
_DIAGNOSTICS_PERIOD = 0.2  # s
_OK, _WARN, _ERROR = 0, 1, 2  # levels of diagnostic_msgs/DiagnosticStatus
_STATUS_LEVELS = {Status.OK: _OK, Status.FALLBACK: _WARN, Status.FAILED: _ERROR}
_INFO_LOG, _WARN_LOG = 20, 30  # levels of rcl_interfaces/Log
_NOT_MEASURED = -1.0  # of the covariances of sensor_msgs/Imu


class Stamped(NamedTuple):
    """One message for viewers."""

    topic: str
    """Topic, one of :data:`TOPICS`."""
    time: int
    """Time, ns, since 1970."""
    message: Message
    """The message; it is used again for the next one on its topic."""


class ViewerMessages:
    """Messages for viewers of one drive.

    Args:
        robot: The robot.
        detail_units: Names and units of the controller's details.
        time_of: Function that returns the time since 1970, ns, of a time on the clock, s.
    """

    def __init__(
        self, robot: Robot, detail_units: Mapping[str, str], time_of: Callable[[float], int]
    ) -> None:
        self._joints = list(wheel_joints(robot))
        self._details = [f"{name} ({unit})" for name, unit in detail_units.items()]
        self._time_of = time_of
        self._messages: dict[str, Any] = {}
        self._diagnosed = -_DIAGNOSTICS_PERIOD

    def plan(self, now: int, poses: list[list[float]]) -> Stamped:
        """Return the poses of the reference, in W, as path."""
        path = self._stamped("/drive/plan", now)
        for pose in poses:
            each: Any = message_type("geometry_msgs/msg/PoseStamped")()
            each.header = path.header
            set_pose(each.pose, Pose(*pose))
            path.poses.append(each)
        return Stamped("/drive/plan", now, path)

    def description(self, now: int, urdf: str) -> Stamped:
        """Return the robot as URDF."""
        return Stamped(
            "/robot_description", now, message_type(TOPICS["/robot_description"])(data=urdf)
        )

    def event(self, now: int, event: Event | StateChange) -> Stamped:
        """Return an event or a change of the state as entry of the log of ROS."""
        entry = self._message("/rosout")
        _set_time(entry.stamp, now)
        entry.level, entry.name = _INFO_LOG, "omnidrive"
        if isinstance(event, StateChange):
            entry.msg = f"{event.state.value}: {event.reason}"
            entry.level = _WARN_LOG if event.state is DriveState.HOLDING else _INFO_LOG
        else:
            entry.msg = event.what
        return Stamped("/rosout", now, entry)

    def sample(self, now: int, due: float, sample: LoggedSample) -> Iterator[Stamped]:
        """Yield the messages of a sample.

        Args:
            now: Time of the sample, ns since 1970.
            due: The same, s since the drive began.
            sample: The sample.
        """
        if sample.read is not None:
            yield from self._readings(now, sample.read)
        if sample.step is not None:
            yield from self._step(now, sample.step)
            yield from self._command(
                now, sample.step.command.value, "/drive/command", "/drive/wheel_command"
            )
        if sample.sent is not None:
            yield from self._command(now, sample.sent, "/drive/sent", "/drive/wheels_sent")
        if due - self._diagnosed >= _DIAGNOSTICS_PERIOD:
            self._diagnosed = due
            yield self._diagnostics(now, sample)

    def _readings(self, now: int, readings: SensorReadings) -> Iterator[Stamped]:
        time = self._time(readings.stamp, now)
        angles, torques = list(readings.wheel_angles), list(readings.wheel_torques)
        if len(self._joints) in {len(angles), len(torques)}:
            wheels = self._stamped("/drive/wheels", time, "")
            wheels.name, wheels.position, wheels.effort = self._joints, angles, torques
            yield Stamped("/drive/wheels", now, wheels)
        if readings.yaw_rate is not None:
            imu = self._stamped("/drive/imu", time, BODY)
            imu.orientation_covariance[0] = imu.linear_acceleration_covariance[0] = _NOT_MEASURED
            imu.angular_velocity.z = readings.yaw_rate
            yield Stamped("/drive/imu", now, imu)
        for fix in readings.fixes:
            yield self._fix(now, fix)

    def _fix(self, now: int, fix: PoseFix) -> Stamped:
        message = self._stamped("/drive/fix", self._time(fix.stamp, now))
        set_pose(message.pose.pose, fix.pose)
        sigma = fix.position_sigma
        message.pose.covariance = planar_covariance((sigma, sigma, fix.yaw_sigma))
        return Stamped("/drive/fix", now, message)

    def _step(self, now: int, step: PipelineStep) -> Iterator[Stamped]:
        state = step.state
        estimate = self._stamped("/drive/estimate", now)
        estimate.child_frame_id = BODY
        set_pose(estimate.pose.pose, state.pose)
        covariance = estimate.pose.covariance
        covariance[:] = 0.0
        if state.covariance is not None:  # ROS wants it in the axes of W (REP 103)
            _set_planar(covariance, state.covariance.tolist(), state.pose.yaw)
        set_twist(estimate.twist.twist, state.twist or BodyTwist(0.0, 0.0, 0.0))
        yield Stamped("/drive/estimate", now, estimate)
        target = self._stamped("/drive/reference", now)
        set_pose(target.pose, step.target)
        yield Stamped("/drive/reference", now, target)
        frames = self._message("/tf")
        if not frames.transforms:
            frames.transforms = [message_type("geometry_msgs/msg/TransformStamped")()]
        frame = frames.transforms[0]
        _set_time(frame.header.stamp, now)
        frame.header.frame_id, frame.child_frame_id = WORLD, BODY
        set_transform(frame.transform, state.pose)
        yield Stamped("/tf", now, frames)

    def _command(
        self, now: int, value: CommandValue, twist_topic: str, wheel_topic: str
    ) -> Iterator[Stamped]:
        if isinstance(value, BodyTwist):
            message = self._stamped(twist_topic, now, BODY)
            set_twist(message.twist, value)
            yield Stamped(twist_topic, now, message)
            return
        message = self._stamped(wheel_topic, now, "")
        message.name = self._joints
        field = "velocity" if isinstance(value, WheelSpeeds) else "effort"
        setattr(message, field, list(value))
        yield Stamped(wheel_topic, now, message)

    def _diagnostics(self, now: int, sample: LoggedSample) -> Stamped:
        """Return state, punctuality, tracking error, and the details of the controller."""
        values = {"late (s)": sample.late, "busy (s)": sample.busy}
        level = _WARN if sample.state is DriveState.HOLDING else _OK
        step = sample.step
        if step is not None:
            pose, target = step.state.pose, step.target
            values |= {
                "position error (m)": hypot(pose.x - target.x, pose.y - target.y),
                "heading error (rad)": abs(wrap(pose.yaw - target.yaw)),
                "age of the pose (s)": step.state.fix_age,
                "step time (us)": step.step_time,
            }
            values |= dict(zip(self._details, step.command.details, strict=False))
            level = max(level, _STATUS_LEVELS[step.command.status])
        pair = message_type("diagnostic_msgs/msg/KeyValue")
        message = self._stamped("/diagnostics", now, "")
        message.status = [
            message_type("diagnostic_msgs/msg/DiagnosticStatus")(
                level=level,
                name="omnidrive: drive",
                message=sample.state.value,
                values=[pair(key=key, value=f"{value:.9g}") for key, value in values.items()],
            )
        ]
        return Stamped("/diagnostics", now, message)

    def _time(self, stamp: float, now: int) -> int:
        """Return the time of a reading, ns since 1970; ``now`` if its stamp is not usable."""
        time = self._time_of(stamp) if isfinite(stamp) and abs(stamp) < 2.0**31 else -1
        return time if 0 <= time < 10**9 * 2**31 else now

    def _message(self, topic: str) -> Any:
        """Return the message of a topic, with the values of the last one."""
        if topic not in self._messages:
            self._messages[topic] = message_type(TOPICS[topic])()
        return self._messages[topic]

    def _stamped(self, topic: str, time: int, frame: str = WORLD) -> Any:
        message = self._message(topic)
        _set_time(message.header.stamp, time)
        message.header.frame_id = frame
        return message


def _set_time(stamp: Any, time: int) -> None:
    stamp.sec, stamp.nanosec = divmod(time, 10**9)


def _set_planar(out: Any, body: list[list[float]], yaw: float) -> None:
    """Write a covariance of x, y and yaw in B into the 36 numbers of ROS, in the axes of W."""
    c, s = cos(yaw), sin(yaw)
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = body
    out[0] = c * c * xx - 2.0 * c * s * xy + s * s * yy
    out[1] = out[6] = c * s * (xx - yy) + (c * c - s * s) * xy
    out[7] = s * s * xx + 2.0 * c * s * xy + c * c * yy
    out[5] = out[30] = c * xt - s * yt
    out[11] = out[31] = s * xt + c * yt
    out[35] = tt
