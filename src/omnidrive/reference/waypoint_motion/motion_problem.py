"""Problems of minimum time through waypoints in files of other programs."""

from __future__ import annotations

from omnidrive.errors import InvalidInput, InvalidReference, one_line, short_repr
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.reference.waypoint_motion.choreo_problem import choreo_problem
from omnidrive.reference.waypoint_motion.pathplanner_problem import pathplanner_problem
from omnidrive.reference.waypoint_motion.waypoint_problem import MotionProblem
from omnidrive.reference.waypoints.field import read_json


def load_motion_problem(path: StrPath) -> MotionProblem:
    """Read the waypoints and constraints of a Choreo (`.traj`) or PathPlanner (`.path`) file.

    Nothing is optimised. The samples of a Choreo file are the guess, from which the optimisation
    starts; the curves of a PathPlanner path are not, it is free between its waypoints. A flat
    Choreo file of 2024 has no waypoints: the ends of its samples and their rests are taken.
    The motion rests at both ends; velocities at the ends of a file are not read. Tolerances of
    headings below 0.01 rad and half-widths of lanes below 1 mm are raised to that.

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
        return reader(root)
    except InvalidReference:
        raise
    except InvalidInput as error:
        raise InvalidReference(f"{root.file}: {error}") from None
