"""Settings of ``omnidrive ros2 drive``, from a parameter file of ROS 2 and from options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import ValidationError

from omnidrive.components import configure, find_component, parse_specification
from omnidrive.control import Controller, Pipeline
from omnidrive.control.components import ControllerContext
from omnidrive.control.controller import check_controller
from omnidrive.deploy.ros2.drive_reports import DriveReports, ReportedPipeline
from omnidrive.deploy.ros2.ros2_link import Ros2LinkSettings
from omnidrive.errors import InvalidInput, one_line, short_repr, suggestion
from omnidrive.files.number_text import parse_number
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.geometry import Pose, check_heading
from omnidrive.parameter import Bounds, check_bounds, check_number
from omnidrive.robot import Robot, named_robot
from omnidrive.ros2.transform_tree import Frames
from omnidrive.scenario.scenario_file import listed, problems_of

_EVERY_NODE = "/**"
_SHOWN = 5  # names of nodes in a message
_SPEEDS = Bounds(0.001, 100.0, "m/s")
NODE_NAME = "omnidrive_drive"
"""Name of the node that drives."""


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """Settings of a drive in a graph of ROS 2; the parameters of the node ``omnidrive_drive``."""

    robot: str = "paper"
    """Robot, or a robot file."""
    controller: str = "holonomic-nmpc"
    """Controller, ``NAME[,KEY=VALUE...]``; in a file also ``{type: NAME, KEY: VALUE}``."""
    rate: Annotated[float, Bounds(1.0, 1000.0, "Hz")] = 50.0
    """Rate of the loop, Hz."""
    max_speed: float | None = None
    """Largest speed of the reference, m/s; None: that of the robot."""
    margin: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.1
    """Distance from obstacles of the map, in addition to the robot's radius, m."""
    world_frame: str = "map"
    """Frame of paths and goals."""
    odom_frame: str = "odom"
    """Frame of odometry."""
    base_frame: str = "base_link"
    """Frame of the robot."""
    cmd_vel: str = "/cmd_vel"
    """Topic of commands."""
    command_type: Literal["Twist", "TwistStamped"] | None = None
    """Type of commands; None: that of the robot's subscription."""
    allowed_publishers: tuple[str, ...] = ()
    """Nodes that may send commands besides the drive; a command of another node ends it."""
    odom: str = "/odom"
    """Topic of odometry."""
    plan: str = "/plan"
    """Topic of paths."""
    goal: str = "/goal_pose"
    """Topic of goals, which need a map."""
    map: str = "/map"
    """Topic of the map."""
    scan: str = "/scan"
    """Topic of laser scans, which localise the robot on the map without another localisation."""
    initial_pose: str | None = None
    """Pose of the robot from which scans localise it, ``X,Y[,HEADING]`` in m and rad; in a file
    also ``[X, Y, HEADING]``. None: that of ``/initialpose``."""
    stop: str = "/e_stop"
    """Topic on which true ends the drive."""
    use_sim_time: bool = False
    """Whether the time is that of ``/clock``."""
    timeout: Annotated[float, Bounds(0.1, 600.0, "s")] = 10.0
    """Time for which the robot is waited for, s."""

    def with_values(self, values: Mapping[str, Any], where: str = "") -> DriveSettings:
        """Return the settings with other values; None: unchanged.

        Args:
            values: Values by name of the field.
            where: Source of the values, for messages.

        Raises:
            InvalidInput: A name is not known, or a value has another type or is out of range.
        """
        known = {each.name for each in fields(self)}
        hints = get_type_hints(DriveSettings, include_extras=True)
        checked: dict[str, Any] = {}
        for name, value in values.items():
            if name not in known:
                near = suggestion(name, known, maximum=len(known))
                raise InvalidInput(f"{where}there is no parameter {short_repr(name)}{near}")
            if value is not None:
                checked[name] = _checked(f"{where}{name}", value, hints[name])
        changed = replace(self, **checked)
        try:
            _pose(changed.initial_pose)
            check_bounds(changed)
            if changed.max_speed is not None:
                check_number("max_speed", changed.max_speed, _SPEEDS)
        except InvalidInput as error:
            raise InvalidInput(f"{where}{error}") from None
        return changed

    @property
    def link(self) -> Ros2LinkSettings:
        """Settings of the link."""
        return Ros2LinkSettings(
            frames=Frames(self.world_frame, self.odom_frame, self.base_frame),
            cmd_vel=self.cmd_vel,
            command_type=self.command_type,
            allowed_publishers=self.allowed_publishers,
            odom=self.odom,
            map=self.map,
            scan=self.scan,
            initial_pose=_pose(self.initial_pose),
            use_sim_time=self.use_sim_time,
            timeout=self.timeout,
        )

    @property
    def controller_name(self) -> str:
        """Name of the controller, without its parameters."""
        return parse_specification(self.controller).type

    def make_robot(self) -> Robot:
        """Return the robot."""
        return named_robot(self.robot)

    def import_controller(self, *, allow_code: bool) -> None:
        """Import the controller, so that :meth:`make_pipeline` needs no permission.

        Args:
            allow_code: Whether code may be imported that is not installed; False if its name is in
                a file.

        Raises:
            InvalidInput: The controller does not exist, or its code is not allowed.
        """
        find_component("controllers", self.controller_name, allow_code=allow_code)

    def make_pipeline(
        self, robot: Robot, reports: DriveReports | None = None, *, allow_code: bool = False
    ) -> Pipeline:
        """Return the pipeline of a drive: the controller, with the latest pose as estimate.

        Args:
            robot: The robot.
            reports: What is published of every sample; None: nothing.
            allow_code: Whether code may be imported that is not installed; False if its name is
                in a file.

        Raises:
            InvalidInput: The controller does not exist, or a parameter is not valid.
        """
        given = parse_specification(self.controller)
        context = ControllerContext(robot, 1.0 / self.rate, np.random.default_rng(0))
        try:
            chosen = configure("controllers", given.type, given.values, allow_code=allow_code)
        except ValidationError as error:
            problems = listed(problems_of(error))
            raise InvalidInput(f"the controller {given.type}: {problems}") from None
        controller: Controller = chosen.make(context)
        check_controller(controller, 1.0 / self.rate)
        return ReportedPipeline(controller, reports=reports)


