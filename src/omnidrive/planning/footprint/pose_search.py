"""Search over position and heading for a polygon that moves in any direction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from operator import index
from time import perf_counter

import numpy as np
from jaxtyping import Float, Int, Int64, UInt64

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound, NoPathYet
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.deadline import Deadline, check_time_limit
from omnidrive.planning.footprint.layers import HEADINGS, STEP, PoseLayers, is_set, shared_moves
from omnidrive.planning.footprint.pose_kernels import (
    Bounds,
    Ends,
    PoseSpace,
    begin,
    distances_to_go,
    explore,
    trace,
)
from omnidrive.planning.search.astar import BUCKET_SHIFT
from omnidrive.planning.search.heuristics import STRAIGHT
from omnidrive.planning.search.moves import pruned_moves

CellPose = tuple[int, int, int | None]
"""Row and column of a cell, and the index k of the heading, k 5 degrees in W; None for any."""

TURN_RADIUS = 0.25
"""Length that a turn of 1 rad counts, as a share of the distance to the farthest corner."""
_LOOK = 1 << 10  # expansions between two looks at the clock, about a millisecond
_MAX_POSES = 2**31 - 1
_SLACK = 64 * STRAIGHT
"""Excess of a path over the bound on its length up to which the bounds are exact."""


@dataclass(frozen=True, eq=False, slots=True)
class PoseSearchResult:
    """Path found by a search over poses.

    Attributes:
        cells: Row and column of the origin of B at each pose, from start to goal inclusive.
        headings: Index k of the heading at each pose, 0 to 71; the heading is k 5 degrees in W.
        poses: x and y in m and yaw in rad, unwrapped, at each pose.
        cost: Length in cell widths, with that of the turns.
        expansions: Number of expansions; a pose that is expanded twice counts twice.
        seconds: Duration of the search, in s.
        suboptimality: Greatest possible ratio of the length, with that of the turns, to the least,
            if a time limit ended the search; 1 otherwise.
    """

    cells: Int[Array, "poses 2"]
    headings: Int[Array, " poses"]
    poses: Float[Array, "poses 3"]
    cost: float
    expansions: int
    seconds: float
    suboptimality: float = 1.0


def search_poses(
    grid: OccupancyGrid,
    footprint: Float[Array, "corners 2"],
    start: CellPose,
    goal: CellPose,
    *,
    turn_radius: float | None = None,
    time_limit: float | None = None,
) -> PoseSearchResult:
    """Find a shortest path of a polygon over cells and 72 headings.

    A move leads to one of the eight neighbours at the same heading, without cutting corners, or by
    5 degrees to an adjacent heading in the same cell. Every move is free over its whole course:
    moves in a straight line exactly, turns up to a region of 1e-3 cells for a robot of 16 cells,
    see :class:`~omnidrive.planning.footprint.layers.PoseLayers`. The polygon may touch obstacles.

    Args:
        grid: The map.
        footprint: Corners (x, y) of a simple polygon in B, in m.
        start: Row, column and heading, see :data:`CellPose`.
        goal: Row, column and heading.
        turn_radius: Length in m that a turn of 1 rad counts, not negative; None for a quarter of
            the distance from the origin of B to the farthest corner.
        time_limit: Time for the search, in s, positive, without that for the free poses of the map;
            None: no limit.

    Raises:
        InvalidInput: The footprint is no simple polygon, the turn radius is negative or not finite,
            the map has more than 29 million cells, or the time limit is not positive.
        InvalidWaypoint: The polygon collides at start or goal, or they lie outside the grid.
        NoPathFound: There is no path.
        NoPathYet: There is none within the time limit.
    """
    searcher = PoseSearch(grid, footprint, turn_radius)
    if time_limit is None:
        return searcher.search(start, goal)
    check_time_limit(time_limit)
    searcher.prepare()
    deadline = Deadline.of(time_limit)
    return searcher.search(start, goal, lambda _: deadline.remaining <= 0.0)


@dataclass(frozen=True, eq=False)
class PoseSearch:
    """Repeated searches of a polygon on one map; see :func:`search_poses`.

    Attributes:
        grid: The map; changes after the first search have no effect.
        footprint: Corners (x, y) of a simple polygon in B, in m.
        turn_radius: Length in m that a turn of 1 rad counts; None for a quarter of the radius.
    """

    grid: OccupancyGrid
    footprint: Float[Array, "corners 2"]
    turn_radius: float | None = None

    def __post_init__(self) -> None:
        radius = 0.0 if self.turn_radius is None else self.turn_radius
        if not (np.isfinite(radius) and radius >= 0.0):
            raise InvalidInput(f"the turn radius must be 0 m or more, got {radius:g} m")
        _ = self.polygon
        if 64 * HEADINGS * len(self.layers.frame.words) > _MAX_POSES:
            raise InvalidInput(
                f"a map of {self.grid.occupied.shape[0]} x {self.grid.occupied.shape[1]} cells is "
                "too large to search headings as well; the maximum is about 5000 x 5000 cells: "
                "use a coarser map or a part of it"
            )

    @cached_property
    def polygon(self) -> Polygon:
        """The footprint."""
        return Polygon.of(self.footprint)

    @cached_property
    def layers(self) -> PoseLayers:
        """Free poses and turns."""
        return PoseLayers(self.grid, self.polygon)

    @cached_property
    def turn(self) -> int:
        """Length of a turn by one heading in the units of the search."""
        radius = TURN_RADIUS * self.polygon.radius if self.turn_radius is None else self.turn_radius
        return round(min(radius / self.grid.resolution, 1e6) * STEP * STRAIGHT)

    @cached_property
    def _moves(self) -> UInt64[Array, "4 words"]:
        return shared_moves(self.layers.poses, self.layers.frame.stride)

    def prepare(self) -> None:
        """Compute what searches need of the map, which the first one does otherwise."""
        _ = self.layers.turns, self._moves

    def search(
        self,
        start: CellPose,
        goal: CellPose,
        is_over: Callable[[bool], bool] = lambda _: False,
    ) -> PoseSearchResult:
        """Find a shortest path; arguments and errors as for :meth:`search_between`."""
        return self.search_between(self._ends("start", start), self._ends("goal", goal), is_over)

    def search_between(
        self,
        starts: Ends,
        goals: Ends,
        is_over: Callable[[bool], bool] = lambda _: False,
    ) -> PoseSearchResult:
        """Find a shortest path from one of the starts to one of the goals.

        The cost counts the moves between them, without the lengths of the ends.

        Args:
            starts: Poses to start from.
            goals: Poses to reach.
            is_over: Whether the time is over; called with whether there is a path.

        Raises:
            NoPathFound: There is no path.
            NoPathYet: There is none in time.
        """
        began = perf_counter()
        path, expansions, suboptimality = self._path_between(starts, goals, is_over)
        cells, headings = self._cells_and_headings(path)
        return PoseSearchResult(
            cells,
            headings,
            self._poses_of(cells, headings),
            self._cost(cells),
            expansions,
            perf_counter() - began,
            suboptimality,
        )

    def _path_between(
        self, starts: Ends, goals: Ends, is_over: Callable[[bool], bool]
    ) -> tuple[Int64[Array, " path"], int, float]:
        """Return the poses of the path, the number of expansions, and the suboptimality."""
        frame = self.layers.frame
        to_go, reached = distances_to_go(self._moves, frame.stride, goals, starts, _SLACK)
        if not reached:
            raise NoPathFound(
                self._unreachable("not even one that ignores how the heading changes")
            )
        space = PoseSpace(
            self.layers.poses, self.layers.turns, frame.stride, self.turn, pruned_moves(8, False)
        )
        words = np.zeros(HEADINGS * (frame.size + 64), np.int64)  # untouched pages take no memory
        bounds = Bounds(to_go, self._turns_to_go(goals.poses % HEADINGS))
        queue, ring, progress = begin(space, starts, bounds, words)
        while progress.waiting > 0 and not is_over(progress.found >= 0):
            queue, progress = explore(space, goals, bounds, words, queue, ring, progress, _LOOK)
        if progress.found < 0 and progress.waiting > 0:
            raise NoPathYet(
                "no path from start to goal was found within the time limit, in "
                f"{progress.expansions} expansions; there may be one: allow more time"
            )
        if progress.found < 0:
            raise NoPathFound(
                self._unreachable(
                    f"none of the {progress.expansions} poses that the start reaches is the goal"
                )
            )
        least = progress.base + (progress.bucket << BUCKET_SHIFT)
        suboptimality = max(progress.best / max(least, 1), 1.0) if progress.waiting > 0 else 1.0
        return trace(words, frame.stride, progress.found), progress.expansions, suboptimality

    def pose_index(self, row: int, col: int, heading: int) -> int:
        """Return the index of a pose, 72 cell + heading."""
        return HEADINGS * self.layers.frame.index_of((row, col)) + heading

    def is_free(self, row: int, col: int, heading: int) -> bool:
        """Whether the polygon is free at the centre of a cell of the grid."""
        return not is_set(
            self.layers.poses[heading % HEADINGS], self.layers.frame.index_of((row, col))
        )

    def _cells_and_headings(
        self, path: Int64[Array, " path"]
    ) -> tuple[Int[Array, "path 2"], Int[Array, " path"]]:
        """Return rows and columns, and headings, of poses."""
        return self.layers.frame.cells(path // HEADINGS), path % HEADINGS

    def _poses_of(
        self, cells: Int[Array, "path 2"], headings: Int[Array, " path"]
    ) -> Float[Array, "path 3"]:
        """Return x, y in m and yaw in rad, unwrapped, of cells and headings."""
        turns = (np.diff(headings) + HEADINGS // 2) % HEADINGS - HEADINGS // 2
        unwrapped = headings[0] + np.concatenate([[0], np.cumsum(turns)])
        return np.column_stack([self.grid.centres(cells), STEP * unwrapped])

    def _cost(self, cells: Int[Array, "path 2"]) -> float:
        """Return the length of a path in cells, counted in moves."""
        steps = np.abs(np.diff(cells, axis=0)).sum(axis=1)
        straight, diagonal = np.count_nonzero(steps == 1), np.count_nonzero(steps == 2)
        turns = len(steps) - straight - diagonal
        return straight + diagonal * sqrt(2.0) + turns * self.turn / STRAIGHT

    def _turns_to_go(self, goal_headings: Int64[Array, " goals"]) -> Int64[Array, " headings"]:
        """Return the least length of the turns from each heading to one of the goals."""
        apart = np.abs(np.arange(HEADINGS)[:, None] - np.unique(goal_headings))
        turns: Int64[Array, " headings"] = np.minimum(apart, HEADINGS - apart).min(axis=1)
        return turns * self.turn

    def _ends(self, name: str, pose: CellPose) -> Ends:
        """Return the free poses of a cell, one or all headings."""
        row, col = index(pose[0]), index(pose[1])
        heading = None if pose[2] is None else index(pose[2]) % HEADINGS
        if not self.grid.contains(row, col):
            rows, cols = self.grid.occupied.shape
            raise InvalidWaypoint(
                f"the {name} (row {row}, column {col}) lies outside the grid of {rows} rows and "
                f"{cols} columns"
            )
        wanted = range(HEADINGS) if heading is None else [heading]
        free = [k for k in wanted if self.is_free(row, col, k)]
        if not free:
            x, y = self.grid.centre(row, col)
            raise InvalidWaypoint(self.collision(f"the {name} ({x:g}, {y:g}) m", row, col, heading))
        return ends([(self.pose_index(row, col, k), 0) for k in free])

    def collision(self, where: str, row: int, col: int, heading: int | None) -> str:
        """Say that the polygon collides in a cell, and where it does not."""
        at = "every heading" if heading is None else f"a heading of {5 * heading:g} degrees"
        fact = f"the {self.polygon} collides at {where} with {at}"
        others = [k for k in range(HEADINGS) if self.is_free(row, col, k)]
        if heading is not None and others:
            apart = [min((k - heading) % HEADINGS, (heading - k) % HEADINGS) for k in others]
            near = 5 * others[int(np.argmin(apart))]
            return f"{fact}; there it is free with a heading of {near:g} degrees"
        free = ~self._occupied(heading)
        if not free.any():
            return f"{fact}, and nowhere on the map is it free; use a smaller robot or a finer map"
        cells = np.argwhere(free)
        apart = np.hypot(*(cells - (row, col)).T)
        near_x, near_y = self.grid.centre(*cells[int(np.argmin(apart))].tolist())
        distance = float(apart.min()) * self.grid.resolution
        return (
            f"{fact}; the nearest free position is ({near_x:g}, {near_y:g}) m, "
            f"{distance:.2g} m away"
        )

    def _occupied(self, heading: int | None) -> Int[Array, "rows cols"]:
        """Return for each cell whether the polygon collides at a heading; None for at all."""
        poses, frame = self.layers.poses, self.layers.frame
        words = np.bitwise_and.reduce(poses, axis=0) if heading is None else poses[heading]
        rows, cols = frame.shape
        bits = np.unpackbits(words[:-1].view(np.uint8), bitorder="little").reshape(rows + 2, -1)
        return bits[1:-1, 64 : 64 + cols].astype(bool)

    def _unreachable(self, reason: str) -> str:
        """Explain why there is no path, for messages."""
        return (
            f"there is no path from start to goal for the {self.polygon}, with {HEADINGS} headings "
            f"in cells of {self.grid.resolution:g} m: {reason}"
        )


def ends(poses: Sequence[tuple[int, int]]) -> Ends:
    """Return poses and lengths as arrays."""
    table = np.array(poses, np.int64).reshape(-1, 2)
    return Ends(table[:, 0].copy(), table[:, 1].copy())
