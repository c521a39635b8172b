"""Waypoint files: which format a name's ending means."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from omnidrive.errors import InvalidReference
from omnidrive.files.bounded_file import one_line, short_repr
from omnidrive.planning import Path
from omnidrive.reference.reference import Reference
from omnidrive.reference.sampled_reference import MAX_SAMPLES, SampledReference
from omnidrive.reference.waypoints.choreo import read_choreo, write_choreo
from omnidrive.reference.waypoints.csv_table import read_csv, write_csv
from omnidrive.reference.waypoints.nav_path import read_nav_path, write_nav_path
from omnidrive.reference.waypoints.pathplanner import read_pathplanner, write_pathplanner
from omnidrive.reference.waypoints.waypoints import Waypoints, untimed_waypoints

_USUAL_STEP = 0.02  # s, the period at which most robots' loops run


class _Format(NamedTuple):
    read: Callable[[pathlib.Path], Waypoints]
    write: Callable[[pathlib.Path, Waypoints, str], None]


_FORMATS = {
    ".csv": _Format(read_csv, write_csv),
    ".path": _Format(read_pathplanner, write_pathplanner),
    ".traj": _Format(read_choreo, write_choreo),
    ".yaml": _Format(read_nav_path, write_nav_path),
    ".yml": _Format(read_nav_path, write_nav_path),
}


def load_waypoints(path: str | pathlib.Path) -> Path | SampledReference:
    """Read waypoints from a CSV, PathPlanner, Choreo or ROS `nav_msgs/Path` file.

    The name's ending says which it is: `.csv`, `.path`, `.traj`, `.yaml`. A file with times gives
    a reference, which starts at 0; one without gives a path. Files have at most 10 MB and 100,000
    waypoints, numbers are at most 1e10.

    Raises:
        InvalidReference: The file is missing, malformed, too large or contradicts itself.
    """
    file = pathlib.Path(path)
    return _format(file).read(file)


def save_waypoints(
    path: str | pathlib.Path,
    waypoints: Path | Reference,
    *,
    dt: float | None = None,
    frame_id: str = "map",
) -> None:
    """Write a path or reference so that :func:`load_waypoints` reads it; the ending tells how.

    Choreo files need times; PathPlanner files hold none. Each format's writer says how exactly it
    keeps what it is given: tables and Choreo files keep all of a reference's samples.

    Args:
        path: The file, which is overwritten.
        waypoints: What to write.
        dt: Time between a reference's samples, in s, rounded to a whole number of steps; by default
            the samples that a :class:`SampledReference` has, and 0.02 s for others.
        frame_id: Name of W, for ROS.

    Raises:
        InvalidReference: The format cannot hold the waypoints, their name has another ending, or
            two neighbours are more than half a turn apart: a file's reader turns the short way.
        CannotWrite: The file cannot be written.
    """
    file = pathlib.Path(path)
    write = _format(file).write
    if isinstance(waypoints, Path):
        if dt is not None:
            raise InvalidReference("a path has no times: leave dt out, or make a reference of it")
        _check_turns(waypoints)
        waypoints = untimed_waypoints("the path", lambda i: f"pose {i}", waypoints.poses)
    elif not isinstance(waypoints, Reference):
        raise InvalidReference(
            f"cannot save a {type(waypoints).__name__} as waypoints, only a Path or a Reference"
        )
    elif dt is not None or not isinstance(waypoints, SampledReference):
        step = _USUAL_STEP if dt is None else dt
        waypoints = _turning_short(waypoints, SampledReference.of(waypoints, step), step)
    elif len(waypoints.times) > MAX_SAMPLES:
        raise InvalidReference(
            f"{len(waypoints.times):,} samples are more than {MAX_SAMPLES:,}; choose a dt"
        )
    else:
        longest = float(np.diff(waypoints.times).max())
        waypoints = _turning_short(waypoints, waypoints, longest)
    write(file, waypoints, frame_id)


def _turns_short(waypoints: Waypoints) -> bool:
    """Whether no two neighbours are more than half a turn apart, so that unwrapping keeps them."""
    return bool((np.abs(np.diff(waypoints.poses[:, 2])) <= np.pi).all())


def _check_turns(path: Path) -> None:
    """Refuse a path that a file's reader would turn the other way."""
    turns = np.abs(np.diff(path.poses[:, 2]))
    if _turns_short(path):
        return
    i = int(np.argmax(turns))
    raise InvalidReference(
        f"the path turns by {turns[i]:.3f} rad from pose {i} to pose {i + 1}, which a file would "
        "turn back to less than half a turn: unwrap its yaw, or add poses in between"
    )


def _turning_short(reference: Reference, samples: SampledReference, dt: float) -> SampledReference:
    """The samples, ``dt`` s apart, unless a file's reader would turn some the other way."""
    if _turns_short(samples):
        return samples
    finer, step = samples, dt
    while not _turns_short(finer):
        step = float(f"{0.5 * step:.2g}")
        if reference.duration > step * MAX_SAMPLES:
            raise InvalidReference(
                f"the motion turns so often that {MAX_SAMPLES:,} samples cannot tell how far"
            )
        finer = SampledReference.of(reference, step)
    raise InvalidReference(
        f"the motion turns by more than half a turn between samples {dt:g} s apart, which a file "
        f"would lose; a step of {step:g} s is short enough: choose it as dt"
    )


def _format(file: pathlib.Path) -> _Format:
    found = _FORMATS.get(file.suffix.lower())
    if found is None:
        raise InvalidReference(
            f"{one_line(str(file))}: the ending {short_repr(file.suffix)} names no format of "
            "waypoints; use .csv, .path (PathPlanner), .traj (Choreo) or .yaml (ROS nav_msgs/Path)"
        )
    return found
