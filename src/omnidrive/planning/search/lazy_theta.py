"""Lazy Theta*: any-angle search."""

from __future__ import annotations

from math import hypot

import numpy as np
from jaxtyping import Float64, Int32, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.bit_ops import int64
from omnidrive.planning.search.bitgrid import BitGrid, is_occupied
from omnidrive.planning.search.bucket_queue import (
    bucket_queue,
    enlarge,
    is_empty,
    is_full,
    pop,
    push,
)
from omnidrive.planning.search.heuristics import STRAIGHT, Heuristic, cost_to_go
from omnidrive.planning.search.moves import MOVES, START_MOVE, neighbourhood

_ROWS, _COLS = np.array(MOVES).T.copy()
_WAITING, _CLOSED = 1, 2
_CAPACITY = 1 << 12
_BUCKETS = 4.0  # per cell of length
_FARTHEST = 8.0  # cells by which a length can exceed the minimum: twice a move and its repair


def lazy_theta(
    bitgrid: BitGrid,
    start: int,
    goal: int,
    move_table: UInt8[Array, "10 512"],
    heuristic: Heuristic,
) -> tuple[Int32[Array, " cells"], int]:
    """Return the turning points of a path, empty if there is none, and the number of expansions.

    Nash, Koenig & Tovey 2010, "Lazy Theta*: any-angle path planning and path length analysis in
    3D". A cell is assumed to have a line of sight to the parent of its neighbour; the line of sight
    is checked when the cell is expanded. The path is short, but in general not the shortest.
    """
    parents, state = np.zeros(bitgrid.size, np.int32), np.zeros(bitgrid.size, np.uint8)
    lengths = np.empty(bitgrid.size)
    expansions = _explore(
        bitgrid.bits, bitgrid.stride, start, goal, move_table[START_MOVE], heuristic, parents,
        state, lengths, *bucket_queue(int(_BUCKETS * _FARTHEST), _CAPACITY),
    )  # fmt: skip
    path = [goal] if state[goal] else []
    while path and path[-1] != start:
        path.append(int(parents[path[-1]]))
    return np.array(path[::-1], np.int32), expansions


@compiled
def _explore(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    start: int,
    goal: int,
    allowed: UInt8[Array, " neighbourhoods"],
    heuristic: Heuristic,
    parents: Int32[Array, " cells"],
    state: UInt8[Array, " cells"],
    lengths: Float64[Array, " cells"],
    queue: Int32[Array, " size"],
    ring: int,
) -> int:
    """Fill ``parents``, ``state`` and ``lengths`` (cells); return the number of expansions."""
    start_estimate = _cost_to_go(heuristic, stride, start, goal)
    parents[start], lengths[start], state[start] = start, 0.0, _WAITING
    push(queue, ring, 0, start)
    bucket, waiting, expansions = 0, 1, 0
    while waiting > 0:
        while is_empty(queue, ring, bucket):
            bucket += 1
        cell = pop(queue, ring, bucket)
        waiting -= 1
        if state[cell] == _CLOSED:
            continue
        moves = allowed[neighbourhood(bits, stride, cell)]
        if not has_line_of_sight(bits, stride, int64(parents[cell]), cell):
            _repair(stride, cell, moves, parents, state, lengths)
        state[cell] = _CLOSED
        if cell == goal:
            break
        expansions += 1
        if is_full(queue, ring, waiting + 8):
            queue = enlarge(queue)
        parent = int64(parents[cell])
        for move in range(8):
            to = cell + _ROWS[move] * stride + _COLS[move]
            if moves >> move & 1 == 0 or state[to] == _CLOSED:
                continue
            length = lengths[parent] + _distance(stride, parent, to)
            if state[to] == 0 or length < lengths[to]:
                parents[to], lengths[to], state[to] = parent, length, _WAITING
                ahead = int(
                    _BUCKETS * (length + _cost_to_go(heuristic, stride, to, goal) - start_estimate)
                )
                push(queue, ring, max(bucket, ahead), to)
                waiting += 1
    return expansions


@compiled
def _repair(  # noqa: PLR0917
    stride: int,
    cell: int,
    moves: int,
    parents: Int32[Array, " cells"],
    state: UInt8[Array, " cells"],
    lengths: Float64[Array, " cells"],
) -> None:
    """Make the best closed neighbour the parent of ``cell``; there is at least one."""
    lengths[cell] = np.inf
    for move in range(8):
        by = cell + _ROWS[move] * stride + _COLS[move]
        if moves >> move & 1 and state[by] == _CLOSED:
            length = lengths[by] + _distance(stride, by, cell)
            if length < lengths[cell]:
                parents[cell], lengths[cell] = by, length


@inlined
def _distance(stride: int, one: int, other: int) -> float:
    """Return the distance between the centres of two cells, in cells."""
    return hypot(float(one // stride - other // stride), float(one % stride - other % stride))


@inlined
def _cost_to_go(heuristic: Heuristic, stride: int, cell: int, goal: int) -> float:
    """Evaluate the heuristic, in cells."""
    rows, cols = goal // stride - cell // stride, goal % stride - cell % stride
    return cost_to_go(heuristic, rows, cols) / STRAIGHT


@compiled
def has_line_of_sight(bits: UInt8[Array, " bytes"], stride: int, one: int, other: int) -> bool:
    """Whether the line between two cell centres touches no occupied cell, corners included.

    Traverses the cells along the line in integer arithmetic (Amanatides & Woo 1987, "A fast voxel
    traversal algorithm for ray tracing").
    """
    rows, cols = other // stride - one // stride, other % stride - one % stride
    down, right = stride if rows > 0 else -stride, 1 if cols > 0 else -1
    rows, cols = abs(rows), abs(cols)
    cell, left, ahead = one, rows + cols, cols - rows
    while left > 0:
        if ahead == 0:  # through the common corner of four cells
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
