"""From a map, a start and a goal to a smooth path."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Real
from typing import Annotated, Any, NamedTuple

import numpy as np

from omnidrive.errors import InvalidInput, InvalidWaypoint
from omnidrive.files.bounded_file import short_repr
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import Bounds
from omnidrive.planning.headings import with_headings
from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.search import HeuristicName, MethodName, SearchResult, search
from omnidrive.planning.smoothing import SmoothingName, smooth

_ROOM = 0.2
"""Distance in cells from the inflated obstacles that certified paths keep where they can: hardly
less smooth than none, and no path grazes."""


class Waypoint(NamedTuple):
    """Where to start or end: x, y in m, yaw in rad; without yaw, along the path."""

    x: float
    y: float
    yaw: Annotated[float, Bounds(-6.3, 6.3, "rad")] | None = None


@dataclass(frozen=True, slots=True)
class PathOptions:
    """How a path is searched and smoothed; the defaults suit every map.

    Attributes:
        search: How a way over the cells is searched, see :func:`~omnidrive.planning.search`.
        heuristic: What the search takes to be left to go; None for its usual one.
        cut_corners: Let diagonal moves pass occupied cells.
        smooth: How the way is smoothed, see :func:`~omnidrive.planning.smooth`.
        turn_within: Distance over which the heading turns from the start's to the path's and
            from the path's to the goal's, in m; 0 turns between two control points.
    """

    search: MethodName = "astar"
    heuristic: HeuristicName | None = None
    cut_corners: bool = False
    smooth: SmoothingName = "certified"
    turn_within: Annotated[float, Bounds(0.0, 10.0, "m")] = 1.0

    def __post_init__(self) -> None:
        if self.cut_corners and self.smooth == "certified":
            raise InvalidInput(
                "cannot be certified where the way cuts corners, and so touches obstacles; smooth "
                "it as a spline, or do not let it cut corners (cut_corners: false)"
            )


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """A path and how it came about.

    Attributes:
        search_result: Result of the grid search.
        grid_path: Cells found by the search, as poses from the start to the goal.
        spline: The smoothed path.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        clearance: Distance in m from the occupied cells of ``free_space`` that all of
            ``spline`` is proved to keep; negative, by the greatest possible depth, if the spline
            may enter one.
    """

    search_result: SearchResult
    grid_path: Path
    spline: SplinePath
    free_space: OccupancyGrid
    clearance: float


def plan(
    grid: OccupancyGrid,
    start: Waypoint,
    goal: Waypoint,
    *,
    inflation: float,
    options: PathOptions,
    inflation_note: str = "",
) -> Plan:
    """Search a way over cells whose centres keep ``inflation`` (m) from obstacles, and smooth it.

    A certified path stays in those cells for certain, so that it is nowhere nearer to an obstacle
    than ``inflation`` less half a cell's diagonal.

    Args:
        grid: The obstacles.
        start: Where the robot's centre is first.
        goal: Where it is last.
        inflation: Distance in m, 0 or more.
        options: How to search and smooth.
        inflation_note: Terms of which the inflation is the sum, for messages.

    Raises:
        InvalidInput: The inflation is negative or not finite.
        InvalidWaypoint: Start or goal is not made of numbers, or the robot cannot stand there.
        NoPathFound: There is no way between them.
    """
    start, goal = _numbers("start", start), _numbers("goal", goal)
    free = grid.inflated(inflation)
    for name, place in (("start", start), ("goal", goal)):
        needed = f"{inflation:g} m" + (f" ({inflation_note})" if inflation_note else "")
        _check_place(grid, free, name, place, needed)
    found = search(
        free,
        free.cell(start.x, start.y),
        free.cell(goal.x, goal.y),
        method=options.search,
        heuristic=options.heuristic,
        cut_corners=options.cut_corners,
    )
    points = free.centres(found.cells)
    points = np.vstack([points, points[-1:]]) if len(points) == 1 else points
    points[0], points[-1] = start[:2], goal[:2]
    smoothed = smooth(
        free,
        points,
        method=options.smooth,
        clearance=_ROOM * free.resolution,
        yaws=(start.yaw, goal.yaw),
        turn_within=options.turn_within,
    )
    way = Path(with_headings(points, start.yaw, goal.yaw, options.turn_within))
    return Plan(found, way, smoothed.path, free, smoothed.clearance)


def _numbers(name: str, place: Waypoint) -> Waypoint:
    """A place that is made of numbers."""
    values: tuple[Any, ...] = tuple(place) if isinstance(place, Iterable) else (place,)
    numbers = values[:2] + tuple(value for value in values[2:] if value is not None)
    if len(values) not in {2, 3} or not all(isinstance(value, Real) for value in numbers):
        raise InvalidWaypoint(
            f"the {name} must be two or three numbers, x and y in m and perhaps a heading in rad, "
            f"such as Place(1.5, 2.0); got {short_repr(values)}"
        )
    return Waypoint(*map(float, numbers))


def _check_place(
    grid: OccupancyGrid, free: OccupancyGrid, name: str, place: Waypoint, needed: str
) -> None:
    """Refuse a place outside the map, in an obstacle or nearer to one than ``needed``."""
    where = f"the {name} ({place.x:g}, {place.y:g}) m"
    if not np.isfinite(place[:2]).all() or not (place.yaw is None or np.isfinite(place.yaw)):
        raise InvalidWaypoint(f"{where} must be finite numbers: x and y in m, heading in rad")
    if not grid.contains(*grid.cell(place.x, place.y)):
        left, right, bottom, top = grid.extent
        raise InvalidWaypoint(
            f"{where} lies outside the map, which spans x {left:g} to {right:g} m "
            f"and y {bottom:g} to {top:g} m"
        )
    if not free.is_occupied(place.x, place.y):
        return
    nearest = free.nearest_free(place.x, place.y)
    if nearest is None:
        raise InvalidWaypoint(
            f"nowhere on the map can the robot's centre keep {needed} from every obstacle; "
            "choose a smaller robot or margin, or a finer map"
        )
    cell, distance = nearest
    near = free.centre(*cell)
    if grid.is_occupied(place.x, place.y):
        fact = "lies inside an obstacle, its inflation or a cell that is not known to be free"
    else:
        gap = float(grid.clearance(np.array([place[:2]]))[0])
        fact = (
            f"is {gap:.2f} m from an obstacle; the robot's centre must keep {needed}, also "
            f"from the middle of the map's cell of {grid.resolution:g} m that it is in"
        )
    raise InvalidWaypoint(
        f"{where} {fact}; the nearest place to stand is ({near[0]:g}, {near[1]:g}) m, "
        f"{distance:.2g} m away"
    )
