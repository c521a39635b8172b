"""PathPlanner paths (`.path`): JSON, a chain of cubic Bezier curves with headings.

The reader accepts files of PathPlanner 2022 to 2026; the writer writes version 2025.0.
Positions are in m and rotations in degrees, in the frame of the field, which is W. Source:
PathPlannerLib, `path.py` and `trajectory.py`.
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
from omnidrive.reference.sampled_reference import MAX_SAMPLES
from omnidrive.reference.waypoints.bezier_chain import (
    BezierChain,
    chain_points,
    fit_chain,
    step_counts,
)
from omnidrive.reference.waypoints.field import Field, read_json
from omnidrive.reference.waypoints.text_file import write_text
from omnidrive.reference.waypoints.waypoints import Waypoints, untimed_waypoints

_READ_TOLERANCE = 1e-3  # m between the curve and the polyline through its samples
_SPACING, _STEPS = 0.05, 20_000  # largest distance of samples in m, for up to 20,000 samples
_WRITE_TOLERANCE = 5e-3  # m between the path and the curves
_MAX_ZONES = 1000
_TURN_TOLERANCE = 0.01  # rad between the heading at a point of the path and that of PathPlanner
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
    """Read a path: poses within 1 mm of the curves and at most 5 cm apart.

    On a path longer than 1 km the poses are up to a 20,000th of its length apart.

    The headings are those of PathPlanner for a holonomic robot: the rotations of the start, the
    rotation targets, the point-towards zones and the end, with cosine interpolation over the
    distance in between. Events and speeds are ignored; constraints:
    :func:`~omnidrive.reference.waypoint_motion.load_motion_problem`.

    Raises:
        InvalidReference: The file is not a valid path; the message gives the position.
    """
    root = read_json(file)
    return untimed_waypoints(root.file, curve_poses(root)[1])


def curve_poses(root: Field) -> tuple[Float[Array, " poses"], Float[Array, "poses 3"]]:
    """Return poses along the curves of a path, and the path parameter of each, see above.

    The parameter increases by 1 on each curve.
    """
    controls = curves_of(root)
    spacing = _spacing(float(np.linalg.norm(np.diff(controls, axis=1), axis=2).sum()))
    counts = step_counts(controls, _READ_TOLERANCE, spacing)
    if sum(counts) > MAX_SAMPLES:
        raise root["waypoints"].error(
            f"need {sum(counts):,} samples, more than {MAX_SAMPLES:,}; are they in m?"
        )
    targets = rotation_targets(root, len(controls))
    even = [i + np.arange(n) / n for i, n in enumerate(counts)]
    parameters = np.unique(np.concatenate([*even, [float(len(controls))], list(targets)]))
    points = chain_points(controls, parameters)
    moved = np.concatenate([[True], (np.diff(points, axis=0) != 0.0).any(axis=1)])
    parameters, points = parameters[moved], points[moved]
    if len(points) < 2:
        raise root["waypoints"].error("are all at the same position; move one of them")
    _point_towards(root, parameters, points, targets)
    distance, ordered = cumulative_length(points), sorted(targets)
    yaw = _interpolate_yaw(
        distance,
        np.interp(ordered, parameters, distance),
        np.unwrap([targets[at] for at in ordered]),
    )
    return parameters, np.column_stack([points, yaw])


def write_pathplanner(file: pathlib.Path, waypoints: Waypoints, _frame_id: str) -> None:
    """Write a path within 5 mm of the polyline through the poses, with headings within 0.02 rad.

    Of a reference only the speeds at its ends are kept, not its times. The limits are those of the
    PathPlanner project. The PathPlanner editor (not the library) lengthens control lines shorter
    than 0.25 m.

    Raises:
        InvalidReference: The waypoints do not move, or turn on the spot.
    """
    poses, speeds = waypoints.poses, (0.0, 0.0)
    if not isinstance(waypoints, Path):
        first, *_, last = np.linalg.norm(waypoints.twists[:, :2], axis=1).tolist()
        speeds = (first, last)
    poses = _densify(_without_repeats(poses))
    chain = fit_chain(poses[:, :2], _WRITE_TOLERANCE)
    write_text(file, json.dumps(_document(chain, poses[:, 2], speeds), indent=2) + "\n")


def curves_of(root: Field) -> Float[Array, "curves 4 2"]:
    """Return the Bezier points of the curves of a path, in m."""
    waypoints = root["waypoints"].items()
    if len(waypoints) < 2:
        raise root["waypoints"].error(f"has {len(waypoints)} entries, need at least 2")
    curves = []
    for now, after in pairwise(waypoints):
        corners = (_anchor(now), now["nextControl"], after["prevControl"], _anchor(after))
        curve = [[corner["x"].number(), corner["y"].number()] for corner in corners]
        if all(point == curve[0] for point in curve):
            raise after.error(f"has the position of {now.name}; remove one of the two")
        curves.append(curve)
    return np.array(curves)


def _anchor(waypoint: Field) -> Field:
    """Return the position of a waypoint, whose key was ``anchorPoint`` until 2023."""
    return waypoint.get("anchorPoint") or waypoint["anchor"]


def rotation_targets(root: Field, curves: int) -> dict[float, float]:
    """Return headings, in rad, by path parameter; both ends are always included."""
    if root.get("goalEndState") is None and root["waypoints"].items()[0].get("anchorPoint"):
        return _waypoint_headings(root, curves)
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


def _waypoint_headings(root: Field, curves: int) -> dict[float, float]:
    """Return the headings of the waypoints of a file of 2022 or 2023, which may have none."""
    found = {
        float(k): radians(angle.number())
        for k, each in enumerate(root["waypoints"].items())
        if (angle := each.get("holonomicAngle")) is not None
    }
    start = found.get(min(found, default=0.0), 0.0)
    end = found.get(max(found, default=0.0), 0.0)
    return {0.0: start, float(curves): end, **found}


def _point_towards(
    root: Field, parameters: Float[Array, " n"], points: Float[Array, "n 2"],
    targets: dict[float, float],
) -> None:  # fmt: skip
    """Add the headings of the zones in which the robot points towards a position."""
    found = root.get("pointTowardsZones")
    zones = found.items() if found else []
    if len(zones) > _MAX_ZONES:
        raise root["pointTowardsZones"].error(f"has more than {_MAX_ZONES:,} entries")
    aims = np.full((len(points), 3), np.nan)  # x and y in m, rotation offset in rad
    for zone in reversed(zones):  # where zones overlap, the first one holds
        low = zone["minWaypointRelativePos"].number()
        high = zone["maxWaypointRelativePos"].number()
        target, offset = zone["fieldPosition"], zone.get("rotationOffset")
        turn = radians(offset.number()) if offset else 0.0
        inside = (parameters >= low) & (parameters <= high)
        aims[inside] = target["x"].number(), target["y"].number(), turn
    aimed = np.isfinite(aims[:, 0])
    aimed[[0, -1]] = False
    away = aims[aimed, :2] - points[aimed]
    headings = np.arctan2(away[:, 1], away[:, 0]) + aims[aimed, 2]
    targets.update(zip(parameters[aimed].tolist(), headings.tolist(), strict=True))


def _spacing(length: float) -> float:
    """Return the largest distance of samples, in m, on a path of the given length in m."""
    return max(_SPACING, length / _STEPS)


def _interpolate_yaw(
    s: Float[Array, " n"], at: Float[Array, " targets"], yaw: Float[Array, " targets"]
) -> Float[Array, " n"]:
    """Return headings at distances ``s`` by PathPlannerLib's cosine interpolation of targets."""
    i = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(at) - 2)
    span = at[i + 1] - at[i]
    part = np.where(span > 0.0, (s - at[i]) / np.where(span > 0.0, span, 1.0), 1.0)
    weight = 0.5 - 0.5 * np.cos(np.pi * np.clip(part, 0.0, 1.0))
    headings: Float[Array, " n"] = yaw[i] + weight * (yaw[i + 1] - yaw[i])
    return headings


