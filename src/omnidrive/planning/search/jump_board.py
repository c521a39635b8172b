"""Where moves along rows and columns have to end, as bits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int64, UInt8, UInt64

from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.board import MARGIN, BitBoard, is_occupied
from omnidrive.planning.search.lengths import DIAGONAL, STRAIGHT
from omnidrive.planning.search.machine import int64, trailing_zeros
from omnidrive.planning.search.moves import MOVES

Array = np.ndarray

_ONE, _ALL, _LAST = np.uint64(1), ~np.uint64(0), np.uint64(63)
_GROUPS = tuple(  # sizes, and the lower of every two groups
    (np.uint64(size), np.uint64(sum((1 << size) - 1 << at for at in range(0, 64, 2 * size))))
    for size in (32, 16, 8, 4, 2, 1)
)
_ROWS, _COLS = np.array(MOVES).T.copy()


class JumpBoard(NamedTuple):
    """Where moves along the rows and columns of a board end.

    Attributes:
        ends: For each of the four moves a board on which it leads from bit to bit: rows,
            columns, and both from their other ends. 1 where the move ends: in an occupied
            cell, or in a free one beside which an obstacle ends, so that a turn may be needed.
        places: For each of the four moves the bit of row 0 and column 0 of the board, border
            included, and how far it is to the next row's and to the next column's.
    """

    ends: UInt64[Array, " words"]
    places: Int64[Array, "4 3"]

    @classmethod
    def of(cls, board: BitBoard) -> JumpBoard:
        """Ends of moves over a board's cells."""
        rows, cols = board.shape
        turned = BitBoard.full(cols, rows)
        stride, other = board.stride, turned.stride
        _transpose(board.words, stride >> 6, rows, turned.words, other >> 6, cols)
        first = (1 - MARGIN) * other + MARGIN - 1  # of the border, on the board of the columns
        boards = [(board.words, stride, (0, stride, 1)), (turned.words, other, (first, 1, other))]
        boards += [
            (_mirrored(words), width, (64 * len(words) - 1 - zero, -by_row, -by_col))
            for words, width, (zero, by_row, by_col) in boards
        ]
        ends = np.empty(sum(len(words) for words, *_ in boards), np.uint64)
        places, begin = np.empty((4, 3), np.int64), 0
        for move, (words, width, place) in enumerate(boards):
            _fill_ends(words, width >> 6, ends[begin : begin + len(words)])
            places[move] = place
            places[move, 0] += 64 * begin
            begin += len(words)
        return cls(ends, places)


@compiled
def jumps(  # noqa: PLR0917
    ends: UInt64[Array, " words"],
    places: Int64[Array, "4 3"],
    bits: UInt8[Array, " bytes"],
    stride: int,
    cell: int,
    last: int,
    moves: int,
    found: Int64[Array, "most 3"],
) -> int:
    """Cells in which a turn may be needed, or the goal, that moves from a cell lead to first.

    Those beside a diagonal run are among them, but not the cells of the run itself.

    Args:
        ends: As in :class:`JumpBoard`.
        places: As in :class:`JumpBoard`.
        bits: Of the board.
        stride: Of the board.
        cell: Number of the cell.
        last: Number of the goal.
        moves: Moves to try, as bits.
        found: Will hold the number of each cell, its distance, and the last move to it.

    Returns:
        How many were found.
    """
    count, goal_row, goal_col = 0, last // stride, last % stride
    while moves != 0:
        move = trailing_zeros(moves)
        moves &= moves - 1
        down, right, along = _ROWS[move], _COLS[move], move
        at, row, col, length = cell, cell // stride, cell % stride, 0
        while True:
            if move >= 4:
                below = at + down * stride
                if (
                    is_occupied(bits, at + right)
                    or is_occupied(bits, below)
                    or is_occupied(bits, below + right)
                ):
                    break
                at, row, col, length = below + right, row + down, col + right, length + DIAGONAL
                if at == last:
                    found[count, 0], found[count, 1], found[count, 2] = at, length, move
                    count += 1
                along = 1 - right  # along the row
            for _ in range(1 if move < 4 else 2):
                origin, by_row, by_col = places[along]
                place = origin + row * by_row + col * by_col
                goal = origin + goal_row * by_row + goal_col * by_col
                word, shift = (place + 1) >> 6, np.uint64((place + 1) & 63)
                left = ends[word] & (_ALL << shift)
                while left == 0:
                    word += 1
                    left = ends[word]
                run = (word << 6 | int64(trailing_zeros(left))) - place
                meets = 0 < goal - place <= run
                run = goal - place if meets else run
                to = at + run * (_ROWS[along] * stride + _COLS[along])
                if meets or not is_occupied(bits, to):
                    found[count, 0], found[count, 1] = to, length + run * STRAIGHT
                    found[count, 2] = along
                    count += 1
                along = 2 - down  # along the column
            if move < 4:
                break
    return count


@compiled
def _mirrored(words: UInt64[Array, " words"]) -> UInt64[Array, " words"]:
    """The same bits in reversed order: halves of ever smaller groups of them change places."""
    mirrored = np.empty_like(words)
    for i in range(len(words)):
        word = words[i]
        for size, group in _GROUPS:
            word = (word >> size & group) | (word & group) << size
        mirrored[len(words) - 1 - i] = word
    return mirrored


@compiled
def _fill_ends(words: UInt64[Array, " words"], width: int, ends: UInt64[Array, " words"]) -> None:
    """Ends of moves from bit to bit; ``width`` is in words per row.

    A cell is one if it is occupied, or if beside it is a free cell that comes after an occupied
    one (without cutting corners: Harabor & Grastien 2014, "Improving jump point search").
    """
    ends[:] = _ALL
    count = len(words) - 2 * width - 1  # without the first word of a row, which is border
    here, out = words[width + 1 :], ends[width + 1 :]
    over, over_before = words[1:], words
    under, under_before = words[2 * width + 1 :], words[2 * width :]
    for i in range(count):  # with plain places, several words at once
        above = (over[i] << _ONE | over_before[i] >> _LAST) & ~over[i]
        below = (under[i] << _ONE | under_before[i] >> _LAST) & ~under[i]
        out[i] = here[i] | above | below


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
    block = np.empty(64, np.uint64)
    for i in range(0, rows, 64):
        for j in range(0, cols, 64):
            for k in range(64):
                block[k] = words[(i + k + 1) * width + 1 + (j >> 6)] if i + k < rows else _ALL
            _transpose_block(block)
            for k in range(min(64, cols - j)):
                others[(j + k + 1) * other + 1 + (i >> 6)] = block[k]


@inlined
def _transpose_block(block: UInt64[Array, " rows"]) -> None:
    """Exchange rows and columns of 64 x 64 bits (Warren, "Hacker's Delight", sec. 7-3)."""
    size, mask = 32, np.uint64(0xFFFFFFFF)
    while size > 0:
        shift, k = np.uint64(size), 0
        while k < 64:
            exchanged = (block[k] >> shift ^ block[k + size]) & mask
            block[k + size] ^= exchanged
            block[k] ^= exchanged << shift
            k = (k + size + 1) & ~size
        size >>= 1
        mask ^= mask << np.uint64(size)
