"""Robots described by parameters of controllers of ros2_control.

Kinematics of the controllers: ``mecanum_drive_controller/src/odometry.cpp`` and
``omni_wheel_drive_controller/src/odometry.cpp`` of ros-controls/ros2_controllers.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, isfinite, pi, sin
from typing import Any, NamedTuple

from omnidrive.errors import InvalidRobot, one_line, short_repr
from omnidrive.robot.imports.draft import RobotDraft, mecanum_roller
from omnidrive.robot.mount import Mount
from omnidrive.robot.robot import MAX_WHEELS

_SUM = "kinematics.sum_of_robot_center_projection_on_X_Y_axis"
_OLD_SUM = "kinematics.wheels_k"
_RADIUS = "kinematics.wheels_radius"
_CORNERS = (
    ("front_left", 1, 1),
    ("front_right", 1, -1),
    ("rear_left", -1, 1),
    ("rear_right", -1, -1),
)
_MAX_NODES = 1000


class _Parameters(NamedTuple):
    """Parameters of one controller, with full names such as ``kinematics.wheels_radius``."""

    name: str
    values: dict[str, Any]

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            fact = "is missing" if value is None else f"must be a number, got {short_repr(value)}"
            raise InvalidRobot(f"{one_line(self.name, 60)}: {key} {fact}")
        return float(value)


def read_ros2_control(data: Any) -> RobotDraft:
    """Return the draft of the robot of the first mecanum or omni-wheel controller in a file.

    Args:
        data: Content of a parameter file of ROS 2: mappings of node names to ``ros__parameters``.

    Raises:
        InvalidRobot: There is no such controller, or a parameter is missing or invalid.
    """
    for parameters in _controllers(data):
        if _RADIUS in parameters.values:
            return _mecanum(parameters)
        if {"robot_radius", "wheel_names"} <= parameters.values.keys():
            return _omni(parameters)
    raise InvalidRobot(
        "there are no parameters of a mecanum_drive_controller (kinematics.wheels_radius) or an "
        "omni_wheel_drive_controller (wheel_names, robot_radius)"
    )


def _controllers(data: Any) -> Iterator[_Parameters]:
    """Yield the parameters of every node, also under namespaces."""
    queue: list[tuple[str, Any]] = [("", data)]
    for name, node in queue:  # it grows
        if len(queue) > _MAX_NODES:
            raise InvalidRobot(f"there are more than {_MAX_NODES} nodes")
        if not isinstance(node, dict):
            continue
        if isinstance(node.get("ros__parameters"), dict):
            yield _Parameters(name, _flat(node["ros__parameters"]))
        queue += [(str(key), each) for key, each in node.items() if key != "ros__parameters"]


def _flat(values: dict[Any, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested parameters with full names, joined by points."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f"{prefix}{key}"
        flat |= _flat(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return flat


def _mecanum(parameters: _Parameters) -> RobotDraft:
    """Return the draft of a mecanum robot.

    ``r w = vx -+ vy -+ k yaw_rate`` with k the sum of half the wheelbase and half the track. The
    frame of the base has the pose ``base_frame_offset`` in the frame at the wheels' centre.
    """
    radius = parameters.number(_RADIUS)
    reach = parameters.number(_OLD_SUM if _OLD_SUM in parameters.values else _SUM)
    x0, y0, turn = (
        parameters.number(f"kinematics.base_frame_offset.{key}", 0.0) for key in ("x", "y", "theta")
    )
    _check_positive(parameters, {_RADIUS: radius, _SUM: reach})
    c, s = cos(turn), sin(turn)
    mounts, joints = [], []
    for corner, ahead, left in _CORNERS:
        x, y = 0.5 * reach * ahead - x0, 0.5 * reach * left - y0
        axle = -0.5 * pi
        tilt = mecanum_roller(ahead, left, axle)
        mounts.append(Mount(c * x + s * y, c * y - s * x, axle - turn, tilt))
        joints.append(parameters.values.get(f"{corner}_wheel_command_joint_name", corner))
    draft = RobotDraft(_node_name(parameters), tuple(mounts), radius)
    draft.read += [
        "mecanum_drive_controller",
        f"wheel radius {radius:g} m",
        f"half wheelbase plus half track {reach:g} m",
        f"4 wheels, in this order: {', '.join(one_line(str(j), 60) for j in joints)}",
    ]
    if (x0, y0, turn) != (0.0, 0.0, 0.0):
        draft.read.append(f"base_frame_offset ({x0:g} m, {y0:g} m, {turn:g} rad)")
    draft.guessed += [
        f"half wheelbase and half track {0.5 * reach:g} m each (the file holds their sum, which "
        "alone affects the wheel speeds)",
        "rollers at 45 degrees, as the controller assumes",
    ]
    return draft


def _omni(parameters: _Parameters) -> RobotDraft:
    """Return the draft of a robot with omni wheels at equal angles.

    ``r w = sin(a) vx - cos(a) vy - R yaw_rate``: the axles point to the centre.
    """
    radius, ring = parameters.number("wheel_radius"), parameters.number("robot_radius")
    offset = parameters.number("wheel_offset", 0.0)
    names = parameters.values["wheel_names"]
    _check_positive(parameters, {"wheel_radius": radius, "robot_radius": ring})
    if not isinstance(names, list) or not 3 <= len(names) <= MAX_WHEELS:
        raise InvalidRobot(
            f"{one_line(parameters.name, 60)}: wheel_names must be a list of 3 to {MAX_WHEELS} "
            f"names, got {short_repr(names)}"
        )
    angles = [offset + 2.0 * pi * i / len(names) for i in range(len(names))]
    mounts = tuple(Mount(ring * cos(a), ring * sin(a), a + pi) for a in angles)
    draft = RobotDraft(_node_name(parameters), mounts, radius)
    draft.read += [
        "omni_wheel_drive_controller",
        f"wheel radius {radius:g} m",
        f"distance of the wheels from the centre {ring:g} m, the first at {offset:g} rad",
        f"{len(names)} wheels, counter-clockwise: {', '.join(one_line(str(n), 60) for n in names)}",
        "positive wheel speeds turn the robot clockwise, as the controller assumes",
    ]
    return draft


def _node_name(parameters: _Parameters) -> str:
    return one_line(parameters.name.strip("/*") or "robot", 64)


def _check_positive(parameters: _Parameters, values: dict[str, float]) -> None:
    for key, value in values.items():
        if not value > 0.0:
            raise InvalidRobot(
                f"{one_line(parameters.name, 60)}: {key} must be positive, got {value:g} m"
            )
