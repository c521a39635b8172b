"""ROS `nav_msgs/Path` messages as YAML, the format of `ros2 topic echo` and `ros2 topic pub`.

Absent fields have the default values of ROS: 0, and 1 for w of a quaternion. The fields `secs`,
`nsecs` and `seq` of ROS 1 are accepted. Source: the message definitions of nav_msgs, geometry_msgs
and std_msgs.
"""

from __future__ import annotations

import json
import pathlib
from math import atan2, cos, hypot, sin

import numpy as np

from omnidrive.errors import InvalidReference, one_line
from omnidrive.files.yaml_file import read_yaml_documents
from omnidrive.planning import Path
from omnidrive.reference.waypoints.field import Field
from omnidrive.reference.waypoints.text_file import MAX_BYTES, write_text
from omnidrive.reference.waypoints.waypoints import Waypoints, timed_waypoints, untimed_waypoints

_NORM_TOLERANCE = 0.01  # of the norm of a quaternion from 1
_TILT_TOLERANCE = 0.01  # of x and y of a quaternion from 0, the value on level ground


def read_nav_path(file: pathlib.Path) -> Waypoints:
    """Read one message, as a :class:`Path` if all stamps are equal, else as a reference.

    A message has no velocities: a timed one is interpolated by a spline from rest to rest. The
    frame and z coordinates are ignored.

    Raises:
        InvalidReference: The file is not a valid message; the error gives the position.
    """
    name = one_line(str(file))
    root = Field(_message(file, name), "", name)
    if isinstance(root.value, dict) and {"image", "resolution"} <= root.value.keys():
        raise root.error("is a Nav2 map, not a path; load it with load_nav2_map")
    poses = root.only("header", "poses")["poses"].items()
    for pose in poses:
        if pose.value == "...":
            raise pose.error("is '...': ros2 topic echo truncated the list; add --full-length")
    _check_header(root)
    stamps = np.array([_stamp(pose) for pose in poses], dtype=np.int64)
    table = np.array([_pose(pose) for pose in poses], dtype=float).reshape(-1, 3)
    if len(set(stamps.tolist())) <= 1:
        return untimed_waypoints(name, table)
    times = (stamps - stamps[0]) / 1e9
    return timed_waypoints(name, lambda i: f"{poses[i].name}.header.stamp", times, table, None)


def write_nav_path(file: pathlib.Path, waypoints: Waypoints, frame_id: str) -> None:
    """Write one message in the format of `ros2 topic echo`, for `ros2 topic pub --yaml-file`.

    The stamps are the times of a reference since its start, rounded to 1 ns, and 0 for a path.
    Velocities are not written.
    """
    times = [0.0] * len(waypoints.poses)
    if not isinstance(waypoints, Path):
        times = waypoints.times.tolist()
    frame = json.dumps(frame_id)
    parts = [_header(0.0, frame, ""), "poses:\n"]
    for t, (x, y, yaw) in zip(times, waypoints.poses.tolist(), strict=True):
        parts.append(
            f"- {_header(t, frame, '  ').lstrip()}"
            f"  pose:\n    position:\n      x: {_float(x)}\n      y: {_float(y)}\n      z: 0.0\n"
            f"    orientation:\n      x: 0.0\n      y: 0.0\n      z: {_float(sin(0.5 * yaw))}\n"
            f"      w: {_float(cos(0.5 * yaw))}\n"
        )
    write_text(file, "".join([*parts, "---\n"]))


def _message(file: pathlib.Path, name: str) -> object:
    documents = read_yaml_documents(file, "waypoint file", InvalidReference, max_bytes=MAX_BYTES)
    messages = [document for document in documents if document is not None]
    if len(messages) != 1:
        raise InvalidReference(
            f"{name} contains {len(messages)} messages, need one; record it with "
            "ros2 topic echo --once --full-length"
        )
    return messages[0]


def _check_header(field: Field) -> Field | None:
    header = field.get("header")
    return header.only("stamp", "frame_id", "seq") if header else None


def _stamp(pose: Field) -> int:
    """Return the stamp of a PoseStamped, in ns."""
    header = _check_header(pose.only("header", "pose"))
    stamp = header.get("stamp") if header else None
    if stamp is None:
        return 0
    stamp.only("sec", "nanosec", "secs", "nsecs")
    seconds, nanoseconds = (
        _whole(stamp.get(new) or stamp.get(old), limit)
        for new, old, limit in (("sec", "secs", 2**32), ("nanosec", "nsecs", 10**9))
    )
    return seconds * 10**9 + nanoseconds


def _whole(field: Field | None, limit: int) -> int:
    """Return a whole number from 0 to below ``limit``; 0 for an absent field."""
    if field is None:
        return 0
    value = field.value
    if not isinstance(value, float) or not 0.0 <= value < limit or not value.is_integer():
        raise field.error(f"is {field.description}, need a whole number from 0 to {limit - 1:,}")
    return int(value)


def _pose(field: Field) -> tuple[float, float, float]:
    pose = field["pose"].only("position", "orientation")
    position = pose["position"].only("x", "y", "z")
    x, y, _ = (_number(position, key, 0.0) for key in ("x", "y", "z"))
    return x, y, _yaw(pose)


def _yaw(pose: Field) -> float:
    """Return the yaw of a quaternion: atan2(2 (w z + x y), w^2 + x^2 - y^2 - z^2)."""
    orientation = pose.get("orientation")
    if orientation is None:
        return 0.0
    orientation.only("x", "y", "z", "w")
    x, y, z = (_number(orientation, key, 0.0) for key in ("x", "y", "z"))
    w = _number(orientation, "w", 1.0)
    norm = hypot(x, y, z, w)
    if abs(norm - 1.0) > _NORM_TOLERANCE:
        raise orientation.error(f"is a quaternion of norm {norm:.6g}, need 1")
    if hypot(x, y) > _TILT_TOLERANCE:
        raise orientation.error(f"tilts the robot: x {x:g} and y {y:g} must be 0 on level ground")
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _number(field: Field, key: str, default: float) -> float:
    found = field.get(key)
    return default if found is None else found.number()


def _header(t: float, frame: str, indent: str) -> str:
    seconds, nanoseconds = divmod(round(t * 1e9), 10**9)
    lines = (
        "header:", "  stamp:", f"    sec: {seconds}", f"    nanosec: {nanoseconds}",
        f"  frame_id: {frame}",
    )  # fmt: skip
    return "".join(f"{indent}{line}\n" for line in lines)


def _float(value: float) -> str:
    """Return a float in YAML 1.1 syntax, with a decimal point before an exponent."""
    text = repr(value)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text
