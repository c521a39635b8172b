"""Checks of start and goal, and ways out of maps that are too narrow for the robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from numbers import Real
from typing import Any

import numpy as np

from omnidrive.errors import InvalidWaypoint, short_repr
from omnidrive.geometry import check_heading
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.plan import Waypoint

LOWER_MARGIN = (
    "lower the margin (--margin on the command line; in Python it is part of the keyword "
    "inflation), or choose a smaller robot or a finer map"
)
_SMALLER_ROBOT = "choose a smaller robot or a finer map; the robot is too large without a margin"
_BLOCKED = "a robot of any size needs a gap in the obstacles; check start, goal and map"
"""Ways out of a map that is too narrow for the robot."""


def checked_waypoint(grid: OccupancyGrid, name: str, waypoint: Waypoint) -> Waypoint:
    """Return the waypoint as floats.

    Raises:
        InvalidInput: The heading seems to be in degrees.
        InvalidWaypoint: It is not numeric or not finite, or lies outside the map.
    """
    waypoint = _numbers(name, waypoint)
    where = f"the {name} ({waypoint.x:g}, {waypoint.y:g}) m"
    if not np.isfinite(waypoint[:2]).all() or not (
        waypoint.yaw is None or np.isfinite(waypoint.yaw)
    ):
        raise InvalidWaypoint(f"{where} must be finite numbers: x and y in m, heading in rad")
    check_heading(f"the {name}'s heading", waypoint.yaw or 0.0)
    if not grid.contains(*grid.cell(waypoint.x, waypoint.y)):
        left, right, bottom, top = grid.extent
        raise InvalidWaypoint(
            f"{where} lies outside the map, which spans x {left:g} to {right:g} m "
            f"and y {bottom:g} to {top:g} m"
        )
    return waypoint


def _numbers(name: str, waypoint: Waypoint) -> Waypoint:
    """Return the waypoint as floats."""
    values: tuple[Any, ...] = tuple(waypoint) if isinstance(waypoint, Iterable) else (waypoint,)
    numbers = values[:2] + tuple(value for value in values[2:] if value is not None)
    if len(values) not in {2, 3} or not all(isinstance(value, Real) for value in numbers):
        raise InvalidWaypoint(
            f"the {name} must be two or three numbers, x and y in m and, optionally, a "
            f"heading in rad, such as Waypoint(1.5, 2.0); got {short_repr(values)}"
        )
    return Waypoint(*map(float, numbers))


def check_free(
    grid: OccupancyGrid, free_space: OccupancyGrid, inflations: tuple[float, float], needed: str
) -> None:
    """Raise InvalidWaypoint if no cell is free; ``needed`` names the first of the inflations."""
    if free_space.occupied.all():
        advice = way_out(grid, *inflations, lambda free: not free.occupied.all())
        raise InvalidWaypoint(
            f"no free cell of the map keeps {needed} from every obstacle; {advice}"
        )


def check_waypoint(
    grid: OccupancyGrid,
    free_space: OccupancyGrid,
    name: str,
    waypoint: Waypoint,
    needed: str,
) -> None:
    """Raise InvalidWaypoint in an obstacle, or nearer to one than ``needed``."""
    where = f"the {name} ({waypoint.x:g}, {waypoint.y:g}) m"
    if not free_space.is_occupied(waypoint.x, waypoint.y):
        return
    nearest = free_space.nearest_free(waypoint.x, waypoint.y)
    assert nearest is not None  # there are free cells
    cell, distance = nearest
    near = free_space.centre(*cell)
    if grid.is_occupied(waypoint.x, waypoint.y):
        fact = "lies inside an obstacle, the inflation stored in the map, or an unknown cell"
    else:
        gap = float(grid.clearance(np.array([waypoint[:2]]))[0])
        fact = (
            f"is {gap:.2f} m from an obstacle; the robot's centre must keep {needed}, "
            f"also measured from the centre of the map cell ({grid.resolution:g} m) around it"
        )
    raise InvalidWaypoint(
        f"{where} {fact}; the nearest valid position is ({near[0]:g}, {near[1]:g}) m, "
        f"{distance:.2g} m away"
    )


def way_out(
    grid: OccupancyGrid,
    inflation: float,
    minimum: float,
    is_wide_enough: Callable[[OccupancyGrid], bool],
) -> str:
    """Return what makes a map wide enough for the robot.

    Args:
        grid: The map.
        inflation: Inflation with which it is too narrow, m.
        minimum: Inflation without a margin, m.
        is_wide_enough: Whether an inflated map is wide enough.
    """
    if minimum < inflation and is_wide_enough(grid.inflated(minimum)):
        return LOWER_MARGIN
    return _SMALLER_ROBOT if is_wide_enough(grid) else _BLOCKED
