"""Lazy Theta*: any-angle search."""

from __future__ import annotations

from math import hypot

import numpy as np
from jaxtyping import Float64, Int32, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.board import BitBoard, is_occupied
from omnidrive.planning.search.bucket_queue import (
    bucket_queue,
    enlarged,
    is_empty,
    is_full,
    pop,
    push,
)
from omnidrive.planning.search.lengths import STRAIGHT, Heuristic, to_go
from omnidrive.planning.search.machine import int64
from omnidrive.planning.search.moves import BEGIN, MOVES, surroundings

_ROWS, _COLS = np.array(MOVES).T.copy()
_WAITING, _CLOSED = 1, 2
_ROOM = 1 << 12
_BUCKETS = 4.0  # per cell of length
_FARTHEST = 8.0  # cells of length that a way can be ahead of the least: twice a move and its repair


def lazy_theta(
    board: BitBoard, first: int, last: int, needed: UInt8[Array, "10 512"], heuristic: Heuristic
) -> tuple[Int32[Array, " cells"], int]:
    """Turning points of a way and how many cells were expanded; none if there is no way.

    Nash, Koenig & Tovey 2010, "Lazy Theta*: any-angle path planning and path length analysis in
    3D": a cell is first taken to be seen from the cell that its neighbour was reached from, and
    this is checked when it is expanded. Short, but not the shortest of all ways.
    """
    parents, state = np.zeros(board.size, np.int32), np.zeros(board.size, np.uint8)
    lengths = np.empty(board.size)
    expansions = _reach(
        board.bits, board.stride, first, last, needed[BEGIN], heuristic, parents, state,
        lengths, *bucket_queue(int(_BUCKETS * _FARTHEST), _ROOM),
    )  # fmt: skip
    way = [last] if state[last] else []
    while way and way[-1] != first:
        way.append(int(parents[way[-1]]))
    return np.array(way[::-1], np.int32), expansions


@compiled
def _reach(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    first: int,
    last: int,
    allowed: UInt8[Array, " surroundings"],
    heuristic: Heuristic,
    parents: Int32[Array, " numbers"],
    state: UInt8[Array, " numbers"],
    lengths: Float64[Array, " numbers"],
    queue: Int32[Array, " size"],
    ring: int,
) -> int:
    """Fill ``parents``, ``state`` and ``lengths`` (in cells) and count the expansions."""
    floor = _left(heuristic, stride, first, last)
    parents[first], lengths[first], state[first] = first, 0.0, _WAITING
    push(queue, ring, 0, first)
    bucket, waiting, expansions = 0, 1, 0
    while waiting > 0:
        while is_empty(queue, ring, bucket):
            bucket += 1
        cell = pop(queue, ring, bucket)
        waiting -= 1
        if state[cell] == _CLOSED:
            continue
        moves = allowed[surroundings(bits, stride, cell)]
        if not sees(bits, stride, int64(parents[cell]), cell):
            _repair(stride, cell, moves, parents, state, lengths)
        state[cell] = _CLOSED
        if cell == last:
            break
        expansions += 1
        if is_full(queue, ring, waiting + 8):
            queue = enlarged(queue)
        parent = int64(parents[cell])
        for move in range(8):
            to = cell + _ROWS[move] * stride + _COLS[move]
            if moves >> move & 1 == 0 or state[to] == _CLOSED:
                continue
            length = lengths[parent] + _distance(stride, parent, to)
            if state[to] == 0 or length < lengths[to]:
                parents[to], lengths[to], state[to] = parent, length, _WAITING
                ahead = int(_BUCKETS * (length + _left(heuristic, stride, to, last) - floor))
                push(queue, ring, max(bucket, ahead), to)
                waiting += 1
    return expansions


@compiled
def _repair(  # noqa: PLR0917
    stride: int,
    cell: int,
    moves: int,
    parents: Int32[Array, " numbers"],
    state: UInt8[Array, " numbers"],
    lengths: Float64[Array, " numbers"],
) -> None:
    """Reach ``cell`` from the best of its closed neighbours instead; there is one."""
    lengths[cell] = np.inf
    for move in range(8):
        by = cell + _ROWS[move] * stride + _COLS[move]
        if moves >> move & 1 and state[by] == _CLOSED:
            length = lengths[by] + _distance(stride, by, cell)
            if length < lengths[cell]:
                parents[cell], lengths[cell] = by, length


@inlined
def _distance(stride: int, one: int, other: int) -> float:
    """Distance of two cells' centres, in cells."""
    return hypot(float(one // stride - other // stride), float(one % stride - other % stride))


@inlined
def _left(heuristic: Heuristic, stride: int, cell: int, last: int) -> float:
    """The heuristic, in cells."""
    rows, cols = last // stride - cell // stride, last % stride - cell % stride
    return to_go(heuristic, rows, cols) / STRAIGHT


@compiled
def sees(bits: UInt8[Array, " bytes"], stride: int, one: int, other: int) -> bool:
    """Whether the line between two cells' centres touches no occupied cell, not even its corner.

    From cell to cell along the line, in whole numbers (Amanatides & Woo 1987).
    """
    rows, cols = other // stride - one // stride, other % stride - one % stride
    down, right = stride if rows > 0 else -stride, 1 if cols > 0 else -1
    rows, cols = abs(rows), abs(cols)
    cell, left, ahead = one, rows + cols, cols - rows
    while left > 0:
        if ahead == 0:  # through the corner of four cells
            if is_occupied(bits, cell + right) or is_occupied(bits, cell + down):
                return False
            cell += right + down
            ahead += 2 * (cols - rows)
            left -= 2
        elif ahead > 0:
            cell += right
            ahead -= 2 * rows
            left -= 1
        else:
            cell += down
            ahead += 2 * cols
            left -= 1
        if is_occupied(bits, cell):
            return False
    return True
