"""Waypoints and constraints of a PathPlanner path (`.path`).

Zones and rotation targets between waypoints become waypoints on the curve; with a free position
the optimisation would shorten zones.
A zone replaces the limits of the whole path; where zones overlap, the first one holds.
Source: PathPlannerLib, `path_constraints.dart`, `constraints_zone.dart`, `point_towards_zone.dart`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, pairwise
from math import inf, radians

import numpy as np

from omnidrive.geometry import wrap
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint
from omnidrive.reference.waypoint_motion.waypoint_problem import MotionProblem
from omnidrive.reference.waypoints.bezier_chain import chain_points
from omnidrive.reference.waypoints.field import Field
from omnidrive.reference.waypoints.pathplanner import curves_of, rotation_targets


def pathplanner_problem(root: Field) -> MotionProblem:
    """Return waypoints and sections of a path.

    Raises:
        InvalidReference: The file is not a valid path.
    """
    curves = curves_of(root)
    count = len(curves)
    targets = rotation_targets(root, count)
    limits, aims = _zones(root, count)
    places = waypoint_places(root)
    points = chain_points(curves, np.array(places))
    rests = _rests(root)
    waypoints = []
    for place, (x, y) in zip(places, points.tolist(), strict=True):
        inside = any(low <= place <= high for (low, high), _ in aims)
        yaw = None if inside else targets.get(place)
        yaw = None if yaw is None else wrap(yaw)
        waypoints.append(MotionWaypoint(x, y, yaw, stop=place in rests))
    sections = []
    everywhere = root.get("globalConstraints") or root  # in files of 2023, of the file itself
    limits.append(((0.0, float(count)), everywhere))
    for first, last, given in _first_limits(places, limits):
        unlimited = given.get("unlimited")
        if unlimited is None or unlimited.value is not True:
            sections.append(
                MotionSection(
                    first,
                    last,
                    max_speed=_limit(given, "maxVelocity"),
                    max_acceleration=_limit(given, "maxAcceleration"),
                    max_yaw_rate=radians(_limit(given, "maxAngularVelocity")),
                    max_yaw_acceleration=radians(_limit(given, "maxAngularAcceleration")),
                )
            )
    for k, each in enumerate(root["waypoints"].items()):
        override = each.get("velOverride")  # in files of 2023
        if override is not None and override.number() > 0.0:
            at = places.index(float(k))
            sections.append(MotionSection(at, at, max_speed=override.number()))
    for (low, high), zone in aims:
        target, offset = zone["fieldPosition"], zone.get("rotationOffset")
        turn = 0.0 if offset is None else radians(offset.number())
        point = (target["x"].number(), target["y"].number())
        first, last = places.index(low), places.index(high)
        sections.append(MotionSection(first, last, point_at=point, point_offset=turn))
    return MotionProblem(tuple(waypoints), tuple(sections))


def waypoint_places(root: Field) -> list[float]:
    """Return the parameters of the waypoints of the problem on the curves, 1 for each curve."""
    count = len(curves_of(root))
    limits, aims = _zones(root, count)
    places = {*map(float, range(count + 1)), *rotation_targets(root, count)}
    places.update(value for bounds, _ in [*limits, *aims] for value in bounds)
    return sorted(places)


_Zones = list[tuple[tuple[float, float], Field]]


def _zones(root: Field, count: int) -> tuple[_Zones, _Zones]:
    """Return the zones with limits and those with a point to point at, with their bounds."""
    limits = [(_range(zone, count), zone["constraints"]) for zone in _list(root, "constraintZones")]
    aims = [(_range(zone, count), zone) for zone in _list(root, "pointTowardsZones")]
    return limits, [(bounds, zone) for bounds, zone in aims if bounds[1] > bounds[0]]


def _rests(root: Field) -> set[float]:
    """Return the path parameters of the stops and reversals of a file of 2023."""
    return {
        float(k)
        for k, each in enumerate(root["waypoints"].items())
        for key in ("isStopPoint", "isReversal")
        if (found := each.get(key)) is not None and found.value is True
    }


def _first_limits(
    places: list[float], limits: list[tuple[tuple[float, float], Field]]
) -> Iterator[tuple[int, int, Field]]:
    """Yield the first limits that hold on each leg, with the bounds of runs of the same limits."""
    holding = [
        next((k for k, ((a, b), _) in enumerate(limits) if a <= low and high <= b), None)
        for low, high in pairwise(places)
    ]
    for key, run in groupby(range(len(holding)), key=holding.__getitem__):
        legs = list(run)
        if key is not None:
            yield legs[0], legs[-1] + 1, limits[key][1]


def _limit(limits: Field, key: str) -> float:
    found = limits.get(key)
    return inf if found is None else found.number()


def _list(root: Field, key: str) -> list[Field]:
    found = root.get(key)
    return [] if found is None else found.items()


def _range(zone: Field, curves: int) -> tuple[float, float]:
    """Return the path parameters of a zone."""
    low, high = (zone[f"{name}WaypointRelativePos"].number() for name in ("min", "max"))
    if low > high:
        raise zone.error(f"starts at {low:g}, after its end, {high:g}")
    return min(max(low, 0.0), float(curves)), min(max(high, 0.0), float(curves))
