"""Choreo trajectories (`.traj`): JSON, timed samples with velocities.

The reader accepts schema versions 0 to 4 (2025 and later), beta files of 2025, whose samples are
nested in splits, and the flat files of 2024. The writer writes version 3, which ChoreoLib and
PathPlannerLib of 2026 require. Positions are in m and angles in rad, in the frame of the field,
which is W. Source: Choreo, `src-core/src/spec/trajectory.rs` and the loaders of ChoreoLib.
"""

from __future__ import annotations

import json
import pathlib
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.planning import Path
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.reference.waypoints.field import Field, read_json
from omnidrive.reference.waypoints.text_file import write_text
from omnidrive.reference.waypoints.waypoints import Waypoints, timed_waypoints

_VERSION = 3
MIN_SPACING = 5e-4
"""Shortest time between samples, in s. Choreo's optimiser can end with samples less than 1 us
apart, and its files are rounded to 1e-5 m: differences over a shorter time give no velocities."""

_NAMES = ("t", "x", "y", "heading", "vx", "vy", "omega")
_NAMES_2024 = ("timestamp", "x", "y", "heading", "velocityX", "velocityY", "angularVelocity")
_NO_FORCE = [0.0, 0.0, 0.0, 0.0]


def read_choreo(file: pathlib.Path) -> SampledReference:
    """Read a trajectory, with all of its splits joined.

    Of samples less than 0.5 ms apart the first is kept, and at the end the last. The samples of a
    differential drive have no velocities in W and are interpolated by a spline from rest to rest.

    Raises:
        InvalidReference: The file is not a generated trajectory; the message gives the position.
    """
    return choreo_reference(read_json(file))


def choreo_reference(root: Field) -> SampledReference:
    """Return the trajectory of a file that is already parsed; see :func:`read_choreo`.

    Raises:
        InvalidReference: The file is not a generated trajectory.
    """
    nested = root.get("trajectory")  # absent in files of 2024
    trajectory, names = (root, _NAMES_2024) if nested is None else (nested, _NAMES)
    samples = trajectory["samples"].items()
    if samples and isinstance(samples[0].value, list):
        samples = [sample for split in samples for sample in split.items()]
    if not samples:
        raise trajectory["samples"].error(
            "is empty: the trajectory was never generated; generate it in Choreo and save it"
        )
    # files of version 0 have no key sampleType
    differential = samples[0].get("vl") is not None
    known = names[:4] if differential else names
    table = np.array([[sample[key].number() for key in known] for sample in samples])
    kept = _spaced(samples, table[:, 0])
    table = table[kept]
    twists = None if differential else table[:, 4:]
    return timed_waypoints(
        root.file, lambda i: samples[kept[i]].name, table[:, 0], table[:, 1:4], twists
    )


def write_choreo(file: pathlib.Path, waypoints: Waypoints, _frame_id: str) -> None:
    """Write a trajectory of a swerve drive, which :func:`read_choreo` restores exactly.

    In Choreo the trajectory has two waypoints, its ends. As in Choreo's own files, the acceleration
    of a sample is the mean until the next sample, and 0 at the last. Wheel forces are written as 0.

    Raises:
        InvalidReference: The waypoints are a path without times, or samples are less than 0.5 ms
            apart.
    """
    if isinstance(waypoints, Path):
        raise InvalidReference(
            "a Choreo trajectory needs times, which a path does not have: convert the path to a "
            "reference, or save it as .csv, .path or .yaml"
        )
    if np.diff(waypoints.times).min() < MIN_SPACING:
        raise InvalidReference(
            f"a Choreo trajectory needs samples at least {MIN_SPACING:g} s apart; "
            "choose a longer dt"
        )
    means = np.diff(waypoints.twists, axis=0) / np.diff(waypoints.times)[:, None]
    accelerations = np.vstack([means, np.zeros(3)])
    table = np.column_stack([waypoints.times, waypoints.poses, waypoints.twists, accelerations])
    keys = (*_NAMES, "ax", "ay", "alpha")
    samples = [
        {**dict(zip(keys, row, strict=True)), "fx": _NO_FORCE, "fy": _NO_FORCE}
        for row in table.tolist()
    ]
    write_text(file, _document(file.stem, samples) + "\n")


def _spaced(samples: list[Field], times: Float[Array, " samples"]) -> Int[Array, " kept"]:
    """Return indices of samples at least 0.5 ms apart, including the last one."""
    kept = [0]
    for i, (before, now) in enumerate(zip(times[:-1].tolist(), times[1:].tolist(), strict=True), 1):
        if now < before:
            raise samples[i].error(f"has the time {now:.9g} s, before {before:.9g} s; sort them")
        if now - times[kept[-1]] >= MIN_SPACING:
            kept.append(i)
    if len(kept) > 1:
        kept[-1] = len(times) - 1
    return np.array(kept)


def _document(name: str, samples: list[dict[str, Any]]) -> str:
    """Return the text of the file, one line per sample, in Choreo's layout."""
    ends = (samples[0], samples[-1])
    duration = samples[-1]["t"]
    rest = [{"from": end, "to": None, "data": {"type": "StopPoint", "props": {}}, "enabled": True}
            for end, sample in zip(("first", "last"), ends, strict=True)
            if sample["vx"] == sample["vy"] == sample["omega"] == 0.0]  # fmt: skip
    dt = duration / (len(samples) - 1)
    snapshot = {"waypoints": [_waypoint(s, len(samples) - 1) for s in ends], "constraints": rest}
    params = {
        "waypoints": [_expressions(waypoint) for waypoint in snapshot["waypoints"]],
        "constraints": rest,
        "targetDt": _expression(dt, "s"),
    }
    lines = ",\n".join("   " + json.dumps(sample) for sample in samples)
    return (
        "{\n"
        f' "name": {json.dumps(name)},\n'
        f' "version": {_VERSION},\n'
        f' "snapshot": {json.dumps({**snapshot, "targetDt": dt})},\n'
        f' "params": {json.dumps(params)},\n'
        ' "trajectory": {\n'
        '  "config": null,\n'
        '  "sampleType": "Swerve",\n'
        f'  "waypoints": {json.dumps([0.0, duration])},\n'
        f'  "samples": [\n{lines}\n  ],\n'
        '  "splits": [0],\n'
        '  "forcesAvailable": false\n'
        " },\n"
        ' "events": []\n'
        "}"
    )


def _waypoint(sample: dict[str, Any], intervals: int) -> dict[str, Any]:
    return {
        **{key: sample[key] for key in ("x", "y", "heading")},
        "intervals": intervals,
        "split": False,
        "fixTranslation": True,
        "fixHeading": True,
        "overrideIntervals": False,
    }


def _expressions(waypoint: dict[str, Any]) -> dict[str, Any]:
    units = {"x": "m", "y": "m", "heading": "rad"}
    return {
        key: _expression(value, units[key]) if key in units else value
        for key, value in waypoint.items()
    }


def _expression(value: float, unit: str) -> dict[str, Any]:
    return {"exp": f"{value!r} {unit}", "val": value}
