"""Search on an occupancy grid, by the name of a method."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from operator import index
from time import perf_counter
from typing import Literal

import numpy as np
from jaxtyping import Int32, UInt8

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.search.astar import astar
from omnidrive.planning.search.board import BitBoard, Cell
from omnidrive.planning.search.greedy import greedy
from omnidrive.planning.search.jump_board import JumpBoard
from omnidrive.planning.search.jump_point import jump_point
from omnidrive.planning.search.lazy_theta import lazy_theta
from omnidrive.planning.search.lengths import HEURISTICS, Heuristic
from omnidrive.planning.search.moves import needed_moves
from omnidrive.planning.search.result import SearchResult, length

MethodName = Literal["astar", "jump-point", "lazy-theta", "greedy"]
Found = tuple[Int32[Array, " cells"], int]
"""Numbers of a way's cells, none if there is no way, and how many cells were expanded."""


def search(
    grid: OccupancyGrid,
    start: Cell,
    goal: Cell,
    *,
    method: str = "astar",
    heuristic: str | None = None,
    neighbours: int = 8,
    cut_corners: bool = False,
) -> SearchResult:
    """Find a way from ``start`` to ``goal`` over free cells.

    Methods:
        ``astar``: the shortest way; the one to take if in doubt.
        ``jump-point``: the shortest way, sooner where there are open spaces or long corridors; for
            eight neighbours without cutting corners only.
        ``lazy-theta``: turns at any cell to any angle, so that the way is shorter than those over
            neighbours, but not the shortest possible; never touches the corner of an occupied
            cell. For eight neighbours without cutting corners only.
        ``greedy``: the cell nearest the goal first; expands few cells, and the way is longer, on
            mazes much longer. What the paper's published code does.

    Heuristics, the length taken to be left to go:
        ``octile``: exact without obstacles for eight neighbours, where it is the default. Below
            the truth for four neighbours: more expansions. Above it for ``lazy-theta``: fewer
            expansions and a longer way.
        ``manhattan``: exact without obstacles for four neighbours, where it is the default. For
            eight, up to sqrt(2) times too much (not admissible; the paper's text): a way up to
            sqrt(2) times too long, and cells are expanded again and again, so that on cluttered
            maps it is not even found sooner.
        ``euclidean``: below the truth for any grid, and exact for ``lazy-theta``, where it is the
            default. Never a longer way; for eight neighbours more expansions than ``octile``.
        ``zero``: Dijkstra's search, every cell nearer than the goal is expanded.

    Args:
        grid: The cells that may be used. To search it many times, make a :class:`GridSearch`.
        start: Row and column of a free cell.
        goal: Row and column of a free cell.
        method: How to search.
        heuristic: What is taken to be left to go; None for the default of the method.
        neighbours: 8, or 4: no diagonal moves. Ways over four are up to sqrt(2) times longer.
        cut_corners: Allow a diagonal move past an occupied cell, and between two. Ways are a
            little shorter, but touch obstacles: a robot wider than a point hits them, and a
            smooth curve along them may enter an obstacle.

    Raises:
        InvalidInput: There is no such method or heuristic, or the method cannot do what is asked.
        InvalidWaypoint: Start or goal is occupied or outside the grid.
        NoPathFound: There is no way.
    """
    return GridSearch(grid, neighbours=neighbours, cut_corners=cut_corners).search(
        start, goal, method=method, heuristic=heuristic
    )


