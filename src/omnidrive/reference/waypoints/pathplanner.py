"""PathPlanner paths (`.path`): JSON, a chain of cubic Bezier curves with headings along it.

Read are files of 2024 and 2025 (also written by PathPlanner of 2026); written is version 2025.0.
Positions are in m, rotations in degrees, the frame is the field's: ours. Source: PathPlannerLib,
`path.py` and `trajectory.py`.
"""

from __future__ import annotations

import json
import pathlib
from itertools import pairwise
from math import degrees, radians
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import wrap
from omnidrive.planning import Path
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference.sampled import MOST_SAMPLES
from omnidrive.reference.waypoints.bezier import Chain, even_parameters, fit, points_at
from omnidrive.reference.waypoints.field import Field, read_json
from omnidrive.reference.waypoints.text_file import write_text
from omnidrive.reference.waypoints.waypoints import Waypoints, untimed

_READ_TOLERANCE = 1e-3  # m between the curve and the polyline through its samples
_SPACING, _STEPS = 0.05, 20_000  # m between samples at most, if they are not more than this
_WRITE_TOLERANCE = 5e-3  # m between the path and the curves
_MOST_ZONES = 1000
_TURN_TOLERANCE = 0.01  # rad between the heading at a point of the path and PathPlanner's
_VERSION = "2025.0"
_CONSTRAINTS = {  # PathPlanner's own defaults: m/s, m/s^2, deg/s, deg/s^2, V
    "maxVelocity": 3.0,
    "maxAcceleration": 3.0,
    "maxAngularVelocity": 540.0,
    "maxAngularAcceleration": 720.0,
    "nominalVoltage": 12.0,
    "unlimited": False,
}


def read_pathplanner(file: pathlib.Path) -> Path:
    """Read a path: poses within 1 mm of the curves and no more than 5 cm apart.

    On a way of more than a kilometre they may be further apart, by a 20,000th of it.

    The heading is what PathPlanner gives a holonomic robot: the rotations of the start, of the
    rotation targets and zones to point towards, and of the end, eased by a cosine of the distance
    in between. Constraints, events and speeds are left out.

    Raises:
        InvalidReference: The file is no such path; the message says where.
    """
    root = read_json(file)
    controls = _controls(root)
    spacing = _spacing(float(np.linalg.norm(np.diff(controls, axis=1), axis=2).sum()))
    counts = even_parameters(controls, _READ_TOLERANCE, spacing)
    if sum(counts) > MOST_SAMPLES:
        raise root["waypoints"].refusal(
            f"need {sum(counts):,} samples to be followed, more than {MOST_SAMPLES:,}; "
            "are they in m?"
        )
    targets = _rotation_targets(root, len(controls))
    even = [i + np.arange(n) / n for i, n in enumerate(counts)]
    parameters = np.unique(np.concatenate([*even, [float(len(controls))], list(targets)]))
    points = points_at(controls, parameters)
    moved = np.concatenate([[True], (np.diff(points, axis=0) != 0.0).any(axis=1)])
    parameters, points = parameters[moved], points[moved]
    if len(points) < 2:
        raise root["waypoints"].refusal("are all at one place; move one of them")
    _point_towards(root, parameters, points, targets)
    along = cumulative_length(points)
    yaw = _eased(along, np.interp(sorted(targets), parameters, along),
                 np.unwrap([targets[at] for at in sorted(targets)]))  # fmt: skip
    return untimed(root.file, lambda i: f"sample {i}", np.column_stack([points, yaw]))


def write_pathplanner(file: pathlib.Path, waypoints: Waypoints, _frame_id: str) -> None:
    """Write a path: within 5 mm of the polyline through the poses, headings within 0.02 rad.

    A reference loses its times, all but the speeds at its ends. Limits are left to PathPlanner's
    project. Its editor, not its library, lengthens control lines shorter than 0.25 m.

    Raises:
        InvalidReference: The waypoints stand still or turn on the spot.
    """
    poses, speeds = waypoints.poses, (0.0, 0.0)
    if not isinstance(waypoints, Path):
        first, *_, last = np.linalg.norm(waypoints.twists[:, :2], axis=1).tolist()
        speeds = (first, last)
    poses = _dense(_moving(poses))
    chain = fit(poses[:, :2], _WRITE_TOLERANCE)
    write_text(file, json.dumps(_document(chain, poses[:, 2], speeds), indent=2) + "\n")