def read_parameters(path: StrPath, node: str = NODE_NAME) -> dict[str, Any]:
    """Return the parameters of a node from a YAML file as of ``ros2 run --params-file``.

    Args:
        path: The file: ``NODE: {ros__parameters: {NAME: VALUE}}``, and ``/**`` for every node.
        node: Name of the node.

    Raises:
        InvalidInput: The file is missing or malformed, or has no parameters of the node.
    """
    path = to_path(path)
    name = one_line(str(path))
    data = read_yaml(path, "parameter file", InvalidInput)
    if not isinstance(data, dict):
        raise InvalidInput(f"{name} is not a parameter file of ROS 2: no mapping")
    found: dict[str, Any] = {}
    for key in (_EVERY_NODE, node, f"/{node}"):
        if key in data:
            section = data[key]
            if not isinstance(section, dict) or not isinstance(
                section.get("ros__parameters"), dict
            ):
                raise InvalidInput(f"{name}: {key} has no mapping ros__parameters")
            found |= _named(section["ros__parameters"], name)
    if not found:
        others = ", ".join(short_repr(key) for key in list(data)[:_SHOWN]) or "none"
        raise InvalidInput(f"{name} has no parameters of {node}; its nodes are {others}")
    controller = found.get("controller")
    if isinstance(controller, dict):
        found["controller"] = _specification(controller, name)
    place = found.get("initial_pose")
    if isinstance(place, list) and len(place) in {2, 3}:
        found["initial_pose"] = ",".join(map(str, place))
    return found


def _named(section: Mapping[Any, Any], name: str) -> dict[str, Any]:
    """Return the parameters of a section; raise InvalidInput if a name is no text."""
    for key in section:
        if not isinstance(key, str):
            raise InvalidInput(
                f"{name}: the name of a parameter must be text, got {short_repr(key)}"
            )
    return dict(section)


def _pose(text: str | None) -> Pose | None:
    """Return the pose of ``X,Y[,HEADING]``; None of None.

    Raises:
        InvalidInput: The text has another form.
    """
    if text is None:
        return None
    numbers = [parse_number(each.strip()) for each in text.split(",")]
    x, y, yaw = (*numbers, 0.0)[:3] if len(numbers) in {2, 3} else (None, None, None)
    if x is None or y is None or yaw is None:
        raise InvalidInput(f"initial_pose is X,Y or X,Y,HEADING in m and rad, got {text!r}")
    check_heading("initial_pose", yaw)
    return Pose(x, y, yaw)


def _specification(data: Mapping[Any, Any], name: str) -> str:
    """Return a mapping as ``NAME,KEY=VALUE``."""
    if not isinstance(data.get("type"), str):
        raise InvalidInput(f"{name}: controller has no type, such as holonomic-nmpc")
    parts = [data["type"]]
    for key, value in data.items():
        if key == "type":
            continue
        if isinstance(value, dict | list):
            raise InvalidInput(f"{name}: controller.{one_line(str(key), 60)} must be one value")
        text = str(value).lower() if isinstance(value, bool) else f"{value}"
        parts.append(f"{key}={text}")
    return ",".join(parts)


def _checked(name: str, value: Any, hint: Any) -> Any:
    """Return a value of the type of its field; None is allowed where the field may be None."""
    union = get_origin(hint) in {Union, UnionType}
    kind = next((each for each in get_args(hint) if union and each is not NoneType), hint)
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            allowed = ", ".join(get_args(kind))
            raise InvalidInput(f"{name} is one of {allowed}, got {short_repr(value)}")
        return value
    if get_origin(kind) is tuple:
        if not isinstance(value, list | tuple) or not all(isinstance(each, str) for each in value):
            raise InvalidInput(f"{name} must be a list of texts, got {short_repr(value)}")
        return tuple(value)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind):
        raise InvalidInput(f"{name} must be a {kind.__name__}, got {short_repr(value)}")
    return value
