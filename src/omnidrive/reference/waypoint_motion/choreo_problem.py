"""Waypoints and constraints of a Choreo trajectory (`.traj`).

Source: Choreo, `src-core/src/spec/trajectory.rs`, and its `ConstraintSetter`: a constraint without
``to`` holds at one waypoint, ``KeepInRectangle`` has its corner at (x, y). A flat file of 2024 has
neither waypoints nor constraints: the ends of its samples and the points where they rest are taken.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import pi

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import wrap
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.reference.waypoint_motion.regions import ConvexPolygon, Disc
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint
from omnidrive.reference.waypoint_motion.waypoint_problem import MotionProblem
from omnidrive.reference.waypoints.choreo import choreo_reference
from omnidrive.reference.waypoints.field import Field

_LEAST_TOLERANCE = 0.01
"""Smallest tolerance of a heading that a spline can keep, in rad."""

_LEAST_LANE = 1e-3
"""Smallest half-width of a lane, in m; Choreo's may be 0, a straight line."""

_STILL = 1e-3
"""Velocities in m/s, m/s and rad/s below which samples rest."""

_NEAR = 0.05
"""Largest distance of the samples from a waypoint, in m; samples further away are outdated."""


def choreo_problem(root: Field) -> MotionProblem:
    """Return the problem of the parameters of a trajectory, with its samples as the guess.

    Raises:
        InvalidReference: The file has neither parameters nor samples, or a constraint is malformed
            or unknown.
    """
    parameters = root.get("params")
    if parameters is None:
        return _of_samples(choreo_reference(root))
    waypoints, sections = _parameters(parameters)
    return MotionProblem(tuple(waypoints), tuple(sections), _guess(root, waypoints))


def _of_samples(samples: SampledReference) -> MotionProblem:
    """Return the problem through the ends of samples and the points where they rest."""
    moving = np.abs(samples.twists).max(axis=1) > _STILL
    inner = np.flatnonzero(~moving[1:-1] & moving[:-2]) + 1
    at = [0, *inner.tolist(), len(moving) - 1]
    waypoints = [
        MotionWaypoint(x, y, wrap(yaw), stop=k in inner)
        for k, (x, y, yaw) in zip(at, samples.poses[at].tolist(), strict=True)
    ]
    return MotionProblem(tuple(waypoints), (), _legs(samples, at))


def _guess(root: Field, waypoints: list[MotionWaypoint]) -> tuple[Float[Array, "poses 3"], ...]:
    """Return the samples between waypoints; nothing if there are none or they are outdated."""
    trajectory = root.get("trajectory")
    times = trajectory.get("waypoints") if trajectory else None
    if trajectory is None or times is None or not trajectory["samples"].items():
        return ()
    samples = choreo_reference(root)
    passed = [each.number() for each in times.items()]
    if len(passed) != len(waypoints) or len(passed) < 2:
        return ()
    at = [int(np.abs(samples.times - time).argmin()) for time in passed]
    places = np.array([(each.x, each.y) for each in waypoints])
    far = np.hypot(*(samples.poses[at, :2] - places).T) > _NEAR
    fixed = np.array([each.fixed for each in waypoints])
    return () if (far & fixed).any() or np.diff(at).min() < 1 else _legs(samples, at)


def _legs(samples: SampledReference, at: list[int]) -> tuple[Float[Array, "poses 3"], ...]:
    return tuple(samples.poses[a : b + 1] for a, b in pairwise(at))


def _parameters(parameters: Field) -> tuple[list[MotionWaypoint], list[MotionSection]]:
    """Return waypoints and sections of the parameters of a trajectory."""
    waypoints = [
        MotionWaypoint(
            _value(each["x"]),
            _value(each["y"]),
            _value(each["heading"]) if _flag(each, "fixHeading", True) else None,
            fixed=_flag(each, "fixTranslation", True),
        )
        for each in parameters["waypoints"].items()
    ]
    sections = []
    constraints = parameters.get("constraints")
    for each in constraints.items() if constraints else []:
        if not _flag(each, "enabled", True):
            continue
        first = _index(each["from"], len(waypoints))
        to = each.get("to")
        last = first if to is None else _index(to, len(waypoints))
        first, last = min(first, last), max(first, last)
        kind = str(each["data"]["type"].value)
        if kind == "StopPoint" or (kind == "MaxVelocity" and first == last and _zero(each)):
            waypoints[first] = replace(waypoints[first], stop=True)
        elif not (kind == "KeepInLane" and first == last):
            sections.append(_section(each["data"], kind, first, last))
    return waypoints, sections


def _section(data: Field, kind: str, first: int, last: int) -> MotionSection:
    given = data["props"]
    if kind.startswith("Max"):
        return _limit(data, kind, MotionSection(first, last))
    if kind == "KeepInLane":
        return MotionSection(first, last, lane=max(_value(given["tolerance"]), _LEAST_LANE))
    if kind.startswith("Keep"):
        return _region(data, kind, MotionSection(first, last))
    if kind == "PointAt":
        return MotionSection(
            first,
            last,
            point_at=(_value(given["x"]), _value(given["y"])),
            point_tolerance=min(max(_value(given["tolerance"]), _LEAST_TOLERANCE), pi),
            point_offset=pi if _flag(given, "flip", False) else 0.0,
        )
    raise _unknown(data)


def _limit(data: Field, kind: str, section: MotionSection) -> MotionSection:
    value = _value(data["props"]["max"])
    if kind == "MaxVelocity":
        return replace(section, max_speed=value)
    if kind == "MaxAcceleration":
        return replace(section, max_acceleration=value)
    if kind == "MaxAngularVelocity":
        return replace(section, max_yaw_rate=value)
    raise _unknown(data)


def _region(data: Field, kind: str, section: MotionSection) -> MotionSection:
    given = data["props"]
    if kind in {"KeepInCircle", "KeepOutCircle"}:
        regions = (Disc(*(_value(given[key]) for key in ("x", "y", "r"))),)
        if kind == "KeepInCircle":
            return replace(section, keep_in=regions)
        return replace(section, keep_out=regions)
    if kind == "KeepInRectangle":
        x, y, w, h = (_value(given[key]) for key in ("x", "y", "w", "h"))
        turn = given.get("rotation")
        if turn is not None and _value(turn) != 0.0:
            raise turn.error("is not 0: only rectangles along the axes are read")
        corners = ((x, y), (x + w, y), (x + w, y + h), (x, y + h))
        return replace(section, keep_in=(ConvexPolygon(corners),))
    raise _unknown(data)


def _unknown(data: Field) -> InvalidReference:
    kind = data["type"]
    return kind.error(f"is {kind.description}, which is not a known constraint")


def _value(field: Field) -> float:
    """Return a number, given as itself or as the value of an expression, which is not evaluated.

    In beta files of 2025 an expression is a list of its text and its value.
    """
    if isinstance(field.value, list) and field.value:
        return field.items()[-1].number()
    return (field["val"] if isinstance(field.value, dict) else field).number()


def _zero(constraint: Field) -> bool:
    return _value(constraint["data"]["props"]["max"]) == 0.0


def _flag(field: Field, key: str, default: bool) -> bool:
    found = field.get(key)
    return default if found is None else found.value is True


def _index(field: Field, count: int) -> int:
    if field.value in {"first", "last"} if isinstance(field.value, str) else False:
        return 0 if field.value == "first" else count - 1
    index = field.number()
    if not (index.is_integer() and 0 <= index < count):
        raise field.error(f"is {field.description}, and there are {count} waypoints")
    return int(index)