def _controls(root: Field) -> Float[Array, "curves 4 2"]:
    waypoints = root["waypoints"].items()
    if len(waypoints) < 2:
        raise root["waypoints"].refusal(f"has {len(waypoints)} entries, need at least 2")
    curves = []
    for now, after in pairwise(waypoints):
        corners = (now["anchor"], now["nextControl"], after["prevControl"], after["anchor"])
        curve = [[corner["x"].number(), corner["y"].number()] for corner in corners]
        if all(point == curve[0] for point in curve):
            raise after.refusal(f"is where {now.name} is; remove one of the two")
        curves.append(curve)
    return np.array(curves)


def _rotation_targets(root: Field, curves: int) -> dict[float, float]:
    """Headings, in rad, by the parameter at which they hold; always one for either end."""
    end = radians(root["goalEndState"]["rotation"].number())
    inner: dict[float, float] = {}
    targets = root.get("rotationTargets")
    for target in targets.items() if targets else []:
        at = target["waypointRelativePos"].number()
        if 0.0 < at < curves:
            inner[at] = radians(target["rotationDegrees"].number())
    start = root.get("idealStartingState") or root.get("previewStartingState")  # 2025, 2024
    first = radians(start["rotation"].number()) if start else inner.get(min(inner, default=0), end)
    return {0.0: first, **inner, float(curves): end}


def _point_towards(
    root: Field, parameters: Float[Array, " n"], points: Float[Array, "n 2"],
    targets: dict[float, float],
) -> None:  # fmt: skip
    """Add the headings of the zones in which the robot points towards a place."""
    found = root.get("pointTowardsZones")
    zones = found.items() if found else []
    if len(zones) > _MOST_ZONES:
        raise root["pointTowardsZones"].refusal(f"has more than {_MOST_ZONES:,} entries")
    aims = np.full((len(points), 3), np.nan)  # x and y in m, then what to turn by, in rad
    for zone in reversed(zones):  # of two, the first one holds
        low = zone["minWaypointRelativePos"].number()
        high = zone["maxWaypointRelativePos"].number()
        place, offset = zone["fieldPosition"], zone.get("rotationOffset")
        turn = radians(offset.number()) if offset else 0.0
        inside = (parameters >= low) & (parameters <= high)
        aims[inside] = place["x"].number(), place["y"].number(), turn
    aimed = np.isfinite(aims[:, 0])
    aimed[[0, -1]] = False
    away = aims[aimed, :2] - points[aimed]
    headings = np.arctan2(away[:, 1], away[:, 0]) + aims[aimed, 2]
    targets.update(zip(parameters[aimed].tolist(), headings.tolist(), strict=True))


def _spacing(length: float) -> float:
    """How far apart samples of a way of so many metres may be, in m."""
    return max(_SPACING, length / _STEPS)


def _eased(
    s: Float[Array, " n"], at: Float[Array, " targets"], yaw: Float[Array, " targets"]
) -> Float[Array, " n"]:
    """Headings at distances ``s`` between targets: PathPlannerLib's cosine interpolation."""
    i = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(at) - 2)
    span = at[i + 1] - at[i]
    part = np.where(span > 0.0, (s - at[i]) / np.where(span > 0.0, span, 1.0), 1.0)
    weight = 0.5 - 0.5 * np.cos(np.pi * np.clip(part, 0.0, 1.0))
    headings: Float[Array, " n"] = yaw[i] + weight * (yaw[i + 1] - yaw[i])
    return headings


