"""Timing at the limits: the fastest motion along a path, from rest to rest."""

from __future__ import annotations

from typing import Literal

import numpy as np

from omnidrive.errors import InvalidReference
from omnidrive.geometry import wrap
from omnidrive.planning import SplinePath
from omnidrive.reference.course import Course, FixedHeading
from omnidrive.reference.course_timing import time_course
from omnidrive.reference.free_heading import free_heading
from omnidrive.reference.heading_guess import check_end_headings
from omnidrive.reference.limits import MotionLimits, limit_rows
from omnidrive.reference.timed import TimedReference
from omnidrive.robot import Chassis

Heading = Literal["path", "tangent", "fixed", "free"]
"""The path's own headings; the direction of travel; one heading; the best ones for time."""

_SAME = 1e-6
"""In rad: headings that differ by less are the same."""


def time_within_limits(
    path: SplinePath,
    chassis: Chassis,
    limits: MotionLimits,
    *,
    heading: Heading = "path",
    yaw: float | None = None,
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
    duration: float | None = None,
) -> TimedReference:
    """Fastest motion along ``path``, from rest to rest, that keeps ``limits``.

    Args:
        path: Where to go; a path that only turns on the spot is one, too.
        chassis: Its wheel matrix and its wheels' top speed.
        limits: All other limits.
        heading: How to head; ``free`` needs the extra ``casadi``.
        yaw: The heading of ``fixed``, in rad; by default that of the start or, where it is open,
            of the goal, or else the path's first.
        start_yaw: Heading at the start, in rad, modulo whole turns; None leaves it open.
        goal_yaw: Heading at the goal, likewise.
        duration: Slow all of the motion down to take this long, in s.

    Raises:
        InvalidInput: A limit or a heading is not a number that makes sense.
        InvalidReference: The path stands still, has no direction for heading ``tangent``, cannot
            be followed in ``duration``, or does not head as asked at an end.
        MissingExtra: Heading ``free`` without CasADi.
    """
    rows = limit_rows(chassis, limits)
    check_end_headings(start_yaw, goal_yaw)
    way: FixedHeading = "path" if heading == "free" else heading
    if heading == "free":
        path = free_heading(path, rows, start_yaw, goal_yaw)
    elif heading == "fixed" and yaw is None:
        yaw = goal_yaw if start_yaw is None else start_yaw
    course = Course.of(path, way, yaw)
    _check_ends(course, heading, (start_yaw, goal_yaw))
    reference = time_course(course, rows)
    return reference if duration is None else reference.slowed(duration)


def _check_ends(course: Course, heading: Heading, asked: tuple[float | None, float | None]) -> None:
    """Refuse a course that does not head as asked at its ends."""
    ends = np.array([0, len(course.pieces) - 1])
    headings = course.at(ends, np.array([0.0, 1.0])).poses[:, 2].tolist()
    for name, own, wanted in zip(("start", "goal"), headings, asked, strict=True):
        if wanted is not None and abs(wrap(own - wanted)) > _SAME:
            raise InvalidReference(
                f"with heading '{heading}' the robot heads to {wrap(own):.3f} rad at the {name}, "
                f"not to the {wanted:.3f} rad asked for; choose heading 'free', or 'path' along a "
                f"path that heads so, or leave the heading at the {name} open"
            )
