"""Faults of a problem that need no solver: every one, with the constraint to blame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from math import hypot, inf, isfinite, isnan, pi

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.geometry import wrap
from omnidrive.reference.waypoint_motion.regions import Region, distance
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint

TOLERANCE = 1e-5
"""Distance by which a region may be missed, in m."""

_MAX_WAYPOINTS = 200
"""Largest number of waypoints."""

_FURTHEST = 1e6
"""Largest magnitude of a coordinate, in m."""

_UNITS = {
    "max_speed": "m/s",
    "max_acceleration": "m/s^2",
    "max_yaw_rate": "rad/s",
    "max_yaw_acceleration": "rad/s^2",
    "lane": "m",
}


def check_problem(
    waypoints: Sequence[MotionWaypoint], sections: Sequence[MotionSection], body_radius: float
) -> tuple[MotionSection, ...]:
    """Return the sections with indices that are not negative.

    Raises:
        InvalidInput: The problem has faults; the message names all of them.
    """
    count, found = len(waypoints), [*_waypoint_faults(waypoints)]
    if not (isfinite(body_radius) and body_radius >= 0.0):
        found.append(f"the body radius must not be negative, got {body_radius:g} m")
    places_are_known = not found
    sound: dict[int, MotionSection] = {}
    for number, section in enumerate(sections):
        own = [f"section {number}: {fault}" for fault in _own_faults(section, count)]
        found += own
        if not own:
            sound[number] = _counted(section, count)
    if places_are_known:
        for number, section in sound.items():
            found += _faults_at_waypoints(waypoints, section, number, body_radius)
        found += _contradictions(waypoints, sound)
    if found:
        raise InvalidInput("; ".join(found))
    return tuple(sound.values())


def check_guess(guess: Sequence[Float[Array, "poses 3"]], legs: int) -> None:
    """Raise InvalidInput if a guess does not have at least two finite poses for each leg."""
    if len(guess) not in {0, legs}:
        raise InvalidInput(f"the guess has {len(guess)} legs, and the waypoints have {legs}")
    for leg, poses in enumerate(guess):
        shape = np.shape(poses)
        if len(shape) != 2 or shape[0] < 2 or shape[1] != 3 or not np.isfinite(poses).all():
            raise InvalidInput(f"leg {leg} of the guess must be two or more finite poses of (n, 3)")


def place(waypoints: Sequence[MotionWaypoint], index: int) -> str:
    """Return the name of a waypoint in messages."""
    return f"waypoint {index} at ({waypoints[index].x:g}, {waypoints[index].y:g})"


def _counted(section: MotionSection, count: int) -> MotionSection:
    return replace(section, first=section.first % count, last=section.last % count)


def _waypoint_faults(waypoints: Sequence[MotionWaypoint]) -> Iterator[str]:
    if not 2 <= len(waypoints) <= _MAX_WAYPOINTS:
        yield f"need 2 to {_MAX_WAYPOINTS} waypoints, got {len(waypoints)}"
        return
    for index, each in enumerate(waypoints):
        if not all(abs(value) <= _FURTHEST for value in (each.x, each.y)):  # NaN as well
            yield (
                f"waypoint {index} is at ({each.x:g}, {each.y:g}) m, need numbers of at most "
                f"{_FURTHEST:g} in magnitude"
            )
        if each.yaw is not None and not abs(each.yaw) <= 4.0 * pi:
            yield f"waypoint {index} has the heading {each.yaw:g} rad, need at most two turns"
    for index in (0, -1):
        if not waypoints[index].fixed:
            yield f"the {'last' if index else 'first'} waypoint must have a fixed position"
    for index, (one, other) in enumerate(pairwise(waypoints)):
        same = (one.x, one.y) == (other.x, other.y) and one.fixed and other.fixed
        if same and (one.yaw is None or other.yaw is None or wrap(one.yaw - other.yaw) == 0.0):
            yield (
                f"waypoints {index} and {index + 1} are both at ({one.x:g}, {one.y:g}) without "
                "different headings; remove one of the two"
            )


def _own_faults(section: MotionSection, count: int) -> Iterator[str]:
    bounds = (section.first, section.last)
    if not all(-count <= index < count for index in bounds):
        yield f"it is from waypoint {bounds[0]} to {bounds[1]}, and there are {count} waypoints"
    elif section.first % count > section.last % count:
        yield f"its first waypoint, {bounds[0]}, comes after its last, {bounds[1]}"
    elif section.first == section.last and isfinite(section.lane):
        yield "a lane needs two different waypoints"
    elif section.first == section.last and section.max_yaw_rate == 0.0:
        yield "a yaw rate of 0 needs two different waypoints"
    for name, unit in _UNITS.items():
        value = getattr(section, name)
        if isnan(value) or value < 0.0 or (value == 0.0 and name != "max_yaw_rate"):
            yield f"{name} must be positive, got {value:g} {unit}"
    if section.point_at is not None:
        if not np.isfinite([*section.point_at, section.point_offset]).all():
            yield "the point to point at, and its offset, must be finite"
        if not 0.0 < section.point_tolerance <= pi:
            yield f"point_tolerance must be positive, got {section.point_tolerance:g} rad"


def _faults_at_waypoints(
    waypoints: Sequence[MotionWaypoint], section: MotionSection, number: int, body_radius: float
) -> Iterator[str]:
    """Yield the constraints of a section that a waypoint violates."""
    for index in range(section.first, section.last + 1):
        each = waypoints[index]
        if not each.fixed:
            continue
        here, at = place(waypoints, index), np.array([[each.x, each.y]])
        for region in section.keep_in:
            inside = float(region.depth(at)[0]) - body_radius
            if inside < -TOLERANCE:
                yield f"{here} {_outside(inside, body_radius, region, number)}"
        for region in section.keep_out:
            outside = float(distance(region, at)[0]) - body_radius
            if outside < -TOLERANCE:
                yield f"{here} {_inside(at, body_radius, region, number)}"
        if isfinite(section.lane):
            off = _off_line(waypoints[section.first], waypoints[section.last], each)
            if off > section.lane + TOLERANCE:
                yield f"{here} lies {off - section.lane:.3g} m outside the lane of section {number}"
        yield from _pointing_fault(each, here, section, number)
    if section.max_yaw_rate == 0.0:
        known = [
            (k, each.yaw)
            for k, each in enumerate(waypoints[section.first : section.last + 1], section.first)
            if each.yaw is not None
        ]
        for k, yaw in known[1:]:
            if abs(wrap(yaw - known[0][1])) > TOLERANCE:
                yield (
                    f"section {number} has a yaw rate of 0, and the headings of waypoints "
                    f"{known[0][0]} and {k} differ"
                )


def _outside(inside: float, body_radius: float, region: Region, number: int) -> str:
    body = f" with its body of radius {body_radius:g} m" if body_radius else ""
    return f"lies{body} {-inside:.3g} m outside the keep-in {region} of section {number}"


def _inside(at: Float[Array, "1 2"], body_radius: float, region: Region, number: int) -> str:
    depth = float(region.depth(at)[0])
    if depth >= 0.0:
        return f"lies {depth:.3g} m inside the keep-out {region} of section {number}"
    gap = float(distance(region, at)[0])
    return (
        f"lies {gap:.3g} m from the keep-out {region} of section {number}, less than the body "
        f"radius {body_radius:g} m"
    )


def _pointing_fault(
    waypoint: MotionWaypoint, here: str, section: MotionSection, number: int
) -> Iterator[str]:
    if section.point_at is None:
        return
    x, y = section.point_at
    if hypot(x - waypoint.x, y - waypoint.y) < 1e-3:
        yield f"{here} is the point at which the robot points in section {number}"
    elif waypoint.yaw is not None:
        off = abs(wrap(waypoint.yaw - _direction(waypoint, section)))
        if off > section.point_tolerance + 1e-6:
            yield (
                f"the heading of {here}, {waypoint.yaw:.3g} rad, is {off:.3g} rad from the "
                f"direction of ({x:g}, {y:g}), at which the robot points in section {number} with "
                f"a tolerance of {section.point_tolerance:g} rad"
            )


def _direction(waypoint: MotionWaypoint, section: MotionSection) -> float:
    x, y = section.point_at or (inf, inf)
    return float(np.arctan2(y - waypoint.y, x - waypoint.x)) + section.point_offset


def _off_line(start: MotionWaypoint, end: MotionWaypoint, point: MotionWaypoint) -> float:
    """Return the distance of a point from the line through two others, in m."""
    along = np.array([end.x - start.x, end.y - start.y])
    to = np.array([point.x - start.x, point.y - start.y])
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return float(np.linalg.norm(to))
    return float(abs(along[0] * to[1] - along[1] * to[0])) / length


def _contradictions(
    waypoints: Sequence[MotionWaypoint], sections: dict[int, MotionSection]
) -> Iterator[str]:
    """Yield pairs of sections in which the robot would have to point at two points at once."""
    pointing = [(n, each) for n, each in sections.items() if each.point_at is not None]
    for (one, a), (other, b) in combinations(pointing, 2):
        first, last = max(a.first, b.first), min(a.last, b.last)
        if first > last or (a.point_at, a.point_offset) == (b.point_at, b.point_offset):
            continue
        shared = [k for k in range(first, last + 1) if waypoints[k].fixed]
        allowed = a.point_tolerance + b.point_tolerance
        off = [abs(wrap(_direction(waypoints[k], a) - _direction(waypoints[k], b))) for k in shared]
        if first < last or any(value > allowed for value in off):
            yield (
                f"sections {one} and {other} share "
                f"{f'waypoints {first} to {last}' if first < last else f'waypoint {first}'} and "
                f"point at different points, {a.point_at} and {b.point_at}"
            )
