"""Greedy best-first search."""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np
from jaxtyping import Int32, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.planning.search.astar import walk_back
from omnidrive.planning.search.board import BitBoard
from omnidrive.planning.search.lengths import Heuristic, to_go
from omnidrive.planning.search.moves import BEGIN, MOVES, surroundings
from omnidrive.planning.search.tiles import Tiles, empty_tiles, place

_ROWS, _COLS = np.array(MOVES).T.copy()


def greedy(
    board: BitBoard, first: int, last: int, needed: UInt8[Array, "10 512"], heuristic: Heuristic
) -> tuple[Int32[Array, " cells"], int]:
    """Cells of a way and how many were expanded; no cells if there is no way.

    The cell nearest the goal is expanded next, of equally near ones the first of the map; the way
    is not the shortest (Russell & Norvig, "Artificial Intelligence", sec. 3.5.1).
    """
    words = empty_tiles(board, wide=False)
    expansions = _reach(board.bits, board.stride, first, last, needed[BEGIN], heuristic, words)
    return walk_back(words, board.stride, first, last), expansions


@compiled
def _reach(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    first: int,
    last: int,
    allowed: UInt8[Array, " surroundings"],
    heuristic: Heuristic,
    words: Tiles,
) -> int:
    """Fill ``words`` (how a cell was reached) and count the expansions."""
    goal_row, goal_col = last // stride, last % stride
    words[place(stride, first // stride, first % stride)] = BEGIN
    queue, expansions = [(0, first)], 0
    while len(queue) > 0:
        _, cell = heappop(queue)
        if cell == last:
            break
        expansions += 1
        moves = allowed[surroundings(bits, stride, cell)]
        for move in range(8):
            if moves >> move & 1 == 0:
                continue
            row, col = cell // stride + _ROWS[move], cell % stride + _COLS[move]
            at = place(stride, row, col)
            if words[at] == 0:
                words[at] = move + 1
                left = to_go(heuristic, row - goal_row, col - goal_col)
                heappush(queue, (left, row * stride + col))
    return expansions
