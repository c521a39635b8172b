"""A* with a bucket queue."""

from __future__ import annotations

from typing import NamedTuple

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


class Progress(NamedTuple):
    """Progress of a search.

    Attributes:
        best: Cost of the best path so far.
        bucket: Bucket of the queue.
        waiting: Number of queued cells; 0: the search has ended.
        expansions: Number of expansions.
        next_cell: Cell to expand next; 0: from the queue.
        last: Number of expansions after which the search is interrupted.
    """

    best: int
    bucket: int
    waiting: int
    expansions: int
    next_cell: int
    last: int

    @classmethod
    def of(cls, ends: tuple[int, int]) -> Progress:
        """Return the progress of a search that begins, between two cells."""
        return cls(0 if ends[0] == ends[1] else INFINITE, 0, 1, 0, 0, 0)

    def until(self, most: int) -> Progress:
        """Return the progress of a search that may expand ``most`` more cells."""
        return self._replace(last=self.expansions + most)


class AStar:
    """Search of a shortest path by A* that can be interrupted, and continues where it was.

    Hart, Nilsson & Raphael 1968, "A formal basis for the heuristic determination of minimum cost
    paths". A cell is expanded again when a shorter path to it is found, so the order of the cells
    within a bucket does not affect the length of the result.

    One word is kept per cell, 0 if the cell was not reached. A 32-bit word holds the lowest 27 bits
    of a length, which span 285 cells. With a consistent heuristic these bits suffice to compare the
    lengths of two paths to one cell, and to recover a full length from the bucket of the cell: a
    cell is expanded when its length is minimal up to one bucket, and since its neighbours can be
    reached from it, no path over them is longer by more than one bucket and two moves.

    Args:
        bitgrid: The cells.
        start: Index of the start cell.
        goal: Index of the goal cell.
        move_table: Allowed moves by the last move and the neighbourhood.
        heuristic: Estimate of the remaining length.
    """

    def __init__(
        self,
        bitgrid: BitGrid,
        start: int,
        goal: int,
        move_table: UInt8[Array, "10 512"],
        heuristic: Heuristic,
    ) -> None:
        words = empty_tiles(bitgrid, wide=not heuristic.is_consistent)
        stride, ends = bitgrid.stride, (start, goal)
        words[tile_index(stride, *divmod(start, stride))] = START_MOVE
        self._problem = bitgrid.bits, stride, ends, move_table, heuristic, words
        # one move raises an estimate by its length and the rise of the heuristic
        self._queue, self._ring = bucket_queue(
            4 * DIAGONAL >> BUCKET_SHIFT, _CAPACITY, _packed(stride, start)
        )
        self.progress = Progress.of(ends)

    def explore(self, most: int) -> bool:
        """Expand up to ``most`` cells; return whether the search has ended."""
        self._queue, self.progress = _explore(
            *self._problem, self._queue, self._ring, self.progress.until(most)
        )
        return self.progress.waiting == 0

    def path(self) -> Int32[Array, " cells"]:
        """Return the cells of the best path so far, empty if there is none."""
        _, stride, ends, _, _, words = self._problem
        return reconstruct_path(words, stride, *ends)

    @property
    def lower_bound(self) -> float:
        """Length that no path falls below, in cell widths, if the heuristic is consistent."""
        _, stride, (start, goal), _, heuristic, _ = self._problem
        rows, cols = start // stride - goal // stride, start % stride - goal % stride
        estimate = cost_to_go(heuristic, rows, cols)
        return (estimate + (self.progress.bucket << BUCKET_SHIFT)) / STRAIGHT


@compiled
def _explore(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    ends: tuple[int, int],
    move_table: UInt8[Array, "10 512"],
    heuristic: Heuristic,
    words: Tiles,
    queue: Int32[Array, " size"],
    ring: int,
    progress: Progress,
) -> tuple[Int32[Array, " more"], Progress]:
    """Fill ``words``; return queue and progress at the interruption or the end."""
    start, goal = ends
    goal_row, goal_col, row, col = goal // stride, goal % stride, start // stride, start % stride
    start_estimate = cost_to_go(heuristic, row - goal_row, col - goal_col)
    shift = _bit_length(stride)
    best, bucket, waiting, expansions, next_cell, last = progress
    while waiting > 0 and expansions < last:
        cell, next_cell, waiting = next_cell, 0, waiting - 1
        if cell == 0:
            while is_empty(queue, ring, bucket):
                bucket += 1
            cell = pop(queue, ring, bucket)
        min_estimate = start_estimate + (bucket << BUCKET_SHIFT)
        if min_estimate >= best:
            waiting = 0
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
    return queue, Progress(best, bucket, waiting, expansions, next_cell, last)


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


def _packed(stride: int, cell: int) -> int:
    """Return row and column of a cell as the queue holds them: separable without a division."""
    row, col = divmod(cell, stride)
    return row << stride.bit_length() | col


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
