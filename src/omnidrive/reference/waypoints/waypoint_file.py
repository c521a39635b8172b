"""Waypoint files in the format given by the file name extension."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from typing import NamedTuple, get_args

import numpy as np

from omnidrive.choices import TableHeading
from omnidrive.errors import InvalidReference, kind_of, one_line, short_repr
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps import CostMap
from omnidrive.parameter import check_choice
from omnidrive.planning import Path
from omnidrive.reference.limit_sampling import MIN_ADDED_STEP, sample_within_limits
from omnidrive.reference.reference import Reference
from omnidrive.reference.sampled_reference import MAX_SAMPLES, SampledReference
from omnidrive.reference.waypoints.choreo import MIN_SPACING, read_choreo, write_choreo
from omnidrive.reference.waypoints.csv_table import read_csv, write_csv
from omnidrive.reference.waypoints.nav_path import read_nav_path, write_nav_path
from omnidrive.reference.waypoints.pathplanner import read_pathplanner, write_pathplanner
from omnidrive.reference.waypoints.waypoints import Waypoints, untimed_waypoints

_DEFAULT_STEP = 0.02  # s, a common control period


class _Format(NamedTuple):
    read: Callable[[pathlib.Path], Waypoints]
    write: Callable[[pathlib.Path, Waypoints, str], None]
    min_step: float = MIN_ADDED_STEP
    """Shortest time between samples, in s, that are added to keep limits."""


_FORMATS = {
    ".csv": _Format(read_csv, write_csv),
    ".path": _Format(read_pathplanner, write_pathplanner),
    ".traj": _Format(read_choreo, write_choreo, MIN_SPACING),
    ".yaml": _Format(read_nav_path, write_nav_path),
    ".yml": _Format(read_nav_path, write_nav_path),
}


def load_waypoints(path: StrPath, *, heading: TableHeading = "tangent") -> Path | SampledReference:
    """Read waypoints from a CSV, PathPlanner, Choreo or ROS `nav_msgs/Path` file.

    The file name extension determines the format: `.csv`, `.path`, `.traj`, `.yaml` or `.yml`. A
    file with times gives a reference that starts at 0, a file without times gives a path. Limits:
    10 MB, 100,000 waypoints, numbers up to 1e10.

    Args:
        path: File name.
        heading: Heading of a CSV table that has none: ``tangent``, the direction of travel, or
            ``fixed``, 0 rad.

    Raises:
        InvalidReference: The file is missing, malformed, too large or inconsistent.
    """
    check_choice("heading", heading, get_args(TableHeading))
    file = to_path(path)
    kind = _format(file)
    return read_csv(file, heading) if kind.read is read_csv else kind.read(file)


def save_waypoints(
    path: StrPath,
    waypoints: Path | Reference,
    *,
    dt: float | None = None,
    frame_id: str = "map",
    zones: CostMap | None = None,
) -> None:
    """Write a path or reference in the format given by the file name extension.

    Choreo files need times; PathPlanner files have none. CSV tables and Choreo files keep all
    samples of a reference exactly; for the accuracy of the other formats see their writers.

    A :class:`TimedReference` keeps its limits within 1 % when a CSV table or a Choreo file of it is
    read again: where samples every ``dt`` are too few, in particular where the acceleration jumps,
    further samples are written, see :func:`~omnidrive.reference.sample_within_limits`. For samples
    at even times only, save ``SampledReference.of(reference, dt)``.

    Args:
        path: File name; an existing file is overwritten.
        waypoints: Path or reference to write.
        dt: Longest time between the samples of a reference, in s, rounded to a whole number of
            steps; None: the samples of a :class:`SampledReference`, and 0.02 s for other
            references.
        frame_id: Name of W in ROS.
        zones: Map whose ``max_speed`` a motion that keeps it keeps within 1 % in the file, too.

    Raises:
        InvalidReference: The format cannot represent the waypoints, the extension is unknown, or
            two neighbouring waypoints are more than half a turn apart, which a reader cannot
            restore.
        CannotWrite: The file cannot be written.
    """
    file = to_path(path)
    kind = _format(file)
    if isinstance(waypoints, Path):
        if dt is not None:
            raise InvalidReference(
                "a path has no times: omit dt, or convert the path to a reference"
            )
        _check_turns(waypoints)
        waypoints = untimed_waypoints("the path", waypoints.poses)
    elif not isinstance(waypoints, Reference):
        raise InvalidReference(
            f"cannot save {kind_of(waypoints)} as waypoints, only a Path or a Reference"
        )
    elif dt is not None or not isinstance(waypoints, SampledReference):
        step = _DEFAULT_STEP if dt is None else dt
        samples = sample_within_limits(waypoints, step, min_step=kind.min_step, zones=zones)
        waypoints = _check_sampled_turns(waypoints, samples, step)
    elif len(waypoints.times) > MAX_SAMPLES:
        raise InvalidReference(
            f"{len(waypoints.times):,} samples are more than {MAX_SAMPLES:,}; choose a dt"
        )
    else:
        longest = float(np.diff(waypoints.times).max())
        waypoints = _check_sampled_turns(waypoints, waypoints, longest)
    kind.write(file, waypoints, frame_id)


def _turns_at_most_half(waypoints: Waypoints) -> bool:
    """Return whether neighbours are at most half a turn apart, so that a reader restores them."""
    return bool((np.abs(np.diff(waypoints.poses[:, 2])) <= np.pi).all())


def _check_turns(path: Path) -> None:
    """Raise InvalidReference if a reader would not restore the turns of the path."""
    turns = np.abs(np.diff(path.poses[:, 2]))
    if _turns_at_most_half(path):
        return
    i = int(np.argmax(turns))
    raise InvalidReference(
        f"the path turns by {turns[i]:.3f} rad from pose {i} to pose {i + 1}, and a file "
        "represents at most half a turn: unwrap its yaw, or add poses in between"
    )


def _check_sampled_turns(
    reference: Reference, samples: SampledReference, dt: float
) -> SampledReference:
    """Return the samples, ``dt`` s apart; raise InvalidReference if turns would be lost."""
    if _turns_at_most_half(samples):
        return samples
    finer, step = samples, dt
    while not _turns_at_most_half(finer):
        step = float(f"{0.5 * step:.2g}")
        if reference.duration > step * MAX_SAMPLES:
            raise InvalidReference(
                f"the motion turns so fast that {MAX_SAMPLES:,} samples cannot represent it"
            )
        finer = SampledReference.of(reference, step)
    raise InvalidReference(
        f"the motion turns by more than half a turn between samples {dt:g} s apart, which a file "
        f"cannot represent; choose dt = {step:g} s"
    )


def _format(file: pathlib.Path) -> _Format:
    found = _FORMATS.get(file.suffix.lower())
    if found is None:
        raise InvalidReference(
            f"{one_line(str(file))}: the extension {short_repr(file.suffix)} is not a waypoint "
            "format; use .csv, .path (PathPlanner), .traj (Choreo) or .yaml (ROS nav_msgs/Path)"
        )
    return found
