"""Robots described by parameters of controllers of ros2_control.

Kinematics of the controllers: ``mecanum_drive_controller/src/odometry.cpp`` and
``omni_wheel_drive_controller/src/odometry.cpp`` of ros-controls/ros2_controllers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import cos, isfinite, pi, sin
from typing import Any, NamedTuple

from omnidrive.errors import InvalidRobot, one_line, short_repr
from omnidrive.robot.imports.draft import RobotDraft, mecanum_roller
from omnidrive.robot.imports.wheel_mounts import listed
from omnidrive.robot.mount import Mount
from omnidrive.robot.robot import MAX_WHEELS

_SUM = "kinematics.sum_of_robot_center_projection_on_X_Y_axis"
_SUMS = ("sum_of_robot_center_projection_on_X_Y_axis", "wheels_k")
_RADII = ("wheels_radius", "wheel_radius")
_BASES = ("wheel_separation_x", "wheel_base", "wheelbase")  # front to rear, whole distances
_TRACKS = ("wheel_separation_y", "wheel_track", "track_width", "track", "wheel_separation")
_OTHER_TYPE = re.compile(r"diff_?drive|ackermann|bicycle|tricycle|swerve|steering", re.IGNORECASE)
_SAME_SUM = 1e-3  # relative difference of sums that are given twice
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

    def first(self, names: Sequence[str]) -> str | None:
        """Return the first key that is given, with or without `kinematics.`; None: none is."""
        keys = (f"{prefix}{name}" for name in names for prefix in ("kinematics.", ""))
        return next((key for key in keys if key in self.values), None)

    def length(self, keys: Sequence[str]) -> float | None:
        """Return a positive length times its multiplier, m; None: there is none."""
        key = self.first(keys)
        if key is None:
            return None
        value, stem = self.number(key), key.replace("wheels_", "wheel_")
        stems = (key, stem, re.sub("_[xy]$", "", stem))
        multiplier = next(
            (f"{s}_multiplier" for s in stems if f"{s}_multiplier" in self.values), ""
        )
        if multiplier:
            factor = self.number(multiplier)
            _check_positive(self, {multiplier: factor}, "")
            value *= factor
        _check_positive(self, {key: value})
        return value


def read_ros2_control(data: Any) -> RobotDraft:
    """Return the draft of the robot of the first mecanum or omni-wheel controller in a file.

    Besides the names of ros2_controllers, those of mecanum_drive_controller of ROS 1 and its
    descendants are read: wheelbase and track, with multipliers.

    Args:
        data: Content of a parameter file: mappings of node names to ``ros__parameters`` (ROS 2),
            or to parameters (ROS 1).

    Raises:
        InvalidRobot: There is no such controller, or a parameter is missing or invalid.
    """
    types = _types(data)
    found: list[tuple[str, _Parameters]] = []
    for parameters in _controllers(data):
        kind = _kind(parameters, types.get(_node_name(parameters), ""))
        if kind and not any(parameters.name.startswith(f"{each.name}/") for _, each in found):
            found.append((kind, parameters))
    if not found:
        known = [f"{name} ({kind})" for name, kind in types.items()]
        raise InvalidRobot(
            "there are no parameters of a mecanum_drive_controller (kinematics.wheels_radius, or "
            "wheel_radius, wheel_separation_x and wheel_separation_y) or an "
            "omni_wheel_drive_controller (wheel_names, robot_radius); "
            + (f"its controllers are {listed(known)}; " if known else "")
            + f"its keys are {listed(_keys(data))}"
        )
    kind, parameters = found[0]
    draft = _mecanum(parameters) if kind == "mecanum" else _omni(parameters)
    if len(found) > 1:
        others = listed([_node_name(each) for _, each in found[1:]])
        draft.warnings.append(
            f"the controller {_node_name(parameters)} is taken, the first of several; others are "
            f"not read: {others}"
        )
    return draft


def _kind(parameters: _Parameters, declared: str) -> str:
    """Return whether parameters are those of a `mecanum` or an `omni` controller; empty: neither.

    The declared type decides; without one, the names of the parameters do.
    """
    own = parameters.values.get("type")
    kind = own if isinstance(own, str) else declared
    names = {key.removeprefix("kinematics.") for key in parameters.values}
    if kind and _OTHER_TYPE.search(kind):
        return ""
    sized = names & {*_RADII, *_SUMS, *_BASES, *_TRACKS}
    if "kinematics.wheels_radius" in parameters.values or names & set(_SUMS):
        return "mecanum"
    if "mecanum" in kind.lower() and sized:
        return "mecanum"
    if {"robot_radius", "wheel_names"} <= names:
        return "omni"
    corners = sum(any(_corner(key, corner) for key in names) for corner, *_ in _CORNERS)
    pair = {"wheel_separation_x", "wheel_separation_y"} <= names
    has_radius = bool(names & set(_RADII))
    four = corners == 4 and names & set(_BASES) and names & set(_TRACKS)
    return "mecanum" if has_radius and (pair or four) else ""


def _corner(key: str, corner: str) -> bool:
    """Return whether a key names the joint of the wheel at a corner."""
    side = corner.partition("_")[2]
    places = {corner, f"back_{side}"} if corner.startswith("rear") else {corner}
    pattern = rf"({'|'.join(sorted(places))})(_wheel)?(_command)?(_joint)?(_names?)?"
    return re.fullmatch(pattern, key) is not None and key not in places


def _types(data: Any) -> dict[str, str]:
    """Return the declared types of controllers by name."""
    types: dict[str, str] = {}
    for name, node in _nodes(data):
        own = {key: value for key, value in node.items() if isinstance(value, str)}
        if "type" in own and name:
            types.setdefault(one_line(name.rpartition("/")[2], 64), one_line(own["type"], 100))
        for key, value in own.items():
            if str(key).endswith(".type"):
                types.setdefault(one_line(str(key)[:-5], 64), one_line(value, 100))
    return types


def _keys(data: Any) -> list[str]:
    """Return the names of the parameters of a file."""
    keys = (str(key) for _, node in _nodes(data) for key, each in node.items()
            if not isinstance(each, dict))  # fmt: skip
    return [one_line(key, 60) for key in dict.fromkeys(keys)] or ["none"]


def _nodes(data: Any) -> Iterator[tuple[str, dict[Any, Any]]]:
    """Yield all mappings of a file with their names, joined by slashes."""
    queue: list[tuple[str, Any]] = [("", data)]
    for name, node in queue:  # it grows
        if len(queue) > _MAX_NODES:
            raise InvalidRobot(f"there are more than {_MAX_NODES} nodes")
        if isinstance(node, dict):
            yield name, node
            for key, each in node.items():
                inner = name if key == "ros__parameters" else f"{name}/{str(key).strip('/')}"
                queue.append((inner, each))


def _controllers(data: Any) -> Iterator[_Parameters]:
    """Yield the parameters of every node, also under namespaces, and every mapping of ROS 1."""
    for name, node in _nodes(data):
        if "ros__parameters" not in node:
            yield _Parameters(name, _flat(node))


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
    radius = parameters.length(_RADII)
    if radius is None:
        raise _missing(parameters, "wheel_radius")
    half_base, half_track, reach = _halves(parameters)
    x0, y0, turn = (
        parameters.number(f"kinematics.base_frame_offset.{key}", 0.0) for key in ("x", "y", "theta")
    )
    c, s = cos(turn), sin(turn)
    mounts, joints = [], []
    for corner, ahead, left in _CORNERS:
        x, y = (half_base or 0.5 * reach) * ahead - x0, (half_track or 0.5 * reach) * left - y0
        axle = -0.5 * pi
        tilt = mecanum_roller(ahead, left, axle)
        mounts.append(Mount(c * x + s * y, c * y - s * x, axle - turn, tilt))
        named = (each for key, each in parameters.values.items() if _corner(key, corner))
        joints.append(next(named, corner))
    draft = RobotDraft(_node_name(parameters), tuple(mounts), radius)
    draft.read += [
        "mecanum_drive_controller",
        f"wheel radius {radius:g} m",
        f"half wheelbase {half_base:g} m, half track {half_track:g} m"
        if half_base and half_track
        else f"half wheelbase plus half track {reach:g} m",
        f"4 wheels, in this order: {', '.join(one_line(str(j), 60) for j in joints)}",
    ]
    if (x0, y0, turn) != (0.0, 0.0, 0.0):
        draft.read.append(f"base_frame_offset ({x0:g} m, {y0:g} m, {turn:g} rad)")
    if half_base is None:
        draft.guessed.append(
            f"half wheelbase and half track {0.5 * reach:g} m each (the file holds their sum, "
            "which alone affects the wheel speeds)"
        )
    draft.guessed.append("rollers at 45 degrees, as the controller assumes")
    return draft


def _halves(parameters: _Parameters) -> tuple[float | None, float | None, float]:
    """Return half the wheelbase and half the track, None if unknown, and their sum, m."""
    base, track = parameters.length(_BASES), parameters.length(_TRACKS)
    total = parameters.length(_SUMS)
    if base is not None and track is not None:
        reach = 0.5 * (base + track)
        if total is not None and abs(total - reach) > _SAME_SUM * reach:
            raise InvalidRobot(
                f"{one_line(parameters.name, 60)}: wheelbase and track add up to {reach:g} m "
                f"(half of both), but {_SUMS[0]} is {total:g} m"
            )
        return 0.5 * base, 0.5 * track, reach
    if total is None:
        raise _missing(
            parameters,
            f"{_SUM} is missing, and so is wheel_separation_"
            f"{'x' if base is None else 'y'} of wheel_separation_x and _y",
        )
    return None, None, total


def _missing(parameters: _Parameters, what: str) -> InvalidRobot:
    """Return an error about a missing parameter that names those which are there."""
    fact = what if " " in what else f"{what} is missing"
    keys = listed([one_line(key, 60) for key in parameters.values])
    return InvalidRobot(f"{one_line(parameters.name, 60)}: {fact}; its keys are {keys}")


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
    return one_line(parameters.name.rpartition("/")[2].strip("*") or "robot", 64)


def _check_positive(parameters: _Parameters, values: dict[str, float], unit: str = " m") -> None:
    for key, value in values.items():
        if not value > 0.0:
            raise InvalidRobot(
                f"{one_line(parameters.name, 60)}: {key} must be positive, got {value:g}{unit}"
            )