@dataclass(frozen=True, eq=False)
class GridSearch:
    """A grid prepared for many searches.

    Attributes:
        grid: The cells that may be used; changes of it after the first search go unnoticed.
        neighbours: 8, or 4: no diagonal moves.
        cut_corners: Allow a diagonal move past an occupied cell.

    Raises:
        InvalidInput: ``neighbours`` is neither 8 nor 4.
    """

    grid: OccupancyGrid
    neighbours: int = 8
    cut_corners: bool = False

    def __post_init__(self) -> None:
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
        """As :func:`search`; for arguments and errors, see there."""
        run = _METHODS.get(method)
        if run is None:
            raise InvalidInput(f"there is no search method {method!r}; choose {_list(_METHODS)}")
        _load(method)
        began = perf_counter()
        first, last = self._number("start", start), self._number("goal", goal)
        numbers, expansions = run(self, first, last, self._heuristic(method, heuristic))
        if len(numbers) == 0:
            raise NoPathFound(self._unreachable(start))
        cells = self._board.cells(numbers)
        return SearchResult(cells, length(cells), expansions, perf_counter() - began)

    @cached_property
    def _board(self) -> BitBoard:
        return BitBoard.of(self.grid.occupied)

    @cached_property
    def _jump_board(self) -> JumpBoard:
        return JumpBoard.of(self._board)

    @property
    def _needed(self) -> UInt8[Array, "10 512"]:
        return needed_moves(self.neighbours, self.cut_corners)

    def _heuristic(self, method: str, name: str | None) -> Heuristic:
        if name is None:
            name = "octile" if self.neighbours == 8 else "manhattan"
            name = "euclidean" if method == "lazy-theta" else name
        if name not in HEURISTICS:
            raise InvalidInput(f"there is no heuristic {name!r}; choose {_list(HEURISTICS)}")
        return HEURISTICS[name]

    def _number(self, name: str, cell: Cell) -> int:
        """The number of a free cell."""
        rows, cols = self.grid.occupied.shape
        row, col = index(cell[0]), index(cell[1])
        if not self.grid.contains(row, col):
            raise InvalidWaypoint(
                f"the {name} ({row}, {col}) lies outside the grid of {rows} rows and {cols} columns"
            )
        if self.grid.occupied[row, col]:
            raise InvalidWaypoint(
                f"the {name} ({row}, {col}) is occupied; {self._nearest(row, col)}"
            )
        return self._board.number((row, col))

    def _nearest(self, row: int, col: int) -> str:
        """Where the nearest free cell is, in words."""
        nearest = self.grid.nearest_free(*self.grid.centre(row, col))
        if nearest is None:
            return "no cell is free"
        (r, c), distance = nearest
        cells = distance / self.grid.resolution
        return f"the nearest free cell is ({r}, {c}), {cells:.3g} cells away"

    def _unreachable(self, start: Cell) -> str:
        """Why there is no way, in words."""
        cut_corners = self.cut_corners and self.neighbours == 8
        reached = self.grid.region_size(*start, cut_corners=cut_corners)
        free = self.grid.occupied.size - np.count_nonzero(self.grid.occupied)
        return (
            f"there is no way from start to goal: only {reached} of {free} free cells can be "
            "reached from the start, and the goal is not among them"
        )

    def _only_standard_moves(self, method: str) -> None:
        """Refuse moves that a method does not know."""
        if self.neighbours != 8 or self.cut_corners:
            raise InvalidInput(
                f"{method} searches among 8 neighbours without cutting corners only; use astar"
            )


def _astar(on: GridSearch, first: int, last: int, heuristic: Heuristic) -> Found:
    return astar(on._board, first, last, on._needed, heuristic)


def _greedy(on: GridSearch, first: int, last: int, heuristic: Heuristic) -> Found:
    return greedy(on._board, first, last, on._needed, heuristic)


def _jump_point(on: GridSearch, first: int, last: int, heuristic: Heuristic) -> Found:
    on._only_standard_moves("jump-point")
    return jump_point(on._board, on._jump_board, first, last, on._needed, heuristic)


def _lazy_theta(on: GridSearch, first: int, last: int, heuristic: Heuristic) -> Found:
    on._only_standard_moves("lazy-theta")
    along_moves, expansions = astar(on._board, first, last, on._needed, HEURISTICS["octile"])
    if len(along_moves) == 0:  # lines of sight over a large region would take minutes to know
        return along_moves, expansions
    return lazy_theta(on._board, first, last, on._needed, heuristic)


_METHODS: dict[str, Callable[[GridSearch, int, int, Heuristic], Found]] = {
    "astar": _astar,
    "jump-point": _jump_point,
    "lazy-theta": _lazy_theta,
    "greedy": _greedy,
}


@cache
def _load(method: str) -> None:
    """Compile or load a method's kernels, so that no search's time is that of the compiler."""
    tiny = GridSearch(OccupancyGrid(np.zeros((1, 2), bool), 1.0))
    first, last = tiny._board.number((0, 0)), tiny._board.number((0, 1))
    _METHODS[method](tiny, first, last, HEURISTICS["octile"])


def _list(names: Iterable[str]) -> str:
    return ", ".join(names)
