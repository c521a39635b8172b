"""Files that describe a drive in a graph of ROS 2 in its log, and the drive that they describe."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from math import ceil
from pathlib import Path
from tempfile import TemporaryDirectory

from omnidrive.control import Pipeline
from omnidrive.deploy.attached_files import attached_files
from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters
from omnidrive.errors import InvalidReference
from omnidrive.reference import Reference, SampledReference
from omnidrive.reference.waypoints import load_waypoints, save_waypoints
from omnidrive.robot import Robot

PARAMETERS_FILE, REFERENCE_FILE = "parameters.yaml", "reference.csv"
"""Names of the files: a parameter file of ROS 2, and the reference of the drive as a table."""
_SAMPLES = 50_000


def parameters_file(settings: DriveSettings) -> bytes:
    """Return the settings as a parameter file of every node."""
    text = json.dumps({"/**": {"ros__parameters": asdict(settings)}}, indent=1)  # is YAML, too
    return text.encode()


def reference_file(reference: Reference, dt: float, name: str = REFERENCE_FILE) -> dict[str, bytes]:
    """Return the reference as a file by its name: its samples ``dt`` (s) apart, at most 50,000.

    Empty for a reference that a table cannot represent.
    """
    step = dt * max(1, ceil(reference.duration / dt / _SAMPLES))
    with TemporaryDirectory(prefix="omnidrive-") as folder:
        file = Path(folder) / name
        try:
            save_waypoints(file, SampledReference.of(reference, step))
        except InvalidReference:
            return {}
        return {name: file.read_bytes()}


def drive_of_log(
    files: Mapping[str, bytes],
    robot: Robot,
    *,
    controller: str | None = None,
    allow_code: bool = False,
) -> tuple[Pipeline, Reference] | None:
    """Return pipeline and reference of a drive from the files of its log.

    Args:
        files: The files attached to the log.
        robot: Robot of the log.
        controller: Another controller, ``NAME[,KEY=VALUE...]``; None: that of the log.
        allow_code: Whether code may be imported that the log names and that is not installed.

    Returns:
        None: the log is not of such a drive.

    Raises:
        InvalidInput: A file is malformed, or the controller does not exist.
        InvalidReference: The reference is malformed.
    """
    if not files.keys() >= {PARAMETERS_FILE, REFERENCE_FILE}:
        return None
    with attached_files(
        {name: files[name] for name in (PARAMETERS_FILE, REFERENCE_FILE)}
    ) as folder:
        settings = DriveSettings().with_values(read_parameters(folder / PARAMETERS_FILE))
        reference = load_waypoints(folder / REFERENCE_FILE)
    if not isinstance(reference, SampledReference):
        raise InvalidReference(f"{REFERENCE_FILE} of the log has no times")
    settings = settings.with_values({"controller": controller})
    allowed = allow_code or controller is not None  # the user names that one
    return settings.make_pipeline(robot, allow_code=allowed), reference
