"""Search of the best path in a limited time."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

from jaxtyping import Int32

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, NoPathFound, NoPathYet
from omnidrive.parameter import check_choice
from omnidrive.planning.search.astar import AStar
from omnidrive.planning.search.bitgrid import Cell
from omnidrive.planning.search.cost_astar import UNIT, CostAStar, path_cost
from omnidrive.planning.search.grid_search import GridSearch
from omnidrive.planning.search.heuristics import (
    HEURISTICS,
    STRAIGHT,
    Heuristic,
    cost_to_go,
    weighted,
)
from omnidrive.planning.search.interruptible import Run, Turn, has_path, interleave
from omnidrive.planning.search.jump_point import JumpPointSearch
from omnidrive.planning.search.moves import START_MOVE
from omnidrive.planning.search.result import SearchResult, path_length

_WEIGHT, _COST_WEIGHT = 1.5, 2.5  # of the heuristics of searches for first paths
_CELLS, _JUMPS = 1 << 12, 1 << 9  # expansions between two looks at the clock


class Found(NamedTuple):
    """Best path that was found in time."""

    result: SearchResult
    suboptimality: float
    """Greatest possible ratio of its cost to the least."""
    is_optimal: bool
    """Whether an exact search ended."""


def search_within(
    searcher: GridSearch,
    start: Cell,
    goal: Cell,
    is_over: Callable[[bool], bool],
    *,
    method: str = "astar",
    heuristic: str | None = None,
) -> Found:
    """Find the best path until ``is_over``, which is called with whether there is a path.

    Weighted A* (Pohl 1970, "Heuristic search viewed as path finding in a graph") over jump points
    finds a first path. Exact searches take turns with it and go on after it: A* and jump points,
    one of which is the faster on every map, or A* with costs, weighted and exact.

    Raises:
        InvalidInput: The method is neither ``astar`` nor ``jump-point``, or the heuristic
            overestimates.
        InvalidWaypoint: Start or goal is occupied or outside the grid.
        NoPathYet: The time is over before there is a path.
        NoPathFound: There is no path.
    """
    check_choice("search method", method, ("astar", "jump-point", "lazy-theta", "greedy"))
    if method not in {"astar", "jump-point"}:
        raise InvalidInput(f"{method} does not support a time limit; use astar")
    searcher._method(method)
    chosen = searcher._heuristic(method, heuristic)
    if not chosen.is_consistent:
        raise InvalidInput(f"{heuristic} does not support a time limit; use octile")
    began = perf_counter()
    ends = searcher._index("start", start), searcher._index("goal", goal)
    turns = _turns(searcher, method, ends, chosen)
    is_optimal = interleave(turns, is_over)
    expansions = sum(turn.run.progress.expansions for turn in turns)
    runs = [turn.run for turn in turns if has_path(turn.run)]
    if not runs and is_optimal:
        raise NoPathFound("there is no path from start to goal")
    if not runs:
        raise NoPathYet(
            f"no path from start to goal was found within the time limit, in {expansions} "
            "expansions; there may be one: allow more time"
        )
    cost, path = _best(searcher, runs)
    suboptimality = 1.0
    if not is_optimal:
        octile = cost_to_go(HEURISTICS["octile"], start[0] - goal[0], start[1] - goal[1])
        bounds = [turn.run.lower_bound for turn in turns if turn.is_exact]
        suboptimality = max(cost / max(octile / STRAIGHT, 1e-9, *bounds), 1.0)
    result = SearchResult(searcher._bitgrid.cells(path), cost, expansions, perf_counter() - began)
    return Found(result, suboptimality, is_optimal)


def _turns(
    searcher: GridSearch, method: str, ends: tuple[int, int], heuristic: Heuristic
) -> list[Turn]:
    """Return the searches that take turns: one for a first path, others for a better one."""
    bitgrid, table = searcher._bitgrid, searcher._move_table
    has_jumps = searcher.neighbours == 8 and not searcher.cut_corners
    turns = []
    if has_jumps:
        jumps = bitgrid, searcher._jump_grid
        first = JumpPointSearch(*jumps, *ends, table, weighted("octile", _WEIGHT))
        turns.append(Turn(first, 2 * _JUMPS if searcher.has_costs else _JUMPS, False))
        if not searcher.has_costs:
            turns.append(Turn(JumpPointSearch(*jumps, *ends, table, heuristic), _JUMPS, True))
    else:
        along = AStar(bitgrid, *ends, table, weighted("octile", _WEIGHT))
        turns.append(Turn(along, _CELLS, False))
    if searcher.has_costs:
        for estimate in (weighted("octile", _COST_WEIGHT), heuristic):
            run = CostAStar(
                bitgrid, searcher._weights, searcher._lanes, searcher._against, *ends,
                table[START_MOVE], estimate, searcher._largest_weight,
            )  # fmt: skip
            turns.append(Turn(run, _CELLS // 2, estimate is heuristic))
    elif method == "astar" or not has_jumps:
        turns.append(Turn(AStar(bitgrid, *ends, table, heuristic), _CELLS, True))
    return turns


def _best(searcher: GridSearch, runs: list[Run]) -> tuple[float, Int32[Array, " cells"]]:
    """Return cost in cell widths and bit indices of the best path of searches."""
    if not searcher.has_costs:
        path = min(runs, key=lambda run: run.progress.best).path()
        return path_length(searcher._bitgrid.cells(path)), path
    grid = searcher._weights, searcher._lanes, searcher._against, searcher._bitgrid.stride
    paths = [run.path() for run in runs]
    costs = [path_cost(*grid, path) for path in paths]
    best = costs.index(min(costs))
    return costs[best] / (2.0 * UNIT * STRAIGHT), paths[best]
