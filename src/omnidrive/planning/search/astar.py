"""A* with a bucket queue."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, Int64, UInt8

from omnidrive.compiled import compiled
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
from omnidrive.planning.search.machine import int64, trailing_zeros, uint32
from omnidrive.planning.search.moves import BEGIN, MOVES, surroundings

Array = np.ndarray

BUCKET = 16
"""Bits of a length within a bucket: one is 2^16 / STRAIGHT, about 0.14 cells."""
CLOSED = 128
"""Mark of a cell whose moves were tried."""
FAR = 1 << 62
"""More than any length."""
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
    came, expansions = reach(board, first, last, needed, heuristic)
    return walk_back(came, board.stride, first, last), expansions


def reach(
    board: BitBoard, first: int, last: int, needed: UInt8[Array, "10 512"], heuristic: Heuristic
) -> tuple[UInt8[Array, " numbers"], int]:
    """How every cell was reached, 0 if not, and how many were expanded."""
    # the system gives pages when they are first touched: a short way costs little on a large map
    came, lengths = np.zeros(board.size, np.uint8), np.empty(board.size, np.int64)
    queue = bucket_queue(4 * DIAGONAL >> BUCKET, _ROOM)  # a move, and what it leaves more to go
    expansions = _reach(
        board.bits, board.stride, first, last, needed, heuristic, came, lengths, *queue
    )
    return came, expansions


@compiled
def _reach(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    first: int,
    last: int,
    needed: UInt8[Array, "10 512"],
    heuristic: Heuristic,
    came: UInt8[Array, " numbers"],
    lengths: Int64[Array, " numbers"],
    queue: Int32[Array, " size"],
    ring: int,
) -> int:
    """Fill ``came`` and ``lengths`` (of the shortest way known) and count the expansions."""
    goal_row, goal_col = last // stride, last % stride
    floor = to_go(heuristic, first // stride - goal_row, first % stride - goal_col)
    came[first], lengths[first] = BEGIN, 0
    push(queue, ring, 0, first)
    best, bucket, waiting, expansions, held = 0 if first == last else FAR, 0, 1, 0, 0
    while waiting > 0 or held:
        if held:
            cell, held = held, 0
        else:
            while is_empty(queue, ring, bucket):
                bucket += 1
            cell = pop(queue, ring, bucket)
            waiting -= 1
        if floor + (bucket << BUCKET) >= best:
            break
        way, so_far = int64(came[cell]), lengths[cell]
        if way & CLOSED or so_far >= best:
            continue
        came[cell] = way | CLOSED
        expansions += 1
        if is_full(queue, ring, waiting + 8):
            queue = enlarged(queue)
        row = int64(uint32(cell) // uint32(stride))
        row, col = row - goal_row, cell - row * stride - goal_col
        moves = int64(needed[way, surroundings(bits, stride, cell)])
        while moves != 0:
            move = trailing_zeros(moves)
            moves &= moves - 1
            to = cell + _ROWS[move] * stride + _COLS[move]
            length = so_far + _STEPS[move]
            if came[to] != 0 and length >= lengths[to]:
                continue
            estimate = length + to_go(heuristic, row + _ROWS[move], col + _COLS[move])
            if estimate >= best:
                continue
            came[to], lengths[to] = move + 1, length
            if to == last:
                best = length
                continue
            at = (estimate - floor) >> BUCKET
            if at <= bucket and held == 0:
                held = to
                continue
            push(queue, ring, max(bucket, at), to)
            waiting += 1
    return expansions


@compiled
def walk_back(
    came: UInt8[Array, " numbers"], stride: int, first: int, last: int
) -> Int32[Array, " cells"]:
    """Cells from ``first`` to ``last`` by the moves that reached them; none if none did."""
    count, cell = 0, last
    while came[cell] != 0:
        count += 1
        if cell == first:
            break
        move = (came[cell] & (CLOSED - 1)) - 1
        cell -= _ROWS[move] * stride + _COLS[move]
    way, cell = np.empty(count, np.int32), last
    for i in range(count - 1, -1, -1):
        way[i] = cell
        if i > 0:
            move = (came[cell] & (CLOSED - 1)) - 1
            cell -= _ROWS[move] * stride + _COLS[move]
    return way
