"""Kernels of the search over cells and headings.

A pose is 72 cell + heading, where the cell is the index of its bit in a layer: the headings of a
cell lie next to each other, so that a search touches little memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int32, Int64, UInt8, UInt64

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.footprint.layers import HEADINGS, is_set
from omnidrive.planning.search.astar import (
    BUCKET_SHIFT,
    CLOSED,
    INFINITE,
    LENGTH_SHIFT,
    MOVE_MASK,
    STEPS,
)
from omnidrive.planning.search.bit_ops import int64, trailing_zeros
from omnidrive.planning.search.bucket_queue import enlarge, is_empty, is_full, pop, push
from omnidrive.planning.search.heuristics import DIAGONAL
from omnidrive.planning.search.moves import MOVES, START_MOVE, neighbourhood

TURN_LEFT, TURN_RIGHT = START_MOVE + 1, START_MOVE + 2
"""Codes of the turns to the next and to the previous heading."""
_MAX_BUCKETS, _CAPACITY = 1 << 16, 1 << 14
_ROWS, _COLS = np.array(MOVES).T.copy()
_LAYERS = np.array([0, 1, 0, 1, 2, 3, 3, 2])  # of the shared moves, by move
_REVERSED = np.array([0, 0, 1, 1, 0, 0, 1, 1])  # whether the bit is that of the target


class Ends(NamedTuple):
    """Poses at which a search may start or end, and the lengths of the ways to or from them."""

    poses: Int64[Array, " poses"]
    lengths: Int64[Array, " poses"]


class PoseSpace(NamedTuple):
    """Poses and moves of a search.

    Attributes:
        poses: Bitmap of the poses at which the polygon collides, by heading.
        turns: Bitmap of the cells at which the turn to the next heading collides, by heading.
        stride: Number of bits per row.
        turn: Length of a turn to an adjacent heading.
        move_table: Moves to try, see :func:`~omnidrive.planning.search.moves.pruned_moves`.
    """

    poses: UInt64[Array, "headings words"]
    turns: UInt64[Array, "headings words"]
    stride: int
    turn: int
    move_table: UInt8[Array, "10 512"]


class Bounds(NamedTuple):
    """Lower bounds on the length to the goals: the sum over the cell and over the heading."""

    cells: Int64[Array, " cells"]
    headings: Int64[Array, " headings"]


@compiled
def distances_to_go(
    moves: UInt64[Array, "4 words"], stride: int, goals: Ends, starts: Ends, slack: int
) -> tuple[Int64[Array, " cells"], bool]:
    """Return lower bounds on the length from every cell to the goals, and whether a path can exist.

    Dijkstra's algorithm from the goals over the moves that are free at one heading or more. It ends
    when the length exceeds that from the last start by ``slack``; all other cells have the length
    reached then, so that the bounds are consistent.
    """
    size = 64 * moves.shape[1]
    lengths, missing = np.full(size, INFINITE), np.zeros(size, np.bool_)
    missing[starts.poses // HEADINGS] = True
    left, reached = missing.sum(), False
    queue, ring, waiting = _new_queue(goals.lengths, 2 * DIAGONAL)
    for i in range(len(goals.poses)):
        cell, length = goals.poses[i] // HEADINGS, goals.lengths[i]
        if length < lengths[cell]:
            lengths[cell], waiting = length, waiting + 1
            push(queue, ring, length >> BUCKET_SHIFT, cell)
    bucket, end = 0, INFINITE
    while waiting > 0:
        while is_empty(queue, ring, bucket):
            bucket += 1
        if bucket << BUCKET_SHIFT > end:
            break
        cell = pop(queue, ring, bucket)
        waiting -= 1
        if lengths[cell] >> BUCKET_SHIFT < bucket:
            continue  # it was in an earlier bucket as well
        if is_full(queue, ring, waiting + 8):
            queue = enlarge(queue)
        for move in range(8):
            to = cell + _ROWS[move] * stride + _COLS[move]
            length = lengths[cell] + STEPS[move]
            if length < lengths[to] and is_set(
                moves[_LAYERS[move]], to if _REVERSED[move] else cell
            ):
                lengths[to], waiting = length, waiting + 1
                push(queue, ring, length >> BUCKET_SHIFT, to)
        if missing[cell]:
            missing[cell], reached, left = False, True, left - 1
            end = lengths[cell] + slack if left == 0 else end
    return np.minimum(lengths, bucket << BUCKET_SHIFT) if waiting > 0 else lengths, reached


@compiled
def _new_queue(
    lengths: Int64[Array, " ends"], longest: int
) -> tuple[Int32[Array, " size"], int, int]:
    """Return an empty queue, its last bucket and the number of waiting poses, 0.

    Args:
        lengths: Lengths of the ends from which the search starts.
        longest: Greatest rise of an estimate by a move.
    """
    spread = (max(longest, lengths.max() - lengths.min()) >> BUCKET_SHIFT) + 1
    last = 1
    while last <= spread and last < _MAX_BUCKETS:
        last *= 2
    last -= 1
    queue = np.zeros(last + 2 + 2 * (_CAPACITY + len(lengths)), np.int32)
    queue[last + 1] = last + 2
    return queue, last, 0


class PoseProgress(NamedTuple):
    """Progress of a search over poses.

    Attributes:
        best: Length of the best path so far.
        found: Goal of this path; -1: there is none.
        base: Lower bound on the length of all paths at the beginning.
        bucket: Bucket of the queue.
        waiting: Number of queued poses; 0: the search has ended.
        expansions: Number of expansions.
    """

    best: int
    found: int
    base: int
    bucket: int
    waiting: int
    expansions: int


@compiled
def begin(
    space: PoseSpace, starts: Ends, bounds: Bounds, words: Int64[Array, " poses"]
) -> tuple[Int32[Array, " size"], int, PoseProgress]:
    """Return the queue of a search that begins, its last bucket, and the progress."""
    estimates = _estimates(starts, bounds)
    base = estimates.min()
    queue, ring, waiting = _new_queue(estimates, max(2 * DIAGONAL, 2 * space.turn))
    for i in range(len(estimates)):
        words[starts.poses[i]] = starts.lengths[i] << LENGTH_SHIFT | START_MOVE
        push(queue, ring, (estimates[i] - base) >> BUCKET_SHIFT, starts.poses[i])
        waiting += 1
    return queue, ring, PoseProgress(INFINITE, -1, base, 0, waiting, 0)


@compiled
def explore(  # noqa: PLR0917
    space: PoseSpace,
    goals: Ends,
    bounds: Bounds,
    words: Int64[Array, " poses"],
    queue: Int32[Array, " size"],
    ring: int,
    progress: PoseProgress,
    most: int,
) -> tuple[Int32[Array, " more"], PoseProgress]:
    """Fill ``words`` with up to ``most`` expansions; return queue and progress after them.

    A* (Hart, Nilsson & Raphael 1968). A word holds the length of the shortest known path to a pose,
    a flag of an expanded pose, and the code of the last move; it is 0 if the pose was not reached.
    """
    best, found, base, bucket, waiting, expansions = progress
    last = expansions + most
    while waiting > 0 and expansions < last:
        while is_empty(queue, ring, bucket):
            bucket += 1
        if base + (bucket << BUCKET_SHIFT) >= best:
            waiting = 0
            break
        at = pop(queue, ring, bucket)
        waiting -= 1
        word = words[at]
        if word & CLOSED:
            continue
        words[at], expansions = word | CLOSED, expansions + 1
        to_end = _length_to_end(goals, bounds.cells[at // HEADINGS], at)
        if (word >> LENGTH_SHIFT) + to_end < best:
            best, found = (word >> LENGTH_SHIFT) + to_end, at
        if is_full(queue, ring, waiting + 16):
            queue = enlarge(queue)
        moves = _moves_from(space, at % HEADINGS, at // HEADINGS, word & MOVE_MASK)
        while moves != 0:
            move = trailing_zeros(moves)
            moves &= moves - 1
            to = _after(at, move, space.stride)
            length = (word >> LENGTH_SHIFT) + (STEPS[move] if move < 8 else space.turn)
            known, estimate = words[to], _estimate(bounds, to, length)
            if (known == 0 or known >> LENGTH_SHIFT > length) and estimate < best:
                words[to] = length << LENGTH_SHIFT | (move + 1)
                push(queue, ring, max(bucket, (estimate - base) >> BUCKET_SHIFT), to)
                waiting += 1
    return queue, PoseProgress(best, found, base, bucket, waiting, expansions)


@inlined
def _estimate(bounds: Bounds, at: int, length: int) -> int:
    """Return a lower bound on the length of paths that reach a pose with ``length``."""
    cell = at // HEADINGS
    estimate: int = length + bounds.cells[cell] + bounds.headings[at - HEADINGS * cell]
    return estimate


@compiled
def _estimates(starts: Ends, bounds: Bounds) -> Int64[Array, " starts"]:
    """Return the estimate of every start."""
    estimates = np.empty(len(starts.poses), np.int64)
    for i in range(len(estimates)):
        estimates[i] = _estimate(bounds, starts.poses[i], starts.lengths[i])
    return estimates


@inlined
def _length_to_end(goals: Ends, bound: int, at: int) -> int:
    """Return the length from a pose to the end of the path; INFINITE if it is no goal.

    Args:
        goals: The goals.
        bound: Lower bound at the cell of the pose, at most the length at a goal.
        at: The pose.
    """
    if bound > goals.lengths.max():
        return INFINITE
    nearest = INFINITE
    for i in range(len(goals.poses)):
        if goals.poses[i] == at:
            nearest = min(nearest, goals.lengths[i])
    return nearest


@inlined
def _moves_from(space: PoseSpace, heading: int, cell: int, code: int) -> int:
    """Return the moves to try from a pose, as bits; those above bit 7 are turns."""
    around = neighbourhood(space.poses[heading].view(np.uint8), space.stride, cell)
    moves: int = int64(space.move_table[min(code, START_MOVE), around])
    before = heading - 1 if heading > 0 else HEADINGS - 1
    if code != TURN_RIGHT and not is_set(space.turns[heading], cell):
        moves |= 1 << (TURN_LEFT - 1)
    if code != TURN_LEFT and not is_set(space.turns[before], cell):
        moves |= 1 << (TURN_RIGHT - 1)
    return moves


@inlined
def _after(at: int, move: int, stride: int) -> int:
    """Return the pose after a move."""
    if move == TURN_LEFT - 1:
        return at + 1 if at % HEADINGS < HEADINGS - 1 else at - (HEADINGS - 1)
    if move == TURN_RIGHT - 1:
        return at - 1 if at % HEADINGS > 0 else at + (HEADINGS - 1)
    to: int = at + HEADINGS * (_ROWS[move] * stride + _COLS[move])
    return to


@inlined
def _previous(at: int, code: int, stride: int) -> int:
    """Return the pose before a move, given by its code, that leads to ``at``."""
    if code > START_MOVE:
        return _after(at, TURN_LEFT + TURN_RIGHT - code - 1, stride)
    before: int = at - HEADINGS * (_ROWS[code - 1] * stride + _COLS[code - 1])
    return before


@compiled
def trace(words: Int64[Array, " poses"], stride: int, goal: int) -> Int64[Array, " path"]:
    """Return the poses from a start to ``goal`` along the stored moves."""
    count, at = 1, goal
    while words[at] & MOVE_MASK != START_MOVE:
        at = _previous(at, words[at] & MOVE_MASK, stride)
        count += 1
    path, at = np.empty(count, np.int64), goal
    for i in range(count - 1, -1, -1):
        path[i] = at
        if i > 0:
            at = _previous(at, words[at] & MOVE_MASK, stride)
    return path
