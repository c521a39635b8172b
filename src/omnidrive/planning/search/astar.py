"""A* with a bucket queue."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.bit_ops import int64, trailing_zeros
from omnidrive.planning.search.bit_tiles import Tiles, empty_tiles, tile_index
from omnidrive.planning.search.bitgrid import BitGrid
from omnidrive.planning.search.bucket_queue import (
    bucket_queue,
    enlarge,
    is_empty,
    is_full,
    pop,
    push,
)
from omnidrive.planning.search.heuristics import DIAGONAL, STRAIGHT, Heuristic, cost_to_go
from omnidrive.planning.search.moves import MOVES, START_MOVE, neighbourhood

BUCKET_SHIFT = 16
"""Number of low bits of a length that one bucket spans: 2^16 / STRAIGHT, about 0.14 cells."""
INFINITE = 1 << 62
"""Greater than the length of any path."""
MOVE_MASK = 15
"""Mask of the bits that hold the move by which a cell was reached, plus 1; 0 if unreached."""
CLOSED = 16
"""Flag of an expanded cell; the bits above it hold the length of the shortest known path."""
LENGTH_SHIFT = 5
"""Position of the lowest bit of the length."""
_CAPACITY = 1 << 12
STEPS = np.array([STRAIGHT] * 4 + [DIAGONAL] * 4)
ROWS, COLS = np.array(MOVES).T.copy()


def astar(
    bitgrid: BitGrid,
    start: int,
    goal: int,
    move_table: UInt8[Array, "10 512"],
    heuristic: Heuristic,
) -> tuple[Int32[Array, " cells"], int]:
    """Return the cells of a shortest path, empty if there is none, and the number of expansions.

    Hart, Nilsson & Raphael 1968, "A formal basis for the heuristic determination of minimum cost
    paths". A cell is expanded again when a shorter path to it is found, so the order of the cells
    within a bucket does not affect the length of the result.
    """
    words, expansions = explore(bitgrid, start, goal, move_table, heuristic)
    return reconstruct_path(words, bitgrid.stride, start, goal), expansions


def explore(
    bitgrid: BitGrid,
    start: int,
    goal: int,
    move_table: UInt8[Array, "10 512"],
    heuristic: Heuristic,
) -> tuple[Tiles, int]:
    """Return one word per cell, 0 if the cell was not reached, and the number of expansions.

    A 32-bit word holds the lowest 27 bits of a length, which span 285 cells. With a consistent
    heuristic these bits suffice to compare the lengths of two paths to one cell, and to recover a
    full length from the bucket of the cell: a cell is expanded when its length is minimal up to
    one bucket, and since its neighbours can be reached from it, no path over them is longer by
    more than one bucket and two moves.
    """
    words = empty_tiles(bitgrid, wide=not heuristic.is_consistent)
    # one move raises an estimate by its length and the rise of the heuristic
    queue = bucket_queue(4 * DIAGONAL >> BUCKET_SHIFT, _CAPACITY)
    expansions = _explore(
        bitgrid.bits, bitgrid.stride, start, goal, move_table, heuristic, words, *queue
    )
    return words, expansions


@compiled
def _explore(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    start: int,
    goal: int,
    move_table: UInt8[Array, "10 512"],
    heuristic: Heuristic,
    words: Tiles,
    queue: Int32[Array, " size"],
    ring: int,
) -> int:
    """Fill ``words`` and return the number of expansions."""
    goal_row, goal_col, row, col = goal // stride, goal % stride, start // stride, start % stride
    start_estimate = cost_to_go(heuristic, row - goal_row, col - goal_col)
    words[tile_index(stride, row, col)] = START_MOVE
    shift = _bit_length(stride)  # the queue holds row and column, separable without a division
    push(queue, ring, 0, row << shift | col)
    best, bucket, waiting, expansions, next_cell = 0 if start == goal else INFINITE, 0, 1, 0, 0
    while waiting > 0:
        cell, next_cell, waiting = next_cell, 0, waiting - 1
        if cell == 0:
            while is_empty(queue, ring, bucket):
                bucket += 1
            cell = pop(queue, ring, bucket)
        min_estimate = start_estimate + (bucket << BUCKET_SHIFT)
        if min_estimate >= best:
            break
        row, col = cell >> shift, cell & (1 << shift) - 1
        at = tile_index(stride, row, col)
        word = int64(words[at])
        estimate = cost_to_go(heuristic, row - goal_row, col - goal_col)
        so_far = _full_length(words, word, min_estimate - estimate)
        if word & CLOSED or so_far >= best:
            continue
        words[at], expansions = word | CLOSED, expansions + 1
        if is_full(queue, ring, waiting + 8):
            queue = enlarge(queue)
        around = neighbourhood(bits, stride, row * stride + col)
        moves = int64(move_table[word & MOVE_MASK, around])
        while moves != 0:
            move = trailing_zeros(moves)
            moves &= moves - 1
            down, right = row + ROWS[move], col + COLS[move]
            length, at = so_far + STEPS[move], tile_index(stride, down, right)
            if _is_no_improvement(words, at, length):
                continue
            estimate = length + cost_to_go(heuristic, down - goal_row, right - goal_col)
            if estimate >= best:
                continue
            words[at] = length << LENGTH_SHIFT | move + 1
            if down == goal_row and right == goal_col:
                best = length
                continue
            to, ahead = down << shift | right, (estimate - start_estimate) >> BUCKET_SHIFT
            waiting += 1
            if ahead <= bucket and next_cell == 0:
                next_cell = to
            else:
                push(queue, ring, max(bucket, ahead), to)
    return expansions


@inlined
def _is_no_improvement(words: Tiles, at: int, length: int) -> bool:
    """Whether the known path to a cell is at most as long as ``length``."""
    word = int64(words[at])
    return bool(word != 0 and _length_difference(words, length, word >> LENGTH_SHIFT) >= 0)


@inlined
def _full_length(words: Tiles, word: int, length: int) -> int:
    """Return the length closest to ``length`` whose low bits are those of ``word``."""
    return length + _length_difference(words, word >> LENGTH_SHIFT, length)


@inlined
def _length_difference(words: Tiles, one: int, other: int) -> int:
    """Return ``one`` - ``other``, of which only the bits stored in a word are known."""
    above = 64 - (8 * words.itemsize - LENGTH_SHIFT)
    difference: int = int64((one - other) << above) >> above
    return difference


@inlined
def _bit_length(number: int) -> int:
    """Return the number of bits needed for a non-negative number."""
    bits = 0
    while number >> bits:
        bits += 1
    return bits


@compiled
def reconstruct_path(words: Tiles, stride: int, start: int, goal: int) -> Int32[Array, " cells"]:
    """Return the cells from ``start`` to ``goal`` along the stored moves; empty if unreached."""
    count, cell = 0, goal
    while True:
        word = words[tile_index(stride, cell // stride, cell % stride)]
        if word == 0:
            break
        count += 1
        if cell == start:
            break
        move = int64(word & MOVE_MASK) - 1
        cell -= ROWS[move] * stride + COLS[move]
    path, cell = np.empty(count, np.int32), goal
    for i in range(count - 1, -1, -1):
        path[i] = cell
        if i > 0:
            move = int64(words[tile_index(stride, cell // stride, cell % stride)] & MOVE_MASK) - 1
            cell -= ROWS[move] * stride + COLS[move]
    return path
