"""What a drive publishes besides commands: tracking error, local plan, markers."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from math import hypot, inf
from typing import Any

from omnidrive.control import Pipeline, PipelineStep
from omnidrive.control.controller import Status
from omnidrive.estimation import SensorReadings
from omnidrive.geometry import Pose, wrap
from omnidrive.reference import Reference
from omnidrive.ros2.message import Message, message_type
from omnidrive.ros2.node import Node
from omnidrive.ros2.planar_messages import set_pose
from omnidrive.ros2.ros_time import RosClock, stamp

_PERIOD = 0.2  # s
_AHEAD, _POINTS = 2.0, 20  # s
_REPEATED = 1.0  # s
OK, WARN, ERROR = range(3)
"""Levels of ``diagnostic_msgs/msg/DiagnosticStatus``."""
_LEVELS = {Status.OK: OK, Status.FALLBACK: WARN}


class DriveReports:
    """Publishers of a drive's progress: ``/diagnostics``, ``/local_plan`` and ``/markers``.

    ``/diagnostics`` has the tracking error, the age of the pose and the status of the controller,
    and the state of the drive: why the last one ended, or why a path is not driven. ``/local_plan``
    has the reference in the next two seconds, ``/markers`` the reference pose.

    Args:
        node: The node.
        clock: Time of the stamps.
        world: Name of the frame W.
    """

    def __init__(self, node: Node, clock: RosClock, world: str) -> None:
        self._node, self._clock, self._world = node, clock, world
        self._diagnostics = node.publisher("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        self._plan = node.publisher("local_plan", "nav_msgs/msg/Path")
        self._markers = node.publisher("markers", "visualization_msgs/msg/MarkerArray")
        self._state = OK, "waiting"
        self._published = -inf

    def report(self, level: int, message: str) -> None:
        """Publish the state of the drive: a level, and why in one line."""
        self._state = level, message
        self._publish_statuses([self._drive_status()])

    def begin(self) -> None:
        """Note that a drive begins; :meth:`publish` reports it."""
        self._state = OK, "driving"

    def repeat(self) -> None:
        """Publish the last state of the drive again, once a second."""
        if time.monotonic() - self._published > _REPEATED:
            self._publish_statuses([self._drive_status()])

    def publish(self, t: float, step: PipelineStep, reference: Reference) -> None:
        """Publish the progress at ``t`` (s) of the reference."""
        self._publish_statuses([self._tracking_status(step), self._drive_status()])
        now = self._now()
        if self._plan.matched:
            times = [t + _AHEAD * k / _POINTS for k in range(_POINTS + 1)]
            poses = [reference.at(min(each, reference.duration)).pose for each in times]
            self._plan.publish(self.path(now, poses))
        if self._markers.matched:
            self._markers.publish(self._markers.message(markers=[self._arrow(now, step.target)]))

    def path(self, now: Message, poses: list[Pose]) -> Message:
        """Return poses in W as ``nav_msgs/msg/Path``."""
        path: Message = self._plan.message()
        path.header.stamp, path.header.frame_id = now, self._world
        for pose in poses:
            each: Any = message_type("geometry_msgs/msg/PoseStamped", self._node.distribution)()
            each.header = path.header
            set_pose(each.pose, pose)
            path.poses.append(each)
        return path

    def _now(self) -> Message:
        return stamp(self._clock.now() or 0.0, self._node.distribution)

    def _publish_statuses(self, statuses: list[Message]) -> None:
        self._published = time.monotonic()
        message = self._diagnostics.message(status=statuses)
        message.header.stamp = self._now()
        self._diagnostics.publish(message)

    def _drive_status(self) -> Message:
        level, text = self._state
        make = message_type("diagnostic_msgs/msg/DiagnosticStatus", self._node.distribution)
        return make(level=level, name=f"{self._node.name}: drive", message=text)

    def _tracking_status(self, step: PipelineStep) -> Message:
        pose, target = step.state.pose, step.target
        make = message_type("diagnostic_msgs/msg/KeyValue", self._node.distribution)
        values = {
            "position error (m)": hypot(pose.x - target.x, pose.y - target.y),
            "heading error (rad)": abs(wrap(pose.yaw - target.yaw)),
            "age of the pose (s)": step.state.fix_age,
            "step time (us)": step.step_time,
        }
        return message_type("diagnostic_msgs/msg/DiagnosticStatus", self._node.distribution)(
            level=_LEVELS.get(step.command.status, ERROR),
            name=f"{self._node.name}: tracking",
            message=step.command.message.partition("\n")[0] or step.command.status.name.lower(),
            values=[make(key=key, value=f"{value:.6g}") for key, value in values.items()],
        )

    def _arrow(self, now: Message, pose: Pose) -> Message:
        """Return an arrow at the reference pose."""
        arrow = message_type("visualization_msgs/msg/Marker", self._node.distribution)()
        arrow.header.stamp, arrow.header.frame_id = now, self._world
        arrow.ns, arrow.id = self._node.name, 0
        set_pose(arrow.pose, pose)
        arrow.scale.x, arrow.scale.y, arrow.scale.z = 0.3, 0.05, 0.05
        arrow.color.g = arrow.color.a = 1.0
        return arrow


@dataclass(slots=True)
class ReportedPipeline(Pipeline):
    """A pipeline whose progress is published five times a second.

    Attributes:
        reports: Publishers; None: nothing is published.
    """

    reports: DriveReports | None = None
    _due: float = field(default=-inf, init=False, repr=False)

    def reset(self, pose: Pose) -> None:
        """Start a run, see :class:`Pipeline`."""
        self._due = -inf
        Pipeline.reset(self, pose)

    def step(
        self,
        t: float,
        readings: SensorReadings,
        reference: Reference,
        dt: float,
        *,
        late: bool = False,
    ) -> PipelineStep:
        """Compute the command, see :class:`Pipeline`, and publish the progress if it is due."""
        step = Pipeline.step(self, t, readings, reference, dt, late=late)
        if self.reports is not None and t >= self._due:
            self._due = t + _PERIOD
            self.reports.publish(t, step, reference)
        return step
