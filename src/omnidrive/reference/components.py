"""Factories of references, which scenarios name: shapes and waypoint files; and their context."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive.choices import TableHeading
from omnidrive.geometry import Pose
from omnidrive.reference.limit_usage import shortest_duration_within
from omnidrive.reference.reference import Reference
from omnidrive.reference.shape_reference import ORIGIN, ShapeReference
from omnidrive.reference.shapes import (
    Circle,
    Eight,
    RaisedCosine,
    RandomSmooth,
    Shape,
    Slalom,
    Square,
)
from omnidrive.reference.timing.limits import MotionLimits, limit_rows
from omnidrive.reference.waypoint_reference import waypoint_reference
from omnidrive.robot import Robot


@dataclass(frozen=True, slots=True)
class ReferenceContext:
    """Context of a reference, an argument of its factory.

    The factory returns a motion in its natural duration; a study slows it down or speeds it up
    uniformly to the durations of its tasks.

    Attributes:
        robot: Robot that follows the motion.
        start: Pose in W where the motion starts; a motion with positions of its own ignores it.
        max_speed: Largest speed, m/s; None: that of the robot. A study slows a faster motion
            uniformly.
    """

    robot: Robot
    start: Pose = ORIGIN
    max_speed: float | None = None

    @property
    def limits(self) -> MotionLimits:
        """Limits of the robot and of the speed."""
        return MotionLimits.of_robot(self.robot, max_speed=self.max_speed)


@dataclass(frozen=True, kw_only=True, slots=True)
class WaypointFile:
    """Parameters of the reference `waypoints`."""

    file: str
    """CSV, PathPlanner, Choreo or ROS `nav_msgs/Path` file; in a scenario file, its path is
    relative to that file."""
    heading: TableHeading = "tangent"
    """Heading of a CSV table without headings: the direction of travel, or 0 rad."""


def circle(context: ReferenceContext, parameters: Circle) -> ShapeReference:
    """Circle, or several laps of it."""
    return _fastest(context, parameters)


def eight(context: ReferenceContext, parameters: Eight) -> ShapeReference:
    """Figure of eight: lemniscate of Gerono from its crossing."""
    return _fastest(context, parameters)


def square(context: ReferenceContext, parameters: Square) -> ShapeReference:
    """Square with rounded corners, from corner to corner."""
    return _fastest(context, parameters)


def raised_cosine(context: ReferenceContext, parameters: RaisedCosine) -> ShapeReference:
    """Line with a raised-cosine lateral offset."""
    return _fastest(context, parameters)


def slalom(context: ReferenceContext, parameters: Slalom) -> ShapeReference:
    """Slalom of clothoids, which begins to the left."""
    return _fastest(context, parameters)


def random_smooth(context: ReferenceContext, parameters: RandomSmooth) -> ShapeReference:
    """Random smooth closed motion in x, y and heading, reproducible by its seed."""
    return _fastest(context, parameters)


def waypoints(context: ReferenceContext, parameters: WaypointFile) -> Reference:
    """Waypoint file: as timed there, or in the shortest time if it has no times."""
    return waypoint_reference(
        parameters.file, context.robot, heading=parameters.heading, max_speed=context.max_speed
    )


def _fastest(context: ReferenceContext, shape: Shape) -> ShapeReference:
    """Return the motion in the shortest duration within the limits."""
    motion = ShapeReference(shape, 1.0, context.start)
    limits = limit_rows(context.robot.chassis, context.limits)
    return ShapeReference(shape, shortest_duration_within(motion, limits), context.start)
