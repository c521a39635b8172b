"""Moves between cells and their pruning by the neighbourhood of a cell."""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Bool, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.planning.search.bit_ops import int64

Move = tuple[int, int]

MOVES: tuple[Move, ...] = (
    (0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1),
)  # fmt: skip
"""Change of row and column of every move; moves along an axis first."""

START_MOVE = len(MOVES) + 1
"""Code of the start cell, which has no last move; the code of move i is i + 1."""

_NEIGHBOURHOODS = np.arange(512)


@inlined
def neighbourhood(bits: UInt8[Array, " bytes"], stride: int, cell: int) -> int:
    """Return the 3 x 3 cells around a cell as bits: bit 3 i + j is cell (i, j), 1 if occupied."""
    at, shift = (cell - stride - 1) >> 3, (cell - 1) & 7
    around = 0
    for row in range(3):
        pair = int64(bits[at]) | int64(bits[at + 1]) << 8
        around |= (pair >> shift & 7) << 3 * row
        at += stride >> 3
    return around


@cache
def pruned_moves(neighbours: int, cut_corners: bool) -> UInt8[Array, "10 512"]:
    """Return the moves to try from a cell, as bits, by its last move and its neighbourhood.

    A move is pruned if the target can be reached from the previous cell without passing the current
    cell, either on a shorter path or on an equally long path whose first move comes earlier in the
    order diagonal, along the row, along the column. Of all equally long paths that differ only in
    the order of their moves, one is searched (Harabor & Grastien 2011, "Online graph pruning for
    pathfinding on grid maps"; Sturtevant & Rabin 2016, "Canonical orderings on grids"). Shortest
    paths are preserved: where a move after a straight run is pruned in favour of an equally long
    path, the first cell of the run keeps that move, and the subsequent moves along the run are
    never pruned.

    Args:
        neighbours: 8, or 4 for no diagonal moves.
        cut_corners: Whether diagonal moves may pass occupied cells.

    Returns:
        Table by the code of the last move (see :data:`START_MOVE`) and by
        :func:`neighbourhood`. Row 0 is empty; row :data:`START_MOVE` has every allowed move.
    """
    table = np.zeros((START_MOVE + 1, len(_NEIGHBOURHOODS)), np.uint8)
    count = 4 if neighbours == 4 else 8
    for move in range(count):
        bit = np.uint8(1 << move)
        allowed = _is_allowed((0, 0), MOVES[move], cut_corners)
        table[START_MOVE] |= bit * allowed
        for before in range(count):
            spare = _is_redundant(MOVES[before], MOVES[move], MOVES[:count], cut_corners)
            table[before + 1] |= bit * (allowed & ~spare)
    return table


def _is_redundant(
    before: Move, move: Move, moves: tuple[Move, ...], cut_corners: bool
) -> Bool[Array, " neighbourhoods"]:
    """Whether another path that avoids the centre cell replaces ``move`` after ``before``."""
    origin, target = (-before[0], -before[1]), move
    if origin == target:
        return np.ones(len(_NEIGHBOURHOODS), bool)
    length, spare = _length(before) + _length(move), np.zeros(len(_NEIGHBOURHOODS), bool)
    for first in moves:
        via = (origin[0] + first[0], origin[1] + first[1])
        if via == target:
            spare |= _is_allowed(origin, first, cut_corners)
        second = (target[0] - via[0], target[1] - via[1])
        if via == (0, 0) or second not in moves:
            continue
        other = _length(first) + _length(second)
        if other < length or (other == length and _rank(first) < _rank(before)):
            spare |= _is_allowed(origin, first, cut_corners) & _is_allowed(via, second, cut_corners)
    return spare


def _is_allowed(cell: Move, move: Move, cut_corners: bool) -> Bool[Array, " neighbourhoods"]:
    """Whether a move is allowed from a cell, given relative to the centre of the neighbourhood."""
    row, col = cell[0] + move[0], cell[1] + move[1]
    allowed = _is_free(row, col)
    if 0 in move or cut_corners:
        return allowed
    both: Bool[Array, " neighbourhoods"] = _is_free(cell[0], col) & _is_free(row, cell[1])
    both &= allowed
    return both


def _is_free(row: int, col: int) -> Bool[Array, " neighbourhoods"]:
    """Whether a cell is free; cells outside the neighbourhood count as occupied."""
    if max(abs(row), abs(col)) > 1:
        return np.zeros(len(_NEIGHBOURHOODS), bool)
    free: Bool[Array, " neighbourhoods"] = (_NEIGHBOURHOODS >> (3 * row + col + 4) & 1) == 0
    return free


def _length(move: Move) -> float:
    return 1.0 if 0 in move else 2.0**0.5


def _rank(move: Move) -> int:
    """Return the rank of a move: diagonal, then along the row, then along the column."""
    return 0 if 0 not in move else 1 + (move[1] == 0)
