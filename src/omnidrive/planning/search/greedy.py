"""Greedy best-first search."""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np
from jaxtyping import Int32, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.planning.search.astar import reconstruct_path
from omnidrive.planning.search.bit_tiles import Tiles, empty_tiles, tile_index
from omnidrive.planning.search.bitgrid import BitGrid
from omnidrive.planning.search.heuristics import Heuristic, cost_to_go
from omnidrive.planning.search.moves import MOVES, START_MOVE, neighbourhood

_ROWS, _COLS = np.array(MOVES).T.copy()


def greedy(
    bitgrid: BitGrid,
    start: int,
    goal: int,
    move_table: UInt8[Array, "10 512"],
    heuristic: Heuristic,
) -> tuple[Int32[Array, " cells"], int]:
    """Return the cells of a path, empty if there is none, and the number of expansions.

    The cell with the least heuristic value is expanded next; ties are broken by the order of the
    cells in the map. The path is in general not a shortest one (Russell & Norvig, "Artificial
    Intelligence", sec. 3.5.1).
    """
    words = empty_tiles(bitgrid, wide=False)
    expansions = _explore(
        bitgrid.bits, bitgrid.stride, start, goal, move_table[START_MOVE], heuristic, words
    )
    return reconstruct_path(words, bitgrid.stride, start, goal), expansions


@compiled
def _explore(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    start: int,
    goal: int,
    allowed: UInt8[Array, " neighbourhoods"],
    heuristic: Heuristic,
    words: Tiles,
) -> int:
    """Fill ``words`` with the move by which a cell was reached; return the number of expansions."""
    goal_row, goal_col = goal // stride, goal % stride
    words[tile_index(stride, start // stride, start % stride)] = START_MOVE
    queue, expansions = [(0, start)], 0
    while len(queue) > 0:
        _, cell = heappop(queue)
        if cell == goal:
            break
        expansions += 1
        moves = allowed[neighbourhood(bits, stride, cell)]
        for move in range(8):
            if moves >> move & 1 == 0:
                continue
            row, col = cell // stride + _ROWS[move], cell % stride + _COLS[move]
            at = tile_index(stride, row, col)
            if words[at] == 0:
                words[at] = move + 1
                remaining = cost_to_go(heuristic, row - goal_row, col - goal_col)
                heappush(queue, (remaining, row * stride + col))
    return expansions
