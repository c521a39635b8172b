"""Search on an occupancy grid by the name of a method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from operator import index
from time import perf_counter
from typing import NamedTuple

import numpy as np
from jaxtyping import Int32, UInt8, UInt16

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.parameter import check_choice
from omnidrive.planning.search.astar import AStar
from omnidrive.planning.search.bitgrid import BitGrid, Cell
from omnidrive.planning.search.cost_astar import (
    DIRECTIONS,
    UNIT,
    CostAStar,
    largest_weight,
)
from omnidrive.planning.search.greedy import greedy
from omnidrive.planning.search.heuristics import (
    HEURISTICS,
    STRAIGHT,
    Heuristic,
)
from omnidrive.planning.search.interruptible import completed
from omnidrive.planning.search.jump_grid import JumpGrid
from omnidrive.planning.search.jump_point import JumpPointSearch
from omnidrive.planning.search.lazy_theta import lazy_theta
from omnidrive.planning.search.moves import START_MOVE, pruned_moves
from omnidrive.planning.search.result import SearchResult, path_length

_ROUNDING = 1e-9  # cells; of the length of a path


def _row_and_column(row: int, col: int) -> str:
    return f"row {row}, column {col}"


class SearchOutput(NamedTuple):
    """Output of a method."""

    indices: Int32[Array, " cells"]
    """Bit indices of the path's cells, empty if there is no path."""
    expansions: int
    cost: float | None = None
    """Cost in cell widths; None: the length."""


def search(
    grid: OccupancyGrid,
    start: Cell,
    goal: Cell,
    *,
    method: str = "astar",
    heuristic: str | None = None,
    neighbours: int = 8,
    cut_corners: bool = False,
    costs: CostMap | None = None,
) -> SearchResult:
    """Find a path from ``start`` to ``goal`` over free cells.

    Methods:
        ``astar``: a shortest path; the recommended method.
        ``jump-point``: a shortest path, faster on maps with open spaces or long corridors; only for
            eight neighbours without cutting corners.
        ``lazy-theta``: an any-angle path, not always the shortest possible, or the path of
            ``astar`` where that is shorter. It never touches the corner of an occupied cell. Only
            for eight neighbours without cutting corners.
        ``greedy``: expands the cell nearest the goal first. It expands few cells, and the path is
            longer, in mazes much longer. The method of the paper's published code.

    Heuristics, which estimate the remaining length:
        ``octile``: exact without obstacles for eight neighbours, where it is the default. An
            underestimate for four neighbours: more expansions. An overestimate for ``lazy-theta``:
            fewer expansions and a longer path.
        ``manhattan``: exact without obstacles for four neighbours, where it is the default. For
            eight neighbours (as in the paper's text) it overestimates by a factor of up to sqrt(2)
            and is not admissible: the path is up to sqrt(2) times too long, and cells are expanded
            repeatedly, so that the search is no faster on cluttered maps.
        ``euclidean``: admissible on any grid, and exact without obstacles for ``lazy-theta``, where
            it is the default. For eight neighbours it needs more expansions than ``octile``.
        ``zero``: Dijkstra's algorithm; every cell nearer than the goal is expanded.

    Args:
        grid: The occupancy grid. To search it repeatedly, create a :class:`GridSearch`.
        start: Row and column of a free cell.
        goal: Row and column of a free cell.
        method: Name of the method.
        heuristic: Name of the heuristic; None for the default of the method.
        neighbours: 8, or 4 for no diagonal moves. Paths over four neighbours are up to sqrt(2)
            times longer.
        cut_corners: Allow a diagonal move past an occupied cell, and between two. Paths are
            slightly shorter, but touch obstacles: a robot with an extent collides, and a smooth
            curve along the path may enter an obstacle.
        costs: Costs of the cells, with the frame of ``grid``: the path has the least cost of all,
            exactly, with costs rounded to 1/256. Only for ``astar``.

    Raises:
        InvalidInput: The method or heuristic is unknown, or the method does not support the
            neighbours, corner cutting or costs, or ``costs`` have another size than the grid.
        InvalidWaypoint: Start or goal is occupied or outside the grid.
        NoPathFound: There is no path.
    """
    searcher = GridSearch(grid, neighbours=neighbours, cut_corners=cut_corners, costs=costs)
    return searcher.search(start, goal, method=method, heuristic=heuristic)


