"""Solution of all queries of a MovingAI scenario file."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, get_args

from omnidrive.choices import HeuristicName, MethodName
from omnidrive.errors import InvalidWaypoint, NoPathFound
from omnidrive.maps import OccupancyGrid, Query
from omnidrive.maps.queries import file_cell
from omnidrive.parameter import check_choice
from omnidrive.planning import GridSearch

_SINGLE_PRECISION = 1e-6  # relative; in which the lengths of some files were computed


def solve_queries(
    grid: OccupancyGrid,
    queries: Sequence[Query],
    *,
    method: MethodName = "astar",
    heuristic: HeuristicName | None = None,
) -> dict[str, Any]:
    """Search every query and compare the lengths with those of the file.

    Two lengths differ by more than half of the last decimal in the file and single precision.

    Args:
        grid: The map of the queries.
        queries: The queries.
        method: Search method, see :func:`~omnidrive.planning.search`.
        heuristic: Heuristic of the search; None for the default of the method.

    Returns:
        The method, the number of queries and of solved queries, the total expansions and seconds,
        and ``differing``: for every query whose length differs from the file's, its number (from
        0) and line (from 1), start and goal as (row, column) of the grid and as (x, y) of the
        file, both lengths in cells, and the error message, in x and y of the file, if no path was
        found (``length`` is then None).

    Raises:
        InvalidInput: The method or heuristic is unknown.
    """
    check_choice("search method", method, get_args(MethodName))
    if heuristic is not None:
        check_choice("heuristic", heuristic, get_args(HeuristicName))
    search, differing = GridSearch(grid, cell_text=partial(_cell_text, grid)), []
    expansions, seconds, solved = 0, 0.0, 0
    for number, query in enumerate(queries):
        length, why = None, ""
        try:
            found = search.search(query.start, query.goal, method=method, heuristic=heuristic)
        except (NoPathFound, InvalidWaypoint) as error:
            why = str(error)
        else:
            length, solved = found.cost, solved + 1
            expansions, seconds = expansions + found.expansions, seconds + found.seconds
        allowed = query.rounding + _SINGLE_PRECISION * max(1.0, query.length)
        if length is None or abs(length - query.length) > allowed:
            facts = _facts(grid, query)
            differing.append({"query": number, **facts, "length": length, "why": why})
    return {
        "search": method,
        "queries": len(queries),
        "solved": solved,
        "differing": differing,
        "expansions": expansions,
        "seconds": seconds,
    }


def _facts(grid: OccupancyGrid, query: Query) -> dict[str, Any]:
    """Return what the file says of a query, with cells of the grid and of the file."""
    return {
        "line": query.line,
        "start": list(query.start),
        "goal": list(query.goal),
        "start_in_file": list(file_cell(grid, *query.start)),
        "goal_in_file": list(file_cell(grid, *query.goal)),
        "length_in_file": query.length,
    }


def _cell_text(grid: OccupancyGrid, row: int, col: int) -> str:
    x, y = file_cell(grid, row, col)
    return f"x {x}, y {y}"
