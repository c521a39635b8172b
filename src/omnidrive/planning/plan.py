"""Planning of a smooth path from start to goal on a map."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from numbers import Real
from typing import Annotated, Any, NamedTuple, get_args

import numpy as np

from omnidrive.choices import HeuristicName, MethodName, SmoothingName
from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound, short_repr
from omnidrive.geometry import check_heading
from omnidrive.maps import OccupancyGrid
from omnidrive.notebook import facts_html
from omnidrive.parameter import Bounds, check_choice
from omnidrive.planning.drawing import path_svg
from omnidrive.planning.headings import with_headings
from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.search import SearchResult, search
from omnidrive.planning.smoothing import smooth

_CLEARANCE = 0.2
"""Distance in cells from the inflated obstacles that certified paths keep where possible. It hardly
affects the smoothness."""
_DRAWN = 300  # points of the path in notebooks

_LOWER_MARGIN = (
    "lower the margin (--margin on the command line; in Python it is part of the keyword "
    "inflation), or choose a smaller robot or a finer map"
)
_SMALLER_ROBOT = "choose a smaller robot or a finer map; the robot is too large without a margin"
_BLOCKED = "a robot of any size needs a gap in the obstacles; check start, goal and map"
"""Ways out of a map that is too narrow for the robot."""


class Waypoint(NamedTuple):
    """Start or goal: x, y in m, yaw in rad; a yaw of None leaves the heading to the path."""

    x: float
    """Position in W, m."""
    y: float
    """Position in W, m."""
    yaw: Annotated[float, Bounds(-6.3, 6.3, "rad")] | None = None
    """Heading in W, rad."""

    def plain(self) -> list[float]:
        """Return the value of a scenario that describes the waypoint."""
        return [each for each in self if each is not None]


@dataclass(frozen=True, slots=True)
class PathOptions:
    """Options of the search and the smoothing; the defaults suit every map.

    Attributes:
        search: Search method, see :func:`~omnidrive.planning.search`.
        heuristic: Heuristic of the search; None for the default of the method.
        cut_corners: Allow diagonal moves past occupied cells.
        smooth: Smoothing method, see :func:`~omnidrive.planning.smooth`.
        turn_within: Distance over which the heading turns from that of the start to the direction
            of the path, and from there to that of the goal, in m; 0 turns between two control
            points.

    Raises:
        InvalidInput: A name is unknown, or ``smooth`` is certified and ``cut_corners`` is true.
    """

    search: MethodName = "astar"
    heuristic: HeuristicName | None = None
    cut_corners: bool = False
    smooth: SmoothingName = "certified"
    turn_within: Annotated[float, Bounds(0.0, 10.0, "m")] = 1.0

    def __post_init__(self) -> None:
        check_choice("search method", self.search, get_args(MethodName))
        if self.heuristic is not None:
            check_choice("heuristic", self.heuristic, get_args(HeuristicName))
        check_choice("smoothing method", self.smooth, get_args(SmoothingName))
        if self.cut_corners and self.smooth == "certified":
            raise InvalidInput(
                "cannot be certified if it cuts corners, because it then touches obstacles; use "
                "smooth: spline or cut_corners: false"
            )


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """Planned path with the intermediate results.

    Attributes:
        search_result: Result of the grid search.
        grid_path: Cells found by the search, as poses from the start to the goal.
        spline: The smoothed path.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        clearance: Proved lower bound on the distance in m from ``spline`` to the occupied cells of
            ``free_space``. If the spline may enter one, it is negative: minus the greatest
            possible depth.
        grid: The map.
    """

    search_result: SearchResult
    grid_path: Path
    spline: SplinePath
    free_space: OccupancyGrid
    clearance: float
    grid: OccupancyGrid

    def _repr_html_(self) -> str:
        """Return drawing and main results for notebooks."""
        facts = {
            "grid path": f"{self.grid_path.length:.3f} m, {len(self.grid_path.poses)} cells",
            "smooth path": f"{self.spline.length:.3f} m",
            "clearance": f"at least {self.clearance:.3f} m from the inflated obstacles",
            "search": f"{self.search_result.expansions} expansions",
        }
        positions = self.spline.poses(np.linspace(0.0, 1.0, _DRAWN))[:, :2]
        return facts_html("Plan", facts, path_svg(self.grid, positions))


def plan(
    grid: OccupancyGrid,
    start: Waypoint,
    goal: Waypoint,
    *,
    inflation: float,
    options: PathOptions,
    inflation_note: str = "",
    min_inflation: float = 0.0,
) -> Plan:
    """Search a path over cells whose centres keep ``inflation`` (m) from obstacles, and smooth it.

    A certified path is proved to stay in those cells. Its distance from every obstacle is therefore
    at least ``inflation`` minus half the diagonal of a cell.

    Args:
        grid: The map.
        start: Start position of the robot's centre in W and, optionally, its heading.
        goal: Goal position of the robot's centre in W and, optionally, its heading.
        inflation: Distance in m, 0 or more.
        options: Options of the search and the smoothing.
        inflation_note: Composition of the inflation, for messages.
        min_inflation: Inflation without a margin, m, for messages.

    Raises:
        InvalidInput: The inflation is negative or not finite, or a heading seems to be in degrees.
        InvalidWaypoint: Start or goal is not numeric, or the robot collides there.
        NoPathFound: There is no path between them.
    """
    start, goal = _numbers("start", start), _numbers("goal", goal)
    free_space = grid.inflated(inflation)
    needed = f"{inflation:.4g} m" + (f" ({inflation_note})" if inflation_note else "")
    _check_free(grid, free_space, (inflation, min_inflation), needed)
    for name, waypoint in (("start", start), ("goal", goal)):
        _check_waypoint(grid, free_space, name, waypoint, needed)
    try:
        found = _search(free_space, start, goal, options)
    except NoPathFound as error:
        if inflation == 0.0:
            raise
        advice = _way_out(
            grid, inflation, min_inflation, lambda free: _has_path(free, start, goal, options)
        )
        raise NoPathFound(
            f"{error}; the robot's centre must keep {needed} from every obstacle: {advice}"
        ) from None
    points = free_space.centres(found.cells)
    points = np.vstack([points, points[-1:]]) if len(points) == 1 else points
    points[0], points[-1] = start[:2], goal[:2]
    smoothed = smooth(
        free_space,
        points,
        method=options.smooth,
        clearance=_CLEARANCE * free_space.resolution,
        yaws=(start.yaw, goal.yaw),
        turn_within=options.turn_within,
    )
    grid_path = Path(with_headings(points, start.yaw, goal.yaw, options.turn_within))
    return Plan(found, grid_path, smoothed.path, free_space, smoothed.clearance, grid)


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


def _search(
    free_space: OccupancyGrid, start: Waypoint, goal: Waypoint, options: PathOptions
) -> SearchResult:
    """Search the grid path; raise NoPathFound if there is none."""
    return search(
        free_space,
        free_space.cell(start.x, start.y),
        free_space.cell(goal.x, goal.y),
        method=options.search,
        heuristic=options.heuristic,
        cut_corners=options.cut_corners,
    )


def _has_path(
    free_space: OccupancyGrid, start: Waypoint, goal: Waypoint, options: PathOptions
) -> bool:
    """Return whether there is a grid path."""
    try:
        _search(free_space, start, goal, options)
    except NoPathFound:
        return False
    return True


def _check_free(
    grid: OccupancyGrid, free_space: OccupancyGrid, inflations: tuple[float, float], needed: str
) -> None:
    """Raise InvalidWaypoint if no cell is free; ``needed`` names the first of the inflations."""
    if free_space.occupied.all():
        advice = _way_out(grid, *inflations, lambda free: not free.occupied.all())
        raise InvalidWaypoint(
            f"no free cell of the map keeps {needed} from every obstacle; {advice}"
        )


def _check_waypoint(
    grid: OccupancyGrid,
    free_space: OccupancyGrid,
    name: str,
    waypoint: Waypoint,
    needed: str,
) -> None:
    """Raise InvalidWaypoint outside the map, in an obstacle or nearer to one than ``needed``."""
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


def _way_out(
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
        return _LOWER_MARGIN
    return _SMALLER_ROBOT if is_wide_enough(grid) else _BLOCKED
