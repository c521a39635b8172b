"""Which moves a search needs to try from a cell."""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Bool, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.planning.search.machine import int64

Move = tuple[int, int]

MOVES: tuple[Move, ...] = (
    (0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1),
)  # fmt: skip
"""Rows and columns of every move; those along an axis first."""

BEGIN = len(MOVES) + 1
"""How the start was reached; other cells by move i: i + 1."""

_AROUND = np.arange(512)


@inlined
def surroundings(bits: UInt8[Array, " bytes"], stride: int, cell: int) -> int:
    """The nine cells around one as a number: bit 3 i + j is row i, column j, 1 where occupied."""
    at, shift = (cell - stride - 1) >> 3, (cell - 1) & 7
    around = 0
    for row in range(3):
        pair = int64(bits[at]) | int64(bits[at + 1]) << 8
        around |= (pair >> shift & 7) << 3 * row
        at += stride >> 3
    return around


@cache
def needed_moves(neighbours: int, cut_corners: bool) -> UInt8[Array, "10 512"]:
    """Moves to try from a cell, as bits, by how it was reached and by its surroundings.

    A move is left out if the cell before leads to the same place without this one, either on a
    shorter way or on one as long whose first move is more diagonal, or without diagonals, more
    along the row: every set of equally long ways that differ only in the order of their moves is
    followed once (Harabor & Grastien 2011, "Online graph pruning for pathfinding on grid maps";
    Sturtevant & Rabin 2016, "Canonical orderings on grids"). Shortest ways stay so: of a run in
    one direction after which a move is left out for one as long, the first cell has that move, and
    the moves after it, along the run, are never left out.

    Row 0 is empty; row :data:`BEGIN` has every move that is allowed.
    """
    table = np.zeros((BEGIN + 1, len(_AROUND)), np.uint8)
    count = 4 if neighbours == 4 else 8
    for move in range(count):
        bit = np.uint8(1 << move)
        allowed = _allowed((0, 0), MOVES[move], cut_corners)
        table[BEGIN] |= bit * allowed
        for before in range(count):
            spare = _spare(MOVES[before], MOVES[move], MOVES[:count], cut_corners)
            table[before + 1] |= bit * (allowed & ~spare)
    return table


def _spare(
    before: Move, move: Move, moves: tuple[Move, ...], cut_corners: bool
) -> Bool[Array, " surroundings"]:
    """Whether ``move`` after ``before`` leads where another way does that avoids the middle."""
    origin, target = (-before[0], -before[1]), move
    if origin == target:
        return np.ones(len(_AROUND), bool)
    length, spare = _length(before) + _length(move), np.zeros(len(_AROUND), bool)
    for first in moves:
        via = (origin[0] + first[0], origin[1] + first[1])
        if via == target:
            spare |= _allowed(origin, first, cut_corners)
        second = (target[0] - via[0], target[1] - via[1])
        if via == (0, 0) or second not in moves:
            continue
        other = _length(first) + _length(second)
        if other < length or (other == length and _rank(first) < _rank(before)):
            spare |= _allowed(origin, first, cut_corners) & _allowed(via, second, cut_corners)
    return spare


def _allowed(cell: Move, move: Move, cut_corners: bool) -> Bool[Array, " surroundings"]:
    """Whether a move is allowed from a cell, both counted from the middle of the surroundings."""
    row, col = cell[0] + move[0], cell[1] + move[1]
    allowed = _free(row, col)
    if 0 in move or cut_corners:
        return allowed
    both: Bool[Array, " surroundings"] = _free(cell[0], col) & _free(row, cell[1])
    both &= allowed
    return both


def _free(row: int, col: int) -> Bool[Array, " surroundings"]:
    """Whether a cell is free; outside the surroundings, it is not known to be."""
    if max(abs(row), abs(col)) > 1:
        return np.zeros(len(_AROUND), bool)
    free: Bool[Array, " surroundings"] = (_AROUND >> (3 * row + col + 4) & 1) == 0
    return free


def _length(move: Move) -> float:
    return 1.0 if 0 in move else 2.0**0.5


def _rank(move: Move) -> int:
    """Diagonal moves come before those along the row, and these before the others."""
    return 0 if 0 not in move else 1 + (move[1] == 0)
