"""Planning of smooth paths from start to goal on a map that may change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import ceil
from time import perf_counter

import numpy as np
from jaxtyping import Bool, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, NoPathFound
from omnidrive.maps import CostMap, Inflation, OccupancyGrid
from omnidrive.planning.clearance import Obstacles
from omnidrive.planning.deadline import Deadline, check_time_limit
from omnidrive.planning.headings import with_headings
from omnidrive.planning.path import Path
from omnidrive.planning.plan import PathOptions, Plan, PlanStatus, Waypoint
from omnidrive.planning.search import GridSearch, SearchResult
from omnidrive.planning.search.search_within import Found, search_within
from omnidrive.planning.smoothing.smooth import NO_COSTS, smooth
from omnidrive.planning.waypoint_checks import (
    check_free,
    check_waypoint,
    checked_waypoint,
    way_out,
)

_CLEARANCE = 0.2
"""Distance in cells from the inflated obstacles that certified paths keep where possible. It hardly
affects the smoothness."""


def plan(
    grid: OccupancyGrid,
    start: Waypoint,
    goal: Waypoint,
    *,
    inflation: float,
    options: PathOptions,
    inflation_note: str = "",
    min_inflation: float = 0.0,
    costs: CostMap | None = None,
    around_obstacles: Inflation | None = None,
) -> Plan:
    """Search a path over cells whose centres keep ``inflation`` (m) from obstacles, and smooth it.

    A certified path is proved to stay in those cells. Its distance from every obstacle is therefore
    at least ``inflation`` minus half the diagonal of a cell.

    To plan repeatedly on one map, use a :class:`~omnidrive.planning.Planner`.

    Args:
        grid: The map.
        start: Start position of the robot's centre in W and, optionally, its heading.
        goal: Goal position of the robot's centre in W and, optionally, its heading.
        inflation: Distance in m, 0 or more.
        options: Options of the search and the smoothing.
        inflation_note: Composition of the inflation, for messages.
        min_inflation: Inflation without a margin, m, for messages.
        costs: Costs of travelling over the cells, which the path minimises together with its
            length; the cells of its keep-out masks are added to the occupied ones of ``grid``.
        around_obstacles: Cost around obstacles, added to ``costs``: the path keeps to the middle
            where there is room.

    Raises:
        InvalidInput: The inflation is negative or not finite, a heading seems to be in degrees, or
            the costs have another size than the grid.
        InvalidWaypoint: Start or goal is not numeric, or the robot collides there.
        NoPathFound: There is no path between them, or none within the limits of the curvature.
    """
    planner = Planner(
        grid, inflation=inflation, options=options, inflation_note=inflation_note,
        min_inflation=min_inflation, costs=costs, around_obstacles=around_obstacles,
    )  # fmt: skip
    return planner.plan(start, goal)


class Planner:
    """Planner of paths on one map, whose cells may change.

    What does not depend on start and goal is kept between calls: the inflated map, its bitmap and
    the costs. After :meth:`update` only the surroundings of the changed cells are computed again;
    the paths are the same as those of :func:`plan` on the changed map.

    Args:
        grid: The map.
        inflation: Distance of the robot's centre from obstacles, m, 0 or more.
        options: Options of the search and the smoothing.
        inflation_note: Composition of the inflation, for messages.
        min_inflation: Inflation without a margin, m, for messages.
        costs: Costs of travelling, see :func:`plan`.
        around_obstacles: Cost around obstacles, see :func:`plan`.

    Attributes:
        grid: The map with the changes so far and the cells of keep-out masks.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        costs: Costs of all cells; None: none.

    Raises:
        InvalidInput: As for :func:`plan`.
    """

    def __init__(
        self,
        grid: OccupancyGrid,
        *,
        inflation: float,
        options: PathOptions | None = None,
        inflation_note: str = "",
        min_inflation: float = 0.0,
        costs: CostMap | None = None,
        around_obstacles: Inflation | None = None,
    ) -> None:
        if costs is not None:
            if costs.grid.occupied.shape != grid.occupied.shape:
                raise InvalidInput(
                    f"the costs have the shape {costs.grid.occupied.shape}, the map "
                    f"{grid.occupied.shape}"
                )
            grid = replace(grid, occupied=grid.occupied | costs.kept_out)
            costs = replace(costs, grid=grid)
        self.grid = grid
        self.free_space = grid.inflated(inflation)
        self._inflation, self._min_inflation = inflation, min_inflation
        self._options = options or PathOptions()
        self._needed = f"{inflation:.4g} m" + (f" ({inflation_note})" if inflation_note else "")
        self._layers, self._around = costs, around_obstacles
        if around_obstacles is not None:
            costs = (costs or CostMap.of(grid)).with_inflation(inflation, around_obstacles)
        self.costs = costs
        self._searcher: GridSearch | None = None
        self._obstacles: Obstacles | None = None
        self._is_limited = False

    def update(self, cells: Int[Array, "cells 2"], occupied: Bool[Array, " cells"] | bool) -> None:
        """Change the occupancy of cells (row, column).

        Args:
            cells: Rows and columns.
            occupied: Whether each of them, or all, are occupied from now on. Occupied cells of
                ``costs``, such as those of a keep-out mask, stay occupied.

        Raises:
            InvalidInput: A cell lies outside the map.
        """
        cells = np.asarray(cells).reshape(-1, 2)
        shape = self.grid.occupied.shape
        if len(cells) == 0:
            return
        if not ((cells >= 0) & (cells < shape)).all():
            raise InvalidInput(f"a changed cell lies outside the map of {shape} rows and columns")
        after = self.grid.occupied.copy()
        after[tuple(cells.T)] = occupied
        if self._layers is not None:
            after |= self._layers.kept_out
        changed = np.argwhere(after != self.grid.occupied)
        if len(changed) == 0:
            return
        self.grid = replace(self.grid, occupied=after)
        self._update_around(changed.min(axis=0), changed.max(axis=0) + 1)
        self._searcher = None
        if self._is_limited:
            self.prepare()

    def _update_around(self, low: Int[Array, " 2"], high: Int[Array, " 2"]) -> None:
        """Compute inflation and costs again around the cells from ``low`` to before ``high``."""
        radius = 0.0 if self._around is None else self._around.radius
        shape = np.array(self.grid.occupied.shape)
        reach = ceil(max(self._inflation, radius) / self.grid.resolution) + 2
        inner = _slices((low - reach).clip(0), (high + reach).clip(max=shape))
        first = (low - 2 * reach).clip(0)
        outer = _slices(first, (high + 2 * reach).clip(max=shape))
        part = replace(self.grid, occupied=self.grid.occupied[outer])
        within = tuple(
            slice(i.start - f, i.stop - f) for i, f in zip(inner, first.tolist(), strict=True)
        )
        free = self.free_space.occupied.copy()
        free[inner] = part.inflated(self._inflation).occupied[within]
        self.free_space = replace(self.free_space, occupied=free)
        if self.costs is None:
            return
        values = self.costs.costs
        if self._around is not None:
            layers = CostMap.of(part)
            if self._layers is not None:
                layers = replace(layers, costs=self._layers.costs[outer])
            values = values.copy()
            values[inner] = layers.with_inflation(self._inflation, self._around).costs[within]
        self.costs = replace(self.costs, grid=self.grid, costs=values)

    def prepare(self) -> None:
        """Compute what a plan with a time limit needs of the map, and load kernels.

        The first such plan does so before its time begins, and from then on :meth:`update`.
        """
        self._is_limited = True
        self._map_search().prepare()
        _load_smoothing()

    def _map_search(self) -> GridSearch:
        """Return the search on the inflated map."""
        if self._searcher is None:
            cut_corners = self._options.cut_corners
            self._searcher = GridSearch(self.free_space, cut_corners=cut_corners, costs=self.costs)
            self._obstacles = Obstacles.of(self.free_space)
        return self._searcher

    def plan(
        self,
        start: Waypoint,
        goal: Waypoint,
        *,
        time_limit: float | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> Plan:
        """Return the path from start to goal.

        With a time limit, the path is the best that was found in time, and is certified as any
        other; ``status`` of the plan says how far it got. It then depends on the clock and on the
        load of the computer; a ``complete`` path has the cost of that without a limit. On
        2048 x 2048 cells the limit is exceeded by at most 4 ms of processor time, in mazes with
        costs by up to 6 ms.

        Args:
            start: Start, see :func:`plan`.
            goal: Goal, see :func:`plan`.
            time_limit: Time in s, positive; None: no limit. For the searches ``astar`` and
                ``jump-point``.
            clock: Clock of the limit, s.

        Raises:
            InvalidInput: A heading seems to be in degrees, the limit is not positive, or the search
                does not support one.
            InvalidWaypoint: Start or goal is not numeric, or the robot collides there.
            NoPathFound: There is no path between them.
            NoPathYet: There is none within the time limit.
        """
        deadline = None
        if time_limit is not None:
            check_time_limit(time_limit)
            if not (self._is_limited and self._searcher is not None):
                self.prepare()
            deadline = Deadline(clock(), time_limit, clock)
        return self._plan(start, goal, deadline)

    def _plan(self, start: Waypoint, goal: Waypoint, deadline: Deadline | None) -> Plan:
        """Return the path from start to goal, within a time limit if there is one."""
        grid, free_space, options = self.grid, self.free_space, self._options
        start, goal = (
            checked_waypoint(grid, name, each) for name, each in (("start", start), ("goal", goal))
        )
        inflations = self._inflation, self._min_inflation
        check_free(grid, free_space, inflations, self._needed)
        for name, waypoint in (("start", start), ("goal", goal)):
            check_waypoint(grid, free_space, name, waypoint, self._needed)
        searcher, bound, ended = self._map_search(), 1.0, True
        try:
            if deadline is None:
                found = _search(searcher, start, goal, options)
            else:
                found, bound, ended = _search_within(searcher, start, goal, options, deadline)
        except NoPathFound as error:
            if self._inflation == 0.0 or deadline is not None:
                raise
            advice = way_out(grid, *inflations, lambda free: _has_path(free, start, goal, options))
            raise NoPathFound(
                f"{error}; the robot's centre must keep {self._needed} from every obstacle: "
                f"{advice}"
            ) from None
        points = free_space.centres(found.cells)
        points = np.vstack([points, points[-1:]]) if len(points) == 1 else points
        points[0], points[-1] = start[:2], goal[:2]
        began = 0.0 if deadline is None else deadline.elapsed()
        grid_path = Path(with_headings(points, start.yaw, goal.yaw, options.turn_within))
        tail = 0.0 if deadline is None else deadline.elapsed() - began
        smoothed = smooth(
            free_space,
            points,
            method=options.smooth,
            clearance=_CLEARANCE * free_space.resolution,
            yaws=(start.yaw, goal.yaw),
            turn_within=options.turn_within,
            costs=self.costs.costs if searcher.has_costs and self.costs else NO_COSTS,
            limits=options.curvature_limits,
            obstacles=self._obstacles,
            is_over=None if deadline is None else deadline.ends_smoothing(tail),
        )
        status: PlanStatus = "complete" if smoothed.is_complete else "not smoothed"
        return Plan(
            found, grid_path, smoothed.path, free_space, smoothed.clearance, grid, self.costs,
            status if ended else "not optimal", bound,
        )  # fmt: skip


@cache
def _load_smoothing() -> None:
    """Compile or load the kernels of the smoothing, so that time limits exclude compilation."""
    grid = OccupancyGrid(np.zeros((8, 8), bool), 1.0)
    points = np.array([[1.5, 1.5], [1.5, 2.5], [2.5, 3.5], [3.5, 3.5], [4.5, 3.5]])
    smooth(grid, points, costs=np.zeros((8, 8), np.float32))
    smooth(grid, points, is_over=lambda: True)


def _slices(low: Int[Array, " 2"], high: Int[Array, " 2"]) -> tuple[slice, slice]:
    """Return the rows and columns from ``low`` to before ``high``."""
    (top, left), (bottom, right) = low.tolist(), high.tolist()
    return slice(top, bottom), slice(left, right)


def _search(
    searcher: GridSearch, start: Waypoint, goal: Waypoint, options: PathOptions
) -> SearchResult:
    """Search the grid path; raise NoPathFound if there is none."""
    return searcher.search(
        searcher.grid.cell(start.x, start.y),
        searcher.grid.cell(goal.x, goal.y),
        method=options.search,
        heuristic=options.heuristic,
    )


def _search_within(
    searcher: GridSearch, start: Waypoint, goal: Waypoint, options: PathOptions, deadline: Deadline
) -> Found:
    """Search the best path in time."""
    return search_within(
        searcher,
        searcher.grid.cell(start.x, start.y),
        searcher.grid.cell(goal.x, goal.y),
        deadline.ends_search,
        method=options.search,
        heuristic=options.heuristic,
    )


def _has_path(
    free_space: OccupancyGrid, start: Waypoint, goal: Waypoint, options: PathOptions
) -> bool:
    """Return whether there is a grid path."""
    try:
        _search(GridSearch(free_space, cut_corners=options.cut_corners), start, goal, options)
    except NoPathFound:
        return False
    return True
