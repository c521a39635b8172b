"""Jump points along rows, columns and diagonals, found 64 cells at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped, UInt64

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.bit_ops import int64, leading_zeros, trailing_zeros, uint64
from omnidrive.planning.search.bitgrid import MARGIN, BitGrid
from omnidrive.planning.search.heuristics import DIAGONAL, STRAIGHT
from omnidrive.planning.search.moves import MOVES

_ONE, _ALL, _LAST = np.uint64(1), ~np.uint64(0), np.uint64(63)
_BYTES = 7  # 64 bits from a cell's byte on hold at least this many bytes after the cell
_AHEAD = np.uint64(((1 << 8 * _BYTES) - 1) << 1)  # bits after the first
_BACK = np.uint64(((1 << 8 * _BYTES) - 1) << 63 - 8 * _BYTES)  # bits before the last
_BLOCKS = 8  # of 64 x 64 bits, handled together: one row of them is a cache line
_GROUPS = tuple(  # group size, and mask of the lower group of every pair
    (size, np.uint64(sum((1 << size) - 1 << at for at in range(0, 64, 2 * size))))
    for size in (32, 16, 8, 4, 2, 1)
)
_ROWS, _COLS = np.array(MOVES).T.copy()


JUMP = np.dtype([("cell", "i8"), ("length", "i8"), ("move", "i8")], align=True)
"""Index of a jump point, the length of the path to it, and the last move."""


class JumpGrid(NamedTuple):
    """Bits of a bitmap, row by row and column by column.

    Attributes:
        rows: 64 bits starting at every byte: overlapping views of the bitmap's memory.
        columns: The same for the transposed bitmap.
        other: Number of bits per column.
    """

    rows: UInt64[Array, " bytes"]
    columns: UInt64[Array, " column_bytes"]
    other: int

    @classmethod
    def of(cls, bitgrid: BitGrid) -> JumpGrid:
        """Create the views of a bitmap, which share its memory, and of its transpose."""
        rows, cols = bitgrid.shape
        transposed = BitGrid.full(cols, rows)
        other = transposed.stride
        _transpose(bitgrid.words, bitgrid.stride >> 6, rows, transposed.words, other >> 6, cols)
        return cls(_windows(bitgrid.words), _windows(transposed.words), other)


def _windows(words: UInt64[Array, " words"]) -> UInt64[Array, " bytes"]:
    """Return overlapping views of 64 bits, one starting at every byte."""
    return np.ndarray((8 * len(words) - 7,), np.uint64, words, strides=(1,))


@compiled
def jumps(  # noqa: PLR0917
    jump_grid: JumpGrid,
    stride: int,
    cell: int,
    goal: int,
    moves: int,
    found: Shaped[Array, " most"],
) -> int:
    """Find the first jump points, or the goal, along moves from a cell.

    The jump points of the straight runs beside a diagonal run are included, the cells of the
    diagonal run itself are not.

    Args:
        jump_grid: The bits by rows and by columns.
        stride: Number of bits per row.
        cell: Index of the cell.
        goal: Index of the goal cell.
        moves: Moves to try, as bits; diagonal moves must be allowed.
        found: Output: the jump points, of type :data:`JUMP`.

    Returns:
        Number of elements of ``found`` that were filled.
    """
    rows, columns, other = jump_grid
    count, by_column = 0, _column_index(other, stride, cell)
    goal_by_column = _column_index(other, stride, goal)
    while moves != 0:
        move = trailing_zeros(moves)
        moves &= moves - 1
        down, right = _ROWS[move], _COLS[move]
        at, across, length, row, col = cell, by_column, 0, 0, 0
        while True:
            if move >= 4:
                at, across = at + down * stride + right, across + right * other + down
                length += DIAGONAL
                if at == goal:
                    count = _add(found, count, at, length, move)
            if right != 0:
                row = _run(rows, stride, at, goal, right > 0)
                if row > 0:
                    to = at + row * right
                    count = _add(found, count, to, length + row * STRAIGHT, 1 - right)
            if down != 0:
                col = _run(columns, other, across, goal_by_column, down > 0)
                if col > 0:
                    to = at + col * down * stride
                    count = _add(found, count, to, length + col * STRAIGHT, 2 - down)
            # The runs have already tested the two cells beside the next diagonal move.
            if move < 4 or row == -1 or col == -1 or _is_occupied(rows, at + down * stride + right):
                break
    return count


@inlined
def _column_index(other: int, stride: int, cell: int) -> int:
    """Return the bit index of a cell in the transposed bitmap."""
    return (cell % stride + 1 - MARGIN) * other + cell // stride + MARGIN - 1


@inlined
def _add(found: Shaped[Array, " most"], count: int, cell: int, length: int, move: int) -> int:
    """Append a jump point to ``found`` and return the new count."""
    found[count].cell, found[count].length, found[count].move = cell, length, move
    return count + 1


@inlined
def _is_occupied(rows: UInt64[Array, " bytes"], cell: int) -> bool:
    """Whether a cell is occupied or belongs to the border."""
    return bool(rows[uint64(cell >> 3)] >> np.uint64(cell & 7) & _ONE)


@inlined
def _run(bits: UInt64[Array, " bytes"], stride: int, at: int, goal: int, ahead: bool) -> int:
    """Return the number of cells to the goal or the next jump point along higher or lower bits.

    Negative, with the number of cells to the obstacle, if the run ends at one. A cell is a jump
    point if, in a row beside the run, the cell next to it is free and the previous cell is occupied
    (without cutting corners: Harabor & Grastien 2014, "Improving jump point search").
    """
    run, i, by_row, shift = 0, at >> 3, stride >> 3, np.uint64(at & 7)
    if ahead:
        while True:
            here, over, under = bits[uint64(i)], bits[uint64(i - by_row)], bits[uint64(i + by_row)]
            here, over, under = here >> shift, over >> shift, under >> shift
            ends = (here | over << _ONE & ~over | under << _ONE & ~under) & _AHEAD
            if ends != 0:
                break
            i, run = i + _BYTES, run + 8 * _BYTES
        first: int = int64(trailing_zeros(ends))
        to_goal, is_occupied = goal - at, here >> np.uint64(first) & _ONE
    else:
        i, shift = i - 7, np.uint64(7) - shift
        while True:
            here, over, under = bits[uint64(i)], bits[uint64(i - by_row)], bits[uint64(i + by_row)]
            here, over, under = here << shift, over << shift, under << shift
            ends = (here | over >> _ONE & ~over | under >> _ONE & ~under) & _BACK
            if ends != 0:
                break
            i, run = i - _BYTES, run + 8 * _BYTES
        first = int64(leading_zeros(ends))
        to_goal, is_occupied = at - goal, here << np.uint64(first) >> _LAST
    run += first
    if 0 < to_goal <= run:
        return to_goal
    return -run if is_occupied else run


@compiled
def _transpose(  # noqa: PLR0917
    words: UInt64[Array, " words"],
    width: int,
    rows: int,
    others: UInt64[Array, " words"],
    other: int,
    cols: int,
) -> None:
    """Transpose a bitmap, 64 x 64 bits at a time; ``width`` and ``other`` are in words per row."""
    block = np.empty((64, _BLOCKS), np.uint64)
    for j in range(0, width - 1, _BLOCKS):
        blocks = min(_BLOCKS, width - 1 - j)
        for i in range(0, rows, 64):
            block[:] = _ALL
            for k in range(min(64, rows - i)):
                begin = (i + k + 1) * width + 1 + j
                for m in range(blocks):
                    block[k, m] = words[begin + m]
            _transpose_blocks(block.ravel())
            for m in range(blocks):
                for k in range(min(64, cols - 64 * (j + m))):
                    others[(64 * (j + m) + k + 1) * other + 1 + (i >> 6)] = block[k, m]


@inlined
def _transpose_blocks(blocks: UInt64[Array, " words"]) -> None:
    """Transpose blocks of 64 x 64 bits (Warren, "Hacker's Delight", sec. 7-3)."""
    for size, group in _GROUPS:
        shift, words = np.uint64(size), size * _BLOCKS
        for i in range(0, 64 * _BLOCKS, 2 * words):
            one, other = blocks[i : i + words], blocks[i + words : i + 2 * words]
            for k in range(words):  # element by element: the compiler vectorises this loop
                exchanged = (one[k] >> shift ^ other[k]) & group
                other[k] ^= exchanged
                one[k] ^= exchanged << shift
