"""Motions along the waypoints of a file."""

from __future__ import annotations

import pathlib
from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.choices import TableHeading
from omnidrive.errors import InvalidReference, one_line
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.planning import Path, SplinePath
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.reference.timing.limited_reference import LimitedReference
from omnidrive.reference.timing.limits import MotionLimits, SectionLimit, limit_rows
from omnidrive.reference.timing.path_timing import time_within_limits
from omnidrive.reference.timing.piecewise_path import PiecewisePath
from omnidrive.reference.timing.time_parameterization import PathSections, time_optimal_reference
from omnidrive.reference.waypoint_motion import load_motion_problem
from omnidrive.reference.waypoint_motion.pathplanner_problem import waypoint_places
from omnidrive.reference.waypoints import load_waypoints
from omnidrive.reference.waypoints.field import read_json
from omnidrive.reference.waypoints.pathplanner import curve_poses
from omnidrive.robot import Robot

_SPACING = 0.05
"""Distance between control points, in m."""

_MIN_POINTS, _MAX_POINTS = 8, 2001
"""Smallest and largest number of control points; a path of more than 100 m has a wider spacing."""

_MAX_LENGTH = 1000.0
"""Greatest length of a path, in m; with the greatest number of control points, the
corners of a longer one would be rounded by more than 0.3 m."""

_LEVER = 0.3
"""Distance that counts as much as a turn by 1 rad, in m."""


def waypoint_reference(
    file: StrPath,
    robot: Robot,
    *,
    heading: TableHeading = "tangent",
    max_speed: float | None = None,
) -> SampledReference | LimitedReference:
    """Return the motion of a waypoint file.

    A file with times is interpolated, see :class:`SampledReference`. A file without times is
    followed from rest to rest in the shortest time within the limits of the robot, see
    :func:`spline_along` and :meth:`MotionLimits.of_robot`, and within those of a PathPlanner file:
    its limits, those of its zones, and its stops.

    Args:
        file: Waypoint file, see :func:`load_waypoints`.
        robot: Robot whose limits hold on a path without times.
        heading: Heading of a table without headings, see :func:`load_waypoints`.
        max_speed: Largest speed on a path without times, m/s; None: that of the robot.

    Raises:
        InvalidReference: The file is missing or malformed, or a path without times is longer than
            1 km or cannot be timed.
    """
    found = load_waypoints(file, heading=heading)
    if isinstance(found, SampledReference):
        return found
    try:
        spline = spline_along(found)
    except InvalidReference as error:
        raise InvalidReference(f"{one_line(str(file))}: {error}") from None
    limits = MotionLimits.of_robot(robot, max_speed=max_speed)
    if to_path(file).suffix.lower() != ".path":
        return time_within_limits(spline, robot.chassis, limits)
    path, rows = PiecewisePath.of(spline), limit_rows(robot.chassis, limits)
    sections = _sections_of(to_path(file), len(path.pieces), len(spline.control_points))
    return time_optimal_reference(path, rows, sections=sections)


def _sections_of(file: pathlib.Path, pieces: int, points: int) -> PathSections:
    """Return the limits of a PathPlanner file on its spline, and the stops at starts of pieces.

    Control point i of :func:`spline_along` is nearest to knot i - 1 of the spline. The limits hold
    on one piece of the spline more, on both sides.
    """
    root = read_json(file)
    problem, (parameters, poses) = load_motion_problem(file), curve_poses(root)
    distance = _distances(poses)
    at = np.interp(waypoint_places(root), parameters, distance) / distance[-1] * (points - 1) - 1.0
    scale = pieces // (points - 3)
    limits = tuple(
        SectionLimit(
            limit,
            scale * max(float(at[section.first]) - 1.0, 0.0),
            scale * min(float(at[section.last]) + 1.0, points - 3.0),
        )
        for number, section in enumerate(problem.sections)
        for limit in section.limit_rows(number)
    )
    stops = {round(scale * s) for s, w in zip(at, problem.waypoints, strict=True) if w.stop}
    return PathSections(limits, tuple(sorted(s for s in stops if 0 < s < pieces)))


def spline_along(path: Path) -> SplinePath:
    """Return a spline along the polyline through the poses.

    Its control points lie on the polyline at equal distances of at most 0.05 m up to 100 m of
    length, where a turn by 1 rad counts as 0.3 m. It deviates by at most 0.03 m, at corners, which
    are rounded. Both distances grow in proportion to the length beyond. The robot turns on the
    spot where the path does.

    Raises:
        InvalidReference: The path is longer than 1 km.
    """
    distance = _distances(path.poses)
    if distance[-1] > _MAX_LENGTH:
        raise InvalidReference(
            f"the path is {distance[-1]:,.0f} m long (1 rad counts as {_LEVER:g} m), need at most "
            f"{_MAX_LENGTH:,.0f} m; split it, or check the unit of its numbers"
        )
    count = min(max(ceil(distance[-1] / _SPACING) + 1, _MIN_POINTS), _MAX_POINTS)
    at = np.linspace(0.0, distance[-1], count)
    columns = [np.interp(at, distance, column) for column in path.poses.T]
    return SplinePath(np.column_stack(columns))


def _distances(poses: Float[Array, "poses 3"]) -> Float[Array, " poses"]:
    """Return the distance of each pose from the first, in m, where a turn by 1 rad is 0.3 m."""
    moves = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    turns = np.abs(np.diff(poses[:, 2]))
    return np.concatenate([[0.0], np.cumsum(moves + _LEVER * turns)])
