"""Problems of minimum time through waypoints in files of other programs."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive.errors import InvalidInput, InvalidReference, one_line, short_repr
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.reference.waypoint_motion.choreo_problem import choreo_problem
from omnidrive.reference.waypoint_motion.pathplanner_problem import pathplanner_problem
from omnidrive.reference.waypoint_motion.waypoint import MotionWaypoint, Section
from omnidrive.reference.waypoints.field import read_json


@dataclass(frozen=True, slots=True)
class MotionProblem:
    """Arguments of :func:`minimum_time_through`.

    Attributes:
        waypoints: The waypoints.
        sections: Constraints between them.
    """

    waypoints: tuple[MotionWaypoint, ...]
    sections: tuple[Section, ...]


def load_motion_problem(path: StrPath) -> MotionProblem:
    """Read the waypoints and constraints of a Choreo (`.traj`) or PathPlanner (`.path`) file.

    Nothing is optimised, and samples and curves are not read as a path: a PathPlanner path between
    its waypoints is free. The motion rests at both ends; velocities at the ends of a file are not
    read. Tolerances of headings below 0.01 rad are raised to that.

    Args:
        path: File name.

    Raises:
        InvalidReference: The file is missing, malformed or too large, has an unknown constraint or
            another extension.
    """
    file = to_path(path)
    readers = {".traj": choreo_problem, ".path": pathplanner_problem}
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise InvalidReference(
            f"{one_line(str(file))}: the extension {short_repr(file.suffix)} has no constraints; "
            "use .traj (Choreo) or .path (PathPlanner)"
        )
    root = read_json(file)
    try:
        waypoints, sections = reader(root)
    except InvalidReference:
        raise
    except InvalidInput as error:
        raise InvalidReference(f"{root.file}: {error}") from None
    return MotionProblem(tuple(waypoints), tuple(sections))
