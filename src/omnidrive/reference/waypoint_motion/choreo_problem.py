"""Waypoints and constraints of a Choreo trajectory (`.traj`).

Source: Choreo, `src-core/src/spec/trajectory.rs`, and its `ConstraintSetter`: a constraint without
``to`` holds at one waypoint, ``KeepInRectangle`` has its corner at (x, y).
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

from omnidrive.errors import InvalidReference
from omnidrive.reference.waypoint_motion.regions import Disc, Polygon
from omnidrive.reference.waypoint_motion.waypoint import MotionWaypoint, Section
from omnidrive.reference.waypoints.field import Field

_LEAST_TOLERANCE = 0.01
"""Smallest tolerance of a heading that a spline can keep, in rad."""


def choreo_problem(root: Field) -> tuple[list[MotionWaypoint], list[Section]]:
    """Return waypoints and sections of the parameters of a trajectory.

    Raises:
        InvalidReference: The file has no parameters, or a constraint is malformed or unknown.
    """
    parameters = root["params"]
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
        if kind == "StopPoint":
            waypoints[first] = replace(waypoints[first], stop=True)
        elif not (kind == "KeepInLane" and first == last):
            sections.append(_section(each["data"], kind, first, last))
    return waypoints, sections


def _section(data: Field, kind: str, first: int, last: int) -> Section:
    given = data["props"]
    if kind.startswith("Max"):
        return _limit(data, kind, Section(first, last))
    if kind == "KeepInLane":
        return Section(first, last, lane=_value(given["tolerance"]))
    if kind.startswith("Keep"):
        return _region(data, kind, Section(first, last))
    if kind == "PointAt":
        return Section(
            first,
            last,
            point_at=(_value(given["x"]), _value(given["y"])),
            point_tolerance=min(max(_value(given["tolerance"]), _LEAST_TOLERANCE), pi),
            point_offset=pi if _flag(given, "flip", False) else 0.0,
        )
    raise _unknown(data)


def _limit(data: Field, kind: str, section: Section) -> Section:
    value = _value(data["props"]["max"])
    if kind == "MaxVelocity":
        return replace(section, max_speed=value)
    if kind == "MaxAcceleration":
        return replace(section, max_acceleration=value)
    if kind == "MaxAngularVelocity":
        return replace(section, max_yaw_rate=value)
    raise _unknown(data)


def _region(data: Field, kind: str, section: Section) -> Section:
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
        return replace(section, keep_in=(Polygon(corners),))
    raise _unknown(data)


def _unknown(data: Field) -> InvalidReference:
    kind = data["type"]
    return kind.error(f"is {kind.description}, which is not a known constraint")


def _value(field: Field) -> float:
    """Return a number, given as itself or as the value of an expression, which is not evaluated."""
    return (field["val"] if isinstance(field.value, dict) else field).number()


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