def _moving(poses: Float[Array, "n 3"]) -> Float[Array, "moving 3"]:
    """The poses without those that repeat the one before; refused if one turns on the spot."""
    still = np.abs(np.diff(poses[:, :2], axis=0)).max(axis=1) < 1e-9
    turning = np.flatnonzero(still & (np.abs(np.diff(poses[:, 2])) > _TURN_TOLERANCE))
    if len(turning):
        i = int(turning[0])
        raise InvalidReference(
            f"the robot turns on the spot at x {poses[i, 0]:g} m, y {poses[i, 1]:g} m, which a "
            "PathPlanner path cannot hold; save it as .csv, .traj or .yaml"
        )
    moving: Float[Array, "moving 3"] = poses[np.concatenate([[True], ~still])]
    if len(moving) < 2:
        raise InvalidReference("the waypoints are all at one place: no PathPlanner path")
    return moving


def _dense(poses: Float[Array, "n 3"]) -> Float[Array, "dense 3"]:
    """The same polyline with more poses on its long edges."""
    lengths = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    counts = np.ceil(np.maximum(lengths / _spacing(float(lengths.sum())), 1.0))
    at = np.concatenate([i + np.arange(n) / n for i, n in enumerate(counts)] + [[len(counts)]])
    yaw = np.unwrap(poses[:, 2])
    columns = [np.interp(at, np.arange(len(poses)), c) for c in (*poses[:, :2].T, yaw)]
    return np.column_stack(columns)


def _turns(s: Float[Array, " n"], yaw: Float[Array, " n"]) -> list[int]:
    """Which headings PathPlanner must be told to have every one within 0.01 rad, the ends too.

    From one to the next it turns the short way, so that they are less than half a turn apart.
    """
    needed, waiting = {0, len(s) - 1}, [(0, len(s) - 1)]
    while waiting:
        a, b = waiting.pop()
        if b - a < 2:
            continue
        miss = np.abs(_eased(s[a + 1 : b], s[[a, b]], yaw[[a, b]]) - yaw[a + 1 : b])
        far = abs(yaw[b] - yaw[a]) >= 0.99 * np.pi
        if far or miss.max() > _TURN_TOLERANCE:
            worst = (a + b) // 2 if far else a + 1 + int(np.argmax(miss))
            needed.add(worst)
            waiting += [(a, worst), (worst, b)]
    return sorted(needed)


def _document(
    chain: Chain, yaw: Float[Array, " points"], speeds: tuple[float, float]
) -> dict[str, Any]:
    """The file's content; ``speeds`` are those at the ends, in m/s."""
    points = points_at(chain.controls, chain.parameters)
    turns = _turns(cumulative_length(points), yaw)
    return {
        "version": _VERSION,
        "waypoints": _waypoints(chain.controls.tolist()),
        "rotationTargets": [
            {
                "waypointRelativePos": float(chain.parameters[i]),
                "rotationDegrees": _degrees(yaw[i]),
            }
            for i in turns[1:-1]
        ],
        "constraintZones": [],
        "pointTowardsZones": [],
        "eventMarkers": [],
        "globalConstraints": _CONSTRAINTS,
        "goalEndState": {"velocity": speeds[1], "rotation": _degrees(yaw[-1])},
        "reversed": False,
        "folder": None,
        "idealStartingState": {"velocity": speeds[0], "rotation": _degrees(yaw[0])},
        "useDefaultConstraints": True,
    }


def _waypoints(controls: list[list[list[float]]]) -> list[dict[str, Any]]:
    starts = [curve[0] for curve in controls] + [controls[-1][3]]
    before = [None] + [curve[2] for curve in controls]
    after = [curve[1] for curve in controls] + [None]
    return [
        {
            "anchor": _place(anchor),
            "prevControl": _place(previous),
            "nextControl": _place(following),
            "isLocked": False,
            "linkedName": None,
        }
        for anchor, previous, following in zip(starts, before, after, strict=True)
    ]


def _place(point: list[float] | None) -> dict[str, float] | None:
    return None if point is None else {"x": point[0], "y": point[1]}


def _degrees(yaw: float) -> float:
    return degrees(wrap(float(yaw)))