@dataclass(frozen=True, eq=False)
class GridSearch:
    """Repeated searches on one grid.

    Attributes:
        grid: The occupancy grid; changes after the first search have no effect.
        neighbours: 8, or 4 for no diagonal moves.
        cut_corners: Allow a diagonal move past an occupied cell.
        cell_text: Text for the cell of a row and a column in messages.
        costs: Costs of the cells; None: none.

    Raises:
        InvalidInput: ``neighbours`` is neither 8 nor 4, or ``costs`` have another size than the
            grid.
    """

    grid: OccupancyGrid
    neighbours: int = 8
    cut_corners: bool = False
    cell_text: Callable[[int, int], str] = _row_and_column
    costs: CostMap | None = None

    def __post_init__(self) -> None:
        if self.costs is not None and self.costs.costs.shape != self.grid.occupied.shape:
            raise InvalidInput(
                f"the costs have the shape {self.costs.costs.shape}, the grid "
                f"{self.grid.occupied.shape}"
            )
        if self.neighbours not in {4, 8}:
            raise InvalidInput(f"neighbours must be 8 or 4, got {self.neighbours}")

    def search(
        self,
        start: Cell,
        goal: Cell,
        *,
        method: str = "astar",
        heuristic: str | None = None,
    ) -> SearchResult:
        """Find a path; arguments and errors as for :func:`search`."""
        check_choice("search method", method, _METHODS)
        find = self._method(method)
        _load(find)
        began = perf_counter()
        start_index, goal_index = self._index("start", start), self._index("goal", goal)
        found = SearchOutput(
            *find(self, start_index, goal_index, self._heuristic(method, heuristic))
        )
        if len(found.indices) == 0:
            raise NoPathFound(self._unreachable(start))
        cells = self._bitgrid.cells(found.indices)
        cost = path_length(cells) if found.cost is None else found.cost
        return SearchResult(cells, cost, found.expansions, perf_counter() - began)

    def prepare(self) -> None:
        """Compute what depends on the grid only, for :func:`search_within`, and load kernels."""
        if self.has_costs:
            _load(_cost_astar)
            _ = self._weights, self._lanes, self._largest_weight
        _load(_astar)
        _load(_jump_point)
        _ = self._bitgrid if self.cut_corners else self._jump_grid

    @property
    def has_costs(self) -> bool:
        """Whether a cell costs more than its length."""
        return self.costs is not None and not self.costs.is_plain

    @property
    def _against(self) -> int:
        """Weight that is added where a move is opposite to the lane."""
        assert self.costs is not None
        return round(UNIT * self.costs.against)

    @cached_property
    def _largest_weight(self) -> int:
        return largest_weight(self._weights, self._lanes, self._against)

    def _method(self, name: str) -> Method:
        """Return a method, that with costs if there are any."""
        if not self.has_costs:
            return _METHODS[name]
        if name != "astar":
            raise InvalidInput(f"{name} does not support costs; use astar")
        return _cost_astar

    @cached_property
    def _weights(self) -> UInt16[Array, "rows cols"]:
        """Weight of each cell in units of 1 / UNIT, in the order of the bitmap."""
        assert self.costs is not None
        weights = np.rint(UNIT * (1.0 + self.costs.costs)).astype(np.uint16)
        return np.ascontiguousarray(weights.T if self._bitgrid.transposed else weights)

    @cached_property
    def _lanes(self) -> UInt8[Array, "rows cols"]:
        """Direction of the lane of each cell plus 1, in the order of the bitmap; 0: no lane."""
        assert self.costs is not None
        if self.costs.directions is None:
            return np.zeros(self._weights.shape, np.uint8)
        angles = self.costs.directions - self.grid.yaw
        if self._bitgrid.transposed:
            angles = (0.5 * np.pi - angles).T
        known = np.isfinite(angles)
        turns = np.rint(np.where(known, angles, 0.0) * DIRECTIONS / (2.0 * np.pi)) % DIRECTIONS
        return np.ascontiguousarray(np.where(known, turns + 1.0, 0.0).astype(np.uint8))

    @cached_property
    def _bitgrid(self) -> BitGrid:
        return BitGrid.of(self.grid.occupied)

    @cached_property
    def _jump_grid(self) -> JumpGrid:
        return JumpGrid.of(self._bitgrid)

    @property
    def _move_table(self) -> UInt8[Array, "10 512"]:
        return pruned_moves(self.neighbours, self.cut_corners)

    def _heuristic(self, method: str, name: str | None) -> Heuristic:
        if name is None:
            name = "octile" if self.neighbours == 8 else "manhattan"
            name = "euclidean" if method == "lazy-theta" else name
        check_choice("heuristic", name, HEURISTICS)
        return HEURISTICS[name]

    def _index(self, name: str, cell: Cell) -> int:
        """Return the bit index of a free cell."""
        rows, cols = self.grid.occupied.shape
        row, col = index(cell[0]), index(cell[1])
        if not self.grid.contains(row, col):
            raise InvalidWaypoint(
                f"the {name} ({self.cell_text(row, col)}) lies outside the grid of {rows} rows "
                f"and {cols} columns"
            )
        if self.grid.occupied[row, col]:
            raise InvalidWaypoint(
                f"the {name} ({self.cell_text(row, col)}) is occupied; {self._nearest(row, col)}"
            )
        return self._bitgrid.index_of((row, col))

    def _nearest(self, row: int, col: int) -> str:
        """Describe the nearest free cell, for messages."""
        nearest = self.grid.nearest_free(*self.grid.centre(row, col))
        if nearest is None:
            return "no cell is free"
        cell, distance = nearest
        cells = f"{distance / self.grid.resolution:.3g}"
        unit = "cell" if cells == "1" else "cells"
        return f"the nearest free cell is ({self.cell_text(*cell)}), {cells} {unit} away"

    def _unreachable(self, start: Cell) -> str:
        """Explain why there is no path, for messages."""
        cut_corners = self.cut_corners and self.neighbours == 8
        reached = self.grid.region_size(*start, cut_corners=cut_corners)
        free = self.grid.occupied.size - np.count_nonzero(self.grid.occupied)
        return (
            f"there is no path from start to goal: only {reached} of {free} free cells can be "
            "reached from the start, and the goal is not among them"
        )

    def _require_default_moves(self, method: str) -> None:
        """Raise InvalidInput for four neighbours and for corner cutting."""
        if self.neighbours != 8 or self.cut_corners:
            raise InvalidInput(
                f"{method} supports only 8 neighbours without cutting corners; use astar"
            )


