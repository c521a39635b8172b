"""The log of a run as an MCAP file with JSON messages, for Foxglove and other tools of robotics.

Frame W is named ``map`` and frame B ``base_link``, as in ROS (REP 105). Poses, transforms and
events have the schemas of Foxglove (foxglove.dev/schemas), so that its panels draw them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from math import cos, isfinite, sin
from typing import Any

from omnidrive.control.supervision import Event
from omnidrive.errors import MissingExtra
from omnidrive.simulation.log_columns import LogColumn

_WORLD, _BODY = "map", "base_link"
_INFO = 2  # level of foxglove.Log


def mcap_writer() -> Any:
    """Return the class ``mcap.writer.Writer``.

    Raises:
        MissingExtra: The package mcap is not installed.
    """
    try:
        return import_module("mcap.writer").Writer
    except ModuleNotFoundError:
        raise MissingExtra(
            "MCAP files need the package mcap, which is not installed: "
            "pip install mcap, or choose .parquet or .csv"
        ) from None


def write_mcap(writer: Any, columns: Sequence[LogColumn], events: Sequence[Event]) -> None:
    """Write a log and finish the file.

    The topics are ``/tf`` (transform from W to B), ``/pose``, ``/measured`` and ``/target`` (poses
    in W), ``/target_path`` (all targets, once), ``/log`` (every column, by its name) and
    ``/events``. Times count from the start of the run. Values that are not finite are omitted.

    Args:
        writer: New writer of the package mcap.
        columns: Columns of the log, ``t`` among them.
        events: Events of the run.
    """
    writer.start(profile="", library="omnidrive")
    topics = _register(writer, columns)

    def write(topic: str, t: float, message: Mapping[str, Any]) -> None:
        """Write one message of the time ``t`` (s)."""
        time = round(t * 1e9)
        data = json.dumps(message, allow_nan=False).encode()
        writer.add_message(topics[topic], log_time=time, data=data, publish_time=time)

    rows = [
        {column.name: value for column, value in zip(columns, row, strict=True) if isfinite(value)}
        for row in zip(*(column.values.tolist() for column in columns), strict=True)
    ]
    targets = [pose for row in rows if (pose := _pose(row, "target_"))]
    start = rows[0]["t"]
    write("/target_path", start, {**_stamped(start), "poses": targets})
    for row in rows:
        t = row["t"]
        write("/log", t, {**_stamp(t), **row})
        for topic, prefix in (("/pose", ""), ("/measured", "measured_"), ("/target", "target_")):
            pose = _pose(row, prefix)
            if pose:
                write(topic, t, {**_stamped(t), "pose": pose})
        pose = _pose(row, "")
        if pose:
            write("/tf", t, {**_stamp(t), **_transform(pose)})
    for event in events:
        write("/events", event.t, {**_stamp(event.t), **_log_entry(event)})
    writer.finish()


def _register(writer: Any, columns: Iterable[LogColumn]) -> dict[str, int]:
    """Register all schemas and topics; return the number of each topic."""
    schemas = {
        name: writer.register_schema(
            name=name,
            encoding="jsonschema",
            data=json.dumps(
                {"title": name, "type": "object", "properties": {"timestamp": _TIME, **properties}}
            ).encode(),
        )
        for name, properties in (*_SCHEMAS.items(), ("omnidrive.Log", _log_properties(columns)))
    }
    return {
        topic: writer.register_channel(topic, message_encoding="json", schema_id=schemas[name])
        for topic, name in _TOPICS.items()
    }


def _log_properties(columns: Iterable[LogColumn]) -> dict[str, Any]:
    """Return the JSON schema of each column, with its unit."""
    return {c.name: {"type": "number", "description": f"in {c.unit}"} for c in columns}


def _stamp(t: float) -> dict[str, Any]:
    seconds, rest = divmod(round(t * 1e9), 10**9)
    return {"timestamp": {"sec": seconds, "nsec": rest}}


def _stamped(t: float) -> dict[str, Any]:
    return {**_stamp(t), "frame_id": _WORLD}


def _pose(row: Mapping[str, float], prefix: str) -> dict[str, Any] | None:
    """Return the planar pose of the columns with a prefix; None if one of them is missing."""
    if not all(prefix + name in row for name in ("x", "y", "yaw")):
        return None
    half = 0.5 * row[prefix + "yaw"]
    return {
        "position": {"x": row[prefix + "x"], "y": row[prefix + "y"], "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": sin(half), "w": cos(half)},
    }


def _transform(pose: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "parent_frame_id": _WORLD,
        "child_frame_id": _BODY,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }


def _log_entry(event: Event) -> dict[str, Any]:
    return {"level": _INFO, "message": event.what, "name": "omnidrive", "file": "", "line": 0}


def _numbers(*names: str) -> dict[str, Any]:
    return {"type": "object", "properties": {name: {"type": "number"} for name in names}}


_TEXT, _WHOLE = {"type": "string"}, {"type": "integer"}
_TIME = {
    "type": "object",
    "title": "time",
    "properties": {"sec": _WHOLE, "nsec": _WHOLE},
}
_POSITION, _ORIENTATION = _numbers("x", "y", "z"), _numbers("x", "y", "z", "w")
_POSE = {
    "type": "object",
    "properties": {"position": _POSITION, "orientation": _ORIENTATION},
}
_SCHEMAS: dict[str, dict[str, Any]] = {
    "foxglove.PoseInFrame": {"frame_id": _TEXT, "pose": _POSE},
    "foxglove.PosesInFrame": {"frame_id": _TEXT, "poses": {"type": "array", "items": _POSE}},
    "foxglove.FrameTransform": {
        "parent_frame_id": _TEXT,
        "child_frame_id": _TEXT,
        "translation": _POSITION,
        "rotation": _ORIENTATION,
    },
    "foxglove.Log": {
        "level": _WHOLE,
        "message": _TEXT,
        "name": _TEXT,
        "file": _TEXT,
        "line": _WHOLE,
    },
}
_TOPICS = {
    "/target_path": "foxglove.PosesInFrame",
    "/log": "omnidrive.Log",
    "/pose": "foxglove.PoseInFrame",
    "/measured": "foxglove.PoseInFrame",
    "/target": "foxglove.PoseInFrame",
    "/tf": "foxglove.FrameTransform",
    "/events": "foxglove.Log",
}