def _without_repeats(poses: Float[Array, "n 3"]) -> Float[Array, "moving 3"]:
    """Return the poses without repetitions; raise InvalidReference if one turns on the spot."""
    still = np.abs(np.diff(poses[:, :2], axis=0)).max(axis=1) < 1e-9
    turning = np.flatnonzero(still & (np.abs(np.diff(poses[:, 2])) > _TURN_TOLERANCE))
    if len(turning):
        i = int(turning[0])
        raise InvalidReference(
            f"the robot turns on the spot at x {poses[i, 0]:g} m, y {poses[i, 1]:g} m, which a "
            "PathPlanner path cannot represent; save it as .csv, .traj or .yaml"
        )
    moving: Float[Array, "moving 3"] = poses[np.concatenate([[True], ~still])]
    if len(moving) < 2:
        raise InvalidReference("the waypoints are all at the same position: not a PathPlanner path")
    return moving


def _densify(poses: Float[Array, "n 3"]) -> Float[Array, "dense 3"]:
    """Return the same polyline with additional poses on its long edges."""
    lengths = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    counts = np.ceil(np.maximum(lengths / _spacing(float(lengths.sum())), 1.0))
    at = np.concatenate([i + np.arange(n) / n for i, n in enumerate(counts)] + [[len(counts)]])
    yaw = np.unwrap(poses[:, 2])
    columns = [np.interp(at, np.arange(len(poses)), c) for c in (*poses[:, :2].T, yaw)]
    return np.column_stack(columns)


def _rotation_targets_of(s: Float[Array, " n"], yaw: Float[Array, " n"]) -> list[int]:
    """Return indices of the rotation targets that keep every heading within 0.01 rad.

    Both ends are included. PathPlanner turns by less than half a turn between two targets, so that
    neighbouring targets differ by less than that.
    """
    needed, waiting = {0, len(s) - 1}, [(0, len(s) - 1)]
    while waiting:
        a, b = waiting.pop()
        if b - a < 2:
            continue
        error = np.abs(_interpolate_yaw(s[a + 1 : b], s[[a, b]], yaw[[a, b]]) - yaw[a + 1 : b])
        far = abs(yaw[b] - yaw[a]) >= 0.99 * np.pi
        if far or error.max() > _TURN_TOLERANCE:
            worst = (a + b) // 2 if far else a + 1 + int(np.argmax(error))
            needed.add(worst)
            waiting += [(a, worst), (worst, b)]
    return sorted(needed)


def _document(
    chain: BezierChain, yaw: Float[Array, " points"], speeds: tuple[float, float]
) -> dict[str, Any]:
    """Return the content of the file; ``speeds`` are those at the ends, in m/s."""
    points = chain_points(chain.controls, chain.parameters)
    turns = _rotation_targets_of(cumulative_length(points), yaw)
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
            "anchor": _position(anchor),
            "prevControl": _position(previous),
            "nextControl": _position(following),
            "isLocked": False,
            "linkedName": None,
        }
        for anchor, previous, following in zip(starts, before, after, strict=True)
    ]


def _position(point: list[float] | None) -> dict[str, float] | None:
    return None if point is None else {"x": point[0], "y": point[1]}


def _degrees(yaw: float) -> float:
    return degrees(wrap(float(yaw)))