Method = Callable[[GridSearch, int, int, Heuristic], tuple]
"""Search between two bit indices; returns the fields of a :class:`SearchOutput`."""


def _cost_astar(
    searcher: GridSearch, start_index: int, goal_index: int, heuristic: Heuristic
) -> SearchOutput:
    run = CostAStar(
        searcher._bitgrid, searcher._weights, searcher._lanes, searcher._against, start_index,
        goal_index, searcher._move_table[START_MOVE], heuristic,
    )  # fmt: skip
    indices, expansions = completed(run)
    return SearchOutput(indices, expansions, run.progress.best / (2.0 * UNIT * STRAIGHT))


def _astar(searcher: GridSearch, start_index: int, goal_index: int, heuristic: Heuristic) -> tuple:
    return completed(
        AStar(searcher._bitgrid, start_index, goal_index, searcher._move_table, heuristic)
    )


def _greedy(searcher: GridSearch, start_index: int, goal_index: int, heuristic: Heuristic) -> tuple:
    return greedy(searcher._bitgrid, start_index, goal_index, searcher._move_table, heuristic)


def _jump_point(
    searcher: GridSearch, start_index: int, goal_index: int, heuristic: Heuristic
) -> tuple:
    searcher._require_default_moves("jump-point")
    return completed(
        JumpPointSearch(
            searcher._bitgrid, searcher._jump_grid, start_index, goal_index, searcher._move_table,
            heuristic,
        )
    )  # fmt: skip


def _lazy_theta(
    searcher: GridSearch, start_index: int, goal_index: int, heuristic: Heuristic
) -> tuple:
    searcher._require_default_moves("lazy-theta")
    octile = HEURISTICS["octile"]
    along_moves, expansions = _astar(searcher, start_index, goal_index, octile)
    # without a path, line-of-sight checks over a large region would take minutes
    if len(along_moves) == 0:
        return along_moves, expansions
    any_angle, expansions = lazy_theta(
        searcher._bitgrid, start_index, goal_index, searcher._move_table, heuristic
    )
    lengths = [path_length(searcher._bitgrid.cells(path)) for path in (along_moves, any_angle)]
    return along_moves if lengths[0] < lengths[1] - _ROUNDING else any_angle, expansions


_METHODS: dict[str, Method] = {
    "astar": _astar,
    "jump-point": _jump_point,
    "lazy-theta": _lazy_theta,
    "greedy": _greedy,
}


@cache
def _load(find: Method) -> None:
    """Compile or load the kernels of a method, so that search times exclude compilation."""
    grid = OccupancyGrid(np.zeros((1, 2), bool), 1.0)
    tiny = GridSearch(grid, costs=CostMap.of(grid))
    start_index, goal_index = tiny._bitgrid.index_of((0, 0)), tiny._bitgrid.index_of((0, 1))
    find(tiny, start_index, goal_index, HEURISTICS["octile"])
