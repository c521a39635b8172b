"""Jump-point search, many cells at a time."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, Int64, UInt8, UInt64

from omnidrive.compiled import compiled
from omnidrive.planning.search.astar import BUCKET, CLOSED, FAR
from omnidrive.planning.search.board import BitBoard
from omnidrive.planning.search.bucket_queue import (
    bucket_queue,
    enlarged,
    is_empty,
    is_full,
    pop,
    push,
)
from omnidrive.planning.search.jump_board import JumpBoard, jumps
from omnidrive.planning.search.lengths import DIAGONAL, STRAIGHT, Heuristic, to_go
from omnidrive.planning.search.moves import BEGIN, surroundings

Array = np.ndarray


def jump_point(
    board: BitBoard,
    jump_board: JumpBoard,
    first: int,
    last: int,
    needed: UInt8[Array, "10 512"],
    heuristic: Heuristic,
) -> tuple[Int32[Array, " cells"], int]:
    """Cells of a shortest way and how many were expanded; no cells if there is no way.

    Harabor & Grastien 2011 and 2014: A* over the cells in which a turn may be needed. Rows and
    columns are looked through 64 cells at a time, and the cells of a diagonal run are not put into
    the queue, only what they lead to.

    Args:
        board: The cells.
        jump_board: Where moves over them end.
        first: Number of the start.
        last: Number of the goal.
        needed: Moves among eight neighbours without cutting corners.
        heuristic: What is taken to be left to go.
    """
    came, lengths = np.zeros(board.size, np.uint8), np.empty(board.size, np.int64)
    parents = np.empty(board.size, np.int32)
    short, long = sorted(board.shape)
    found = np.empty((4 * (2 * short + 2), 3), np.int64)  # no more are found from one cell
    longest = 5 * (DIAGONAL * short + STRAIGHT * long) // 2  # a jump, and what it leaves more to go
    expansions = _reach(
        *jump_board, board.bits, board.stride, first, last, needed, heuristic, came, lengths,
        parents, found, *bucket_queue(longest >> BUCKET, len(found)),
    )  # fmt: skip
    return _walk_back(came, parents, board.stride, first, last), expansions


@compiled
def _reach(
    ends: UInt64[Array, " words"],
    places: Int64[Array, "4 3"],
    bits: UInt8[Array, " bytes"],
    stride: int,
    first: int,
    last: int,
    needed: UInt8[Array, "10 512"],
    heuristic: Heuristic,
    came: UInt8[Array, " numbers"],
    lengths: Int64[Array, " numbers"],
    parents: Int32[Array, " numbers"],
    found: Int64[Array, "most 3"],
    queue: Int32[Array, " size"],
    ring: int,
) -> int:
    """Fill ``came``, ``lengths`` and ``parents`` and count the expansions; see ``astar._reach``."""
    goal_row, goal_col = last // stride, last % stride
    floor = to_go(heuristic, first // stride - goal_row, first % stride - goal_col)
    came[first], lengths[first], parents[first] = BEGIN, 0, first
    push(queue, ring, 0, first)
    best, bucket, waiting, expansions = 0 if first == last else FAR, 0, 1, 0
    while waiting > 0:
        while is_empty(queue, ring, bucket):
            bucket += 1
        if floor + (bucket << BUCKET) >= best:
            break
        cell = pop(queue, ring, bucket)
        waiting -= 1
        way, so_far = np.int64(came[cell]), lengths[cell]
        if way & CLOSED or so_far >= best:
            continue
        came[cell] = way | CLOSED
        expansions += 1
        moves = np.int64(needed[way, surroundings(bits, stride, cell)])
        count = jumps(ends, places, bits, stride, cell, last, moves, found)
        if is_full(queue, ring, waiting + count):
            queue = enlarged(queue)
        for i in range(count):
            to, length, move = found[i, 0], so_far + found[i, 1], found[i, 2]
            if came[to] != 0 and length >= lengths[to]:
                continue
            row = np.int64(np.uint32(to) // np.uint32(stride))
            left = to_go(heuristic, row - goal_row, to - row * stride - goal_col)
            if length + left >= best:
                continue
            came[to], lengths[to], parents[to] = move + 1, length, cell
            if to == last:
                best = length
                continue
            push(queue, ring, max(bucket, (length + left - floor) >> BUCKET), to)
            waiting += 1
    return expansions


@compiled
def _walk_back(
    came: UInt8[Array, " numbers"],
    parents: Int32[Array, " numbers"],
    stride: int,
    first: int,
    last: int,
) -> Int32[Array, " cells"]:
    """Cells from ``first`` to ``last``; from a parent, a way is diagonal and then straight."""
    count, cell = 1 if came[last] != 0 else 0, last
    while count > 0 and cell != first:
        parent = np.int64(parents[cell])
        rows, cols = cell // stride - parent // stride, cell % stride - parent % stride
        count += max(abs(rows), abs(cols))
        cell = parent
    way, cell, at = np.empty(count, np.int32), last, count - 1
    while at > 0:
        parent = np.int64(parents[cell])
        rows, cols = cell // stride - parent // stride, cell % stride - parent % stride
        down, right = np.sign(rows) * stride, np.sign(cols)
        diagonal = min(abs(rows), abs(cols))
        for left in range(max(abs(rows), abs(cols)), 0, -1):
            way[at] = cell
            at -= 1
            if left <= diagonal:
                cell -= down + right
            else:
                cell -= down if abs(rows) > abs(cols) else right
    if count > 0:
        way[0] = first
    return way
