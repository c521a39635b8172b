"""Timing at the limits: the fastest motion along a path, from rest to rest."""

from __future__ import annotations

from typing import Literal

from omnidrive.planning import SplinePath
from omnidrive.reference.course import Course
from omnidrive.reference.course_timing import time_course
from omnidrive.reference.free_heading import free_heading
from omnidrive.reference.limits import MotionLimits, limit_rows
from omnidrive.reference.timed import TimedReference
from omnidrive.robot import Chassis

Heading = Literal["path", "tangent", "fixed", "free"]
"""The path's own headings; the direction of travel; one heading; the best ones for time."""


def time_within_limits(
    path: SplinePath,
    chassis: Chassis,
    limits: MotionLimits,
    *,
    heading: Heading = "path",
    yaw: float | None = None,
    duration: float | None = None,
) -> TimedReference:
    """Fastest motion along ``path``, from rest to rest, that keeps ``limits``.

    Args:
        path: Where to go; a path that only turns on the spot is one, too.
        chassis: Its wheel matrix and its wheels' top speed.
        limits: All other limits.
        heading: How to head; ``free`` needs the extra ``casadi``.
        yaw: The heading of ``fixed``, in rad; by default the path's first.
        duration: Slow all of the motion down to take this long, in s.

    Raises:
        InvalidInput: A limit or ``yaw`` is not a number that makes sense.
        InvalidReference: The path stands still, has no direction for heading ``tangent``, or
            cannot be followed in ``duration``.
        MissingExtra: Heading ``free`` without CasADi.
    """
    rows = limit_rows(chassis, limits)
    if heading == "free":
        path, heading = free_heading(path, rows), "path"
    reference = time_course(Course.of(path, heading, yaw), rows)
    return reference if duration is None else reference.slowed(duration)
