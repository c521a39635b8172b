"""Planning with the disc about the robot where it suffices, otherwise with its polygon."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import floor
from typing import Literal

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound, NoPathYet
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning.deadline import Deadline
from omnidrive.planning.footprint.clearance import (
    HALVINGS,
    footprint_clearance,
    motion_of,
    poses_in_cells,
)
from omnidrive.planning.footprint.layers import HEADINGS, STEP
from omnidrive.planning.footprint.motion_proof import Motion, Squares, are_steps_free
from omnidrive.planning.footprint.pose_kernels import Ends
from omnidrive.planning.footprint.pose_search import (
    PoseSearch,
    PoseSearchResult,
    ends,
)
from omnidrive.planning.footprint.smoothing import smooth_poses
from omnidrive.planning.grid_frame import GridFrame
from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.pieces import Pieces
from omnidrive.planning.plan import PathOptions, Plan, PlanStatus, Waypoint
from omnidrive.planning.planner import Planner
from omnidrive.planning.search.heuristics import STRAIGHT
from omnidrive.planning.search.result import SearchResult
from omnidrive.planning.waypoint_checks import LOWER_MARGIN, checked_waypoint

_MARGIN = 0.2
"""Distance in cells that smoothed paths of a polygon keep where possible, as in ``plan``."""
_ON_HEADING = 1e-9  # headings; a yaw within this of one is that heading


@dataclass(frozen=True, eq=False, slots=True)
class FootprintPlan:
    """Path of a robot with the shape that was needed for it.

    Attributes:
        shape: ``"disc"`` if there is a path for the disc about the origin of B through the farthest
            corner, otherwise ``"polygon"``.
        reason: Why this shape was needed, a sentence.
        search_result: Result of the search, over cells (disc) or over poses (polygon).
        grid_path: Poses found by the search, from the start to the goal.
        spline: The smoothed path.
        clearance: Proved lower bound on the distance in m from the shape along ``spline`` to the
            occupied cells of the map inflated by the margin; 0 for mere contact. For the disc see
            :class:`~omnidrive.planning.Plan`, whose clearance is that of the centre.
        free_space: The map inflated for the centre of the disc, or by the margin for the polygon.
        grid: The map.
        costs: Costs of the cells, None: none. The path of the polygon does not depend on them.
        status: How far a plan with a time limit got, see :class:`~omnidrive.planning.Plan`.
        suboptimality: Greatest possible ratio of the cost of the grid path to the least.
    """

    shape: Literal["disc", "polygon"]
    reason: str
    search_result: SearchResult | PoseSearchResult
    grid_path: Path
    spline: SplinePath
    clearance: float
    free_space: OccupancyGrid
    grid: OccupancyGrid
    costs: CostMap | None = None
    status: PlanStatus = "complete"
    suboptimality: float = 1.0

    @classmethod
    def of_disc(cls, planned: Plan, radius: float) -> FootprintPlan:
        """Return the plan of a disc with a radius in m."""
        return cls(
            "disc",
            f"the disc of radius {radius:.4g} m about the robot has a path, so its heading is free",
            planned.search_result,
            planned.grid_path,
            planned.spline,
            planned.clearance,
            planned.free_space,
            planned.grid,
            planned.costs,
            planned.status,
            planned.suboptimality,
        )


def plan_footprint(
    grid: OccupancyGrid,
    start: Waypoint,
    goal: Waypoint,
    *,
    footprint: Float[Array, "corners 2"],
    inflation_margin: float = 0.0,
    options: PathOptions | None = None,
    time_limit: float | None = None,
) -> FootprintPlan:
    """Plan with the disc about the robot and, if there is no such path, with its polygon.

    The path of the disc is that of :func:`~omnidrive.planning.plan` with the inflation
    ``inflation_margin`` plus the radius of the disc. The path of the polygon is a shortest one over
    cells and 72 headings, see :func:`search_poses`, smoothed with a proof that the polygon touches
    no occupied cell of the map inflated by the margin. Its distance from every obstacle is
    therefore at least the margin minus half the diagonal of a cell, and not negative.

    Args:
        grid: The map.
        start: Position of the origin of B in W in m and, optionally, heading in rad.
        goal: Position and, optionally, heading. A heading of None is chosen by the search.
        footprint: Corners (x, y) of a simple polygon in B, in m.
        inflation_margin: Distance in m, 0 or more, by which obstacles are inflated.
        options: Options of the path for the disc; that for the polygon has only one way.
        time_limit: Time for search and smoothing of each shape, in s, positive, see
            :meth:`~omnidrive.planning.Planner.plan`; None: no limit.

    Raises:
        InvalidInput: The footprint is no simple polygon, the margin is negative or not finite, or a
            heading seems to be in degrees, or the time limit is not positive.
        InvalidWaypoint: Start or goal is not numeric, or the polygon collides there.
        NoPathFound: There is no path for the polygon.
        NoPathYet: The time was over before there was a path for the disc, or for the polygon.
    """
    if not (np.isfinite(inflation_margin) and inflation_margin >= 0.0):
        raise InvalidInput(f"the margin must be 0 m or more, got {inflation_margin:g} m")
    start, goal = checked_waypoint(grid, "start", start), checked_waypoint(grid, "goal", goal)
    radius = Polygon.of(footprint).radius
    try:
        planned = Planner(
            grid,
            inflation=radius + inflation_margin,
            options=options,
            inflation_note=f"radius {radius:.4g} + margin {inflation_margin:.4g} m",
            min_inflation=radius,
        ).plan(start, goal, time_limit=time_limit)
    except NoPathYet:
        raise
    except (InvalidWaypoint, NoPathFound) as error:
        return plan_polygon(
            grid, start, goal, footprint=footprint, inflation_margin=inflation_margin,
            reason=disc_failure(radius, error), time_limit=time_limit,
        )  # fmt: skip
    return FootprintPlan.of_disc(planned, radius)


def disc_failure(radius: float, error: Exception) -> str:
    """Return the reason why the polygon is needed: a disc with a radius in m has no path.

    What follows a semicolon in the message of the error is advice on the disc.
    """
    fact = str(error).partition(";")[0]
    return f"no path for the disc of radius {radius:.4g} m about the robot: {fact}"


def plan_polygon(
    grid: OccupancyGrid,
    start: Waypoint,
    goal: Waypoint,
    *,
    footprint: Float[Array, "corners 2"],
    inflation_margin: float,
    reason: str,
    time_limit: float | None = None,
) -> FootprintPlan:
    """Return the plan of the polygon; ``reason``: why it is needed.

    Further arguments and errors as for :func:`plan_footprint`.
    """
    start, goal = checked_waypoint(grid, "start", start), checked_waypoint(grid, "goal", goal)
    inflated = grid.inflated(inflation_margin)
    query = _PolygonQuery(inflated, PoseSearch(inflated, footprint))
    query.prepare()
    deadline = None if time_limit is None else Deadline.of(time_limit)
    try:
        found, poses = query.search(start, goal, deadline)
    except NoPathYet:
        raise
    except (InvalidWaypoint, NoPathFound) as failure:
        has_no_time = deadline is not None and isinstance(failure, NoPathFound)
        if inflation_margin == 0.0 or has_no_time or not _has_way(grid, footprint, (start, goal)):
            raise
        kept = f"the polygon must keep the margin of {inflation_margin:.4g} m"
        raise type(failure)(f"{failure}; {kept}: {LOWER_MARGIN}") from None
    spline, has_ended = query.smoothed(poses, deadline)
    # the search has proved that the parts that follow its polyline are free
    proved = max(footprint_clearance(query.grid, footprint, spline), 0.0)
    status: PlanStatus = "complete" if has_ended else "not smoothed"
    return FootprintPlan(
        "polygon", reason, found, Path(poses), spline, proved, query.grid, grid, None,
        "not optimal" if found.suboptimality > 1.0 else status, found.suboptimality,
    )  # fmt: skip


def _has_way(
    grid: OccupancyGrid,
    footprint: Float[Array, "corners 2"],
    waypoints: tuple[Waypoint, Waypoint],
) -> bool:
    """Return whether there is a path of the polygon without a margin."""
    try:
        _PolygonQuery(grid, PoseSearch(grid, footprint)).search(*waypoints)
    except (InvalidWaypoint, NoPathFound):
        return False
    return True


@dataclass(frozen=True, eq=False)
class _PolygonQuery:
    """Search and smoothing between poses that need not lie at the centres of cells."""

    grid: OccupancyGrid
    poses: PoseSearch

    @cached_property
    def _frame(self) -> GridFrame:
        return GridFrame.of(self.grid)

    @cached_property
    def _squares(self) -> Squares:
        return Squares.of(self.grid)

    @cached_property
    def _shape(self) -> Motion:
        """The polygon in cells, at rest."""
        rest = np.zeros((2, 3))
        return motion_of(self.poses.polygon, self._frame, Pieces(rest, rest, rest))

    def prepare(self) -> None:
        """Compute what the search needs of the map."""
        self.poses.prepare()
        _ = self._squares

    def search(
        self, start: Waypoint, goal: Waypoint, deadline: Deadline | None = None
    ) -> tuple[PoseSearchResult, Float[Array, "poses 3"]]:
        """Return the result of the search, and its poses with those of start and goal."""
        starts, goals = self._ends("start", start), self._ends("goal", goal)
        if deadline is None:
            found = self.poses.search_between(starts, goals)
        else:
            found = self.poses.search_between(starts, goals, deadline.ends_search)
        poses = found.poses
        first = start.yaw if start.yaw is not None else float(poses[0, 2])
        poses[:, 2] += _whole_turns(first - float(poses[0, 2]))
        last = float(poses[-1, 2])
        if goal.yaw is not None:
            last = goal.yaw + _whole_turns(last - goal.yaw)
        ends_in_full = ([[start.x, start.y, first]], poses, [[goal.x, goal.y, last]])
        return found, np.vstack(ends_in_full)

    def smoothed(
        self, poses: Float[Array, "poses 3"], deadline: Deadline | None
    ) -> tuple[SplinePath, bool]:
        """Return a smooth path along poses, and whether the smoothing ended."""
        cells = poses_in_cells(self.grid, self._frame, poses)
        rest = () if deadline is None else (deadline.ends_smoothing(0.0),)
        smooth, has_ended = smooth_poses(self._squares, self._shape, cells, _MARGIN, *rest)
        path = np.column_stack([self._frame.world(smooth[:, :2]), smooth[:, 2] + self.grid.yaw])
        path[0], path[-1] = poses[0], poses[-1]
        return SplinePath(path), has_ended

    def _ends(self, name: str, waypoint: Waypoint) -> Ends:
        """Return the poses that a straight motion from or to a waypoint connects to it."""
        x, y, yaw = waypoint
        row, col = self.grid.cell(x, y)
        found = self._connections(waypoint, row, col)
        if found:
            return ends(found)
        heading = None if yaw is None else round(yaw / STEP) % HEADINGS
        raise InvalidWaypoint(
            self.poses.collision(f"the {name} ({x:g}, {y:g}) m", row, col, heading)
        )

    def _connections(self, waypoint: Waypoint, row: int, col: int) -> list[tuple[int, int]]:
        """Return the poses about a waypoint that a free motion connects to it, and the lengths."""
        x, y = self._frame.cells(np.array([waypoint[:2]]))[0].tolist()
        near = [
            (r, c, k)
            for r, c in product(range(row - 1, row + 2), range(col - 1, col + 2))
            for k in _nearest_headings(waypoint.yaw)
            if self.grid.contains(r, c) and self.poses.is_free(r, c, k)
        ]
        cells = np.array(near, float).reshape(-1, 3)
        begins = np.column_stack([cells[:, 1] + 0.5, cells[:, 0] + 0.5, STEP * cells[:, 2]])
        yaws = begins[:, 2] if waypoint.yaw is None else np.full(len(near), waypoint.yaw)
        there = np.column_stack([np.full(len(near), x), np.full(len(near), y), yaws])
        turns = np.abs(begins[:, 2] - yaws) / STEP * self.poses.turn
        lengths = np.hypot(*(there - begins).T[:2]) * STRAIGHT + turns
        begins[:, 2] -= self.grid.yaw
        there[:, 2] -= self.grid.yaw
        free = are_steps_free(self._squares, self._shape, begins, there, HALVINGS)
        return [
            (self.poses.pose_index(r, c, k % HEADINGS), round(float(lengths[i])))
            for i, (r, c, k) in enumerate(near)
            if free[i]
        ]


def _nearest_headings(yaw: float | None) -> list[int]:
    """Return the indices of the headings on both sides of a yaw; all of them for None."""
    if yaw is None:
        return list(range(HEADINGS))
    below = floor(yaw / STEP + _ON_HEADING)
    return [below] if abs(yaw / STEP - below) <= _ON_HEADING else [below, below + 1]


def _whole_turns(angle: float) -> float:
    """Return the multiple of 2 pi nearest to an angle."""
    return 2.0 * np.pi * round(angle / (2.0 * np.pi))
