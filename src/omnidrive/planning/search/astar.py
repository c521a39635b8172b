"""A* with a bucket queue."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.board import BitBoard
from omnidrive.planning.search.bucket_queue import (
    bucket_queue,
    enlarged,
    is_empty,
    is_full,
    pop,
    push,
)
from omnidrive.planning.search.lengths import DIAGONAL, STRAIGHT, Heuristic, to_go
from omnidrive.planning.search.machine import int64, trailing_zeros
from omnidrive.planning.search.moves import BEGIN, MOVES, surroundings
from omnidrive.planning.search.tiles import Tiles, empty_tiles, place

BUCKET = 16
"""Bits of a length within a bucket: one is 2^16 / STRAIGHT, about 0.14 cells."""
FAR = 1 << 62
"""More than any length."""
_WAY = 15
"""Bits of a cell's word that say how it was reached; 0 if it was not."""
_CLOSED = 16
"""Mark of a cell whose moves were tried; above it stands the length of the shortest way known."""
_LENGTH = 5
"""Where the length begins."""
_ROOM = 1 << 12
_STEPS = np.array([STRAIGHT] * 4 + [DIAGONAL] * 4)
_ROWS, _COLS = np.array(MOVES).T.copy()


def astar(
    board: BitBoard, first: int, last: int, needed: UInt8[Array, "10 512"], heuristic: Heuristic
) -> tuple[Int32[Array, " cells"], int]:
    """Cells of a shortest way and how many were expanded; no cells if there is no way.

    Hart, Nilsson & Raphael 1968; a cell is expanded again if a shorter way to it turns up, so
    that the order within a bucket does not matter.
    """
    words, expansions = reach(board, first, last, needed, heuristic)
    return walk_back(words, board.stride, first, last), expansions


def reach(
    board: BitBoard, first: int, last: int, needed: UInt8[Array, "10 512"], heuristic: Heuristic
) -> tuple[Tiles, int]:
    """A word for every cell, 0 if it was not reached, and how many were expanded.

    Words of 32 bits have the lowest 27 of a length, 285 cells. That is enough to compare the
    lengths of two ways to a cell, and to tell one from the bucket that its cell waits in, if the
    heuristic is consistent: then a cell is expanded when its length is the least but for a bucket,
    and as its neighbours can be reached from it, no way over them is worse by more than a bucket
    and two moves.
    """
    words = empty_tiles(board, wide=not heuristic.is_consistent)
    queue = bucket_queue(4 * DIAGONAL >> BUCKET, _ROOM)  # a move, and what it leaves more to go
    expansions = _reach(board.bits, board.stride, first, last, needed, heuristic, words, *queue)
    return words, expansions


@compiled
def _reach(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    first: int,
    last: int,
    needed: UInt8[Array, "10 512"],
    heuristic: Heuristic,
    words: Tiles,
    queue: Int32[Array, " size"],
    ring: int,
) -> int:
    """Fill ``words`` and count the expansions."""
    goal_row, goal_col = last // stride, last % stride
    row, col = first // stride, first % stride
    floor = to_go(heuristic, row - goal_row, col - goal_col)
    words[place(stride, row, col)] = BEGIN
    shift = _bits(stride)  # the queue holds rows and columns, which are sooner taken apart
    push(queue, ring, 0, row << shift | col)
    best, bucket, waiting, expansions, held = 0 if first == last else FAR, 0, 1, 0, 0
    while waiting > 0:
        cell, held, waiting = held, 0, waiting - 1
        if cell == 0:
            while is_empty(queue, ring, bucket):
                bucket += 1
            cell = pop(queue, ring, bucket)
        least = floor + (bucket << BUCKET)
        if least >= best:
            break
        row, col = cell >> shift, cell & (1 << shift) - 1
        at = place(stride, row, col)
        word = int64(words[at])
        so_far = _near(words, word, least - to_go(heuristic, row - goal_row, col - goal_col))
        if word & _CLOSED or so_far >= best:
            continue
        words[at], expansions = word | _CLOSED, expansions + 1
        if is_full(queue, ring, waiting + 8):
            queue = enlarged(queue)
        moves = int64(needed[word & _WAY, surroundings(bits, stride, row * stride + col)])
        while moves != 0:
            move = trailing_zeros(moves)
            moves &= moves - 1
            down, right = row + _ROWS[move], col + _COLS[move]
            length, at = so_far + _STEPS[move], place(stride, down, right)
            if _is_known(words, at, length):
                continue
            estimate = length + to_go(heuristic, down - goal_row, right - goal_col)
            if estimate >= best:
                continue
            words[at] = length << _LENGTH | move + 1
            if down == goal_row and right == goal_col:
                best = length
                continue
            to, ahead, waiting = down << shift | right, (estimate - floor) >> BUCKET, waiting + 1
            if ahead <= bucket and held == 0:
                held = to
            else:
                push(queue, ring, max(bucket, ahead), to)
    return expansions


@inlined
def _is_known(words: Tiles, at: int, length: int) -> bool:
    """Whether a way to a cell is known that is no longer."""
    word = int64(words[at])
    return bool(word != 0 and _longer(words, length, word >> _LENGTH) >= 0)


@inlined
def _near(words: Tiles, word: int, length: int) -> int:
    """The length nearest to one of which a word has the bits."""
    return length + _longer(words, word >> _LENGTH, length)


@inlined
def _longer(words: Tiles, one: int, other: int) -> int:
    """By how much one length is longer than another, of which a word's bits are known."""
    above = 64 - (8 * words.itemsize - _LENGTH)
    longer: int = int64((one - other) << above) >> above
    return longer


@inlined
def _bits(number: int) -> int:
    """Bits of a number."""
    bits = 0
    while number >> bits:
        bits += 1
    return bits


@compiled
def walk_back(words: Tiles, stride: int, first: int, last: int) -> Int32[Array, " cells"]:
    """Cells from ``first`` to ``last`` by the moves that reached them; none if none did."""
    count, cell = 0, last
    while True:
        word = words[place(stride, cell // stride, cell % stride)]
        if word == 0:
            break
        count += 1
        if cell == first:
            break
        move = int64(word & _WAY) - 1
        cell -= _ROWS[move] * stride + _COLS[move]
    way, cell = np.empty(count, np.int32), last
    for i in range(count - 1, -1, -1):
        way[i] = cell
        if i > 0:
            move = int64(words[place(stride, cell // stride, cell % stride)] & _WAY) - 1
            cell -= _ROWS[move] * stride + _COLS[move]
    return way
