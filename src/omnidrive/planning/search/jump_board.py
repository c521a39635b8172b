"""Where moves along rows, columns and diagonals lead, many cells at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int64, UInt64

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.board import MARGIN, BitBoard
from omnidrive.planning.search.lengths import DIAGONAL, STRAIGHT
from omnidrive.planning.search.machine import int64, leading_zeros, trailing_zeros, uint64
from omnidrive.planning.search.moves import MOVES

_ONE, _ALL, _LAST = np.uint64(1), ~np.uint64(0), np.uint64(63)
_BYTES = 7  # 64 bits from the byte of a cell on hold at least this many bytes after the cell
_AHEAD = np.uint64(((1 << 8 * _BYTES) - 1) << 1)  # those after the first one
_BACK = np.uint64(((1 << 8 * _BYTES) - 1) << 63 - 8 * _BYTES)  # those before the last one
_BLOCKS = 8  # of 64 x 64 bits: a row of theirs is a cache line
_GROUPS = tuple(  # rows, and the lower of every two groups of as many bits
    (size, np.uint64(sum((1 << size) - 1 << at for at in range(0, 64, 2 * size))))
    for size in (32, 16, 8, 4, 2, 1)
)
_ROWS, _COLS = np.array(MOVES).T.copy()


class JumpBoard(NamedTuple):
    """The bits of a board row after row, and once more column after column.

    Attributes:
        rows: From every byte on, 64 bits; they overlap, and take no memory of their own.
        columns: The same of the board with its rows and columns exchanged.
        other: Bits from one column to the next.
    """

    rows: UInt64[Array, " bytes"]
    columns: UInt64[Array, " others"]
    other: int

    @classmethod
    def of(cls, board: BitBoard) -> JumpBoard:
        """The bits of a board, shared, and those of its columns."""
        rows, cols = board.shape
        turned = BitBoard.full(cols, rows)
        other = turned.stride
        _transpose(board.words, board.stride >> 6, rows, turned.words, other >> 6, cols)
        return cls(_windows(board.words), _windows(turned.words), other)


def _windows(words: UInt64[Array, " words"]) -> UInt64[Array, " bytes"]:
    """From every byte on, 64 bits of the same memory."""
    return np.ndarray((8 * len(words) - 7,), np.uint64, words, strides=(1,))


@compiled
def jumps(  # noqa: PLR0917
    board: JumpBoard,
    stride: int,
    cell: int,
    last: int,
    moves: int,
    found: Int64[Array, "most 3"],
) -> int:
    """Cells in which a turn may be needed, or the goal, that moves from a cell lead to first.

    Those beside a diagonal run are among them, but not the cells of the run itself.

    Args:
        board: The bits.
        stride: Of the board.
        cell: Number of the cell.
        last: Number of the goal.
        moves: Moves to try, as bits; diagonal ones must be allowed.
        found: Will hold the number of each cell, its distance, and the last move to it.

    Returns:
        How many were found.
    """
    rows, columns, other = board
    count, place = 0, _among_columns(other, stride, cell)
    goal = _among_columns(other, stride, last)
    while moves != 0:
        move = trailing_zeros(moves)
        moves &= moves - 1
        down, right = _ROWS[move], _COLS[move]
        at, across, length, row, col = cell, place, 0, 0, 0
        while True:
            if move >= 4:
                at, across = at + down * stride + right, across + right * other + down
                length += DIAGONAL
                if at == last:
                    count = _add(found, count, at, length, move)
            if right != 0:
                row = _run(rows, stride, at, last, right > 0)
                if row > 0:
                    to = at + row * right
                    count = _add(found, count, to, length + row * STRAIGHT, 1 - right)
            if down != 0:
                col = _run(columns, other, across, goal, down > 0)
                if col > 0:
                    to = at + col * down * stride
                    count = _add(found, count, to, length + col * STRAIGHT, 2 - down)
            # Beside the cell, the runs have seen whether the next diagonal move is allowed.
            if move < 4 or row == -1 or col == -1 or _is_taken(rows, at + down * stride + right):
                break
    return count


@inlined
def _among_columns(other: int, stride: int, cell: int) -> int:
    """Bit of a cell among the columns."""
    return (cell % stride + 1 - MARGIN) * other + cell // stride + MARGIN - 1


@inlined
def _add(found: Int64[Array, "most 3"], count: int, cell: int, length: int, move: int) -> int:
    """Put a cell to those that were found, and count it."""
    found[count, 0], found[count, 1], found[count, 2] = cell, length, move
    return count + 1


@inlined
def _is_taken(rows: UInt64[Array, " bytes"], cell: int) -> bool:
    """Whether a cell is occupied or border."""
    return bool(rows[uint64(cell >> 3)] >> np.uint64(cell & 7) & _ONE)


@inlined
def _run(bits: UInt64[Array, " bytes"], stride: int, at: int, last: int, ahead: bool) -> int:
    """Cells to where a move to higher or lower bits ends: the goal, or where a turn may be needed.

    If it ends at an obstacle, minus the cells to that. A turn may be needed beside a free cell that
    comes after an occupied one (without cutting corners: Harabor & Grastien 2014, "Improving jump
    point search").
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
        to_goal, is_taken = last - at, here >> np.uint64(first) & _ONE
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
        to_goal, is_taken = at - last, here << np.uint64(first) >> _LAST
    run += first
    if 0 < to_goal <= run:
        return to_goal
    return -run if is_taken else run


@compiled
def _transpose(  # noqa: PLR0917
    words: UInt64[Array, " words"],
    width: int,
    rows: int,
    others: UInt64[Array, " words"],
    other: int,
    cols: int,
) -> None:
    """Exchange the rows and columns of a board, 64 x 64 bits at a time; widths are in words."""
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
    """Exchange rows and columns of 64 x 64 bits (Warren, "Hacker's Delight", sec. 7-3)."""
    for size, group in _GROUPS:
        shift, words = np.uint64(size), size * _BLOCKS
        for i in range(0, 64 * _BLOCKS, 2 * words):
            one, other = blocks[i : i + words], blocks[i + words : i + 2 * words]
            for k in range(words):  # with plain places, several words at once
                exchanged = (one[k] >> shift ^ other[k]) & group
                other[k] ^= exchanged
                one[k] ^= exchanged << shift
