"""Import of a robot from a file in another format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np

from omnidrive.choices import RobotFormat
from omnidrive.errors import InvalidInput, InvalidRobot, one_line, suggestion
from omnidrive.files.bounded_file import read_bounded
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.xml_elements import Element, read_xml
from omnidrive.files.yaml_file import read_yaml
from omnidrive.robot.imports.attributes import malformed
from omnidrive.robot.imports.draft import ImportedRobot, RobotDraft
from omnidrive.robot.imports.mjcf import read_mjcf
from omnidrive.robot.imports.ros2_control import read_ros2_control
from omnidrive.robot.imports.urdf import read_urdf
from omnidrive.robot.imports.xacro import refuse_xacro
from omnidrive.robot.robot_file import FORMAT as ROBOT_FORMAT

FORMATS: tuple[RobotFormat, ...] = get_args(RobotFormat)
"""Formats from which a robot can be imported."""

_MAX_BYTES = 10_000_000
_MAX_ELEMENTS = 20_000
_LONGEST = 1000  # characters of a message, which may contain names of the file
_ROOTS: dict[str, RobotFormat] = {"robot": "urdf", "mujoco": "mjcf"}


def import_robot(
    path: StrPath,
    *,
    format: str | None = None,
    wheels: Sequence[str] = (),
    wheel_radius: float | None = None,
    mecanum: bool = False,
) -> ImportedRobot:
    """Return the robot that a URDF, an MJCF or a ros2_control parameter file describes.

    Args:
        path: The file.
        format: One of :data:`FORMATS`; None: by suffix and content.
        wheels: Names of the wheel joints in URDF and MJCF; empty: found by axis and name.
        wheel_radius: Radius of the wheels, m; None: that in the file.
        mecanum: Whether wheels without rollers in URDF and MJCF are mecanum wheels with rollers at
            45 degrees; False: concluded from their axles and from names.

    Raises:
        InvalidInput: There is no such format.
        InvalidRobot: The file cannot be read or does not describe an omnidirectional robot; the
            message names what is missing.
    """
    path = to_path(path)
    if format is not None and format not in FORMATS:
        raise InvalidInput(
            f"there is no format '{one_line(format, 60)}'{suggestion(format, FORMATS)}"
        )
    is_yaml = path.suffix.lower() in {".yaml", ".yml"}
    kind = format or ("ros2_control" if is_yaml else None)
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # checked at the end
            draft = _draft(path, kind, wheels, wheel_radius, mecanum)
            if wheel_radius is not None and kind == "ros2_control":
                draft.radius = wheel_radius
            imported = draft.finish()
    except InvalidRobot as error:
        name, fact = one_line(str(path)), one_line(str(error), _LONGEST)
        raise error if str(error).startswith(name) else InvalidRobot(f"{name}: {fact}") from None
    name = imported.robot.name
    if not (name.isprintable() and name.strip()):
        return replace(imported, robot=replace(imported.robot, name="robot"))
    return imported


def _draft(
    path: Path,
    kind: str | None,
    wheels: Sequence[str],
    wheel_radius: float | None,
    mecanum: bool,
) -> RobotDraft:
    if kind == "ros2_control":
        if wheels:
            raise InvalidRobot("--wheel is for URDF and MJCF; the controller names its wheels")
        if mecanum:
            raise InvalidRobot("--mecanum is for URDF and MJCF; the controller states its wheels")
        data = read_yaml(path, "parameter file", InvalidRobot)
        if isinstance(data, dict) and data.get("format") == ROBOT_FORMAT:
            name = one_line(str(path))
            raise InvalidRobot(f"{name} is a robot file already; use --robot {name}")
        return read_ros2_control(data)
    root = _xml(path)
    refuse_xacro(root, path.name)
    if kind is None:
        if root.tag not in _ROOTS:
            raise InvalidRobot(
                f"the root element is <{root.tag[:40]}>, need <robot> (URDF) or <mujoco> (MJCF)"
            )
        kind = _ROOTS[root.tag]
    mechanism = read_urdf(root) if kind == "urdf" else read_mjcf(root, path, _xml)
    return mechanism.draft(wheels, wheel_radius, mecanum=mecanum)


def _xml(path: Path) -> Element:
    content = read_bounded(
        path, _MAX_BYTES, "robot description", InvalidRobot,
        excess=f"is too large for a robot description: more than {_MAX_BYTES:,} bytes",
    )  # fmt: skip
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InvalidRobot("it is not UTF-8 text") from None
    return read_xml(text, malformed, max_elements=_MAX_ELEMENTS)
