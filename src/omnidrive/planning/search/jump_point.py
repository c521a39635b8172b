"""Jump-point search, many cells at a time."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, Int64, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.astar import BUCKET, FAR
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
from omnidrive.planning.search.machine import int64, uint32
from omnidrive.planning.search.moves import BEGIN, surroundings

_CLOSED = 16  # mark of a node whose moves were tried
_ROOM = 1 << 9  # nodes and places of the queue to begin with


def jump_point(  # noqa: PLR0917
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
        jump_board: Their bits by rows and by columns.
        first: Number of the start.
        last: Number of the goal.
        needed: Moves among eight neighbours without cutting corners.
        heuristic: What is taken to be left to go.
    """
    short, long = sorted(board.shape)
    found = np.empty((4 * (2 * short + 2), 3), np.int64)  # no more are found from one cell
    longest = 5 * (DIAGONAL * short + STRAIGHT * long) // 2  # a jump, and what it leaves more to go
    nodes, goal, expansions = _reach(
        jump_board, board.bits, board.stride, first, last, needed, heuristic, found,
        *bucket_queue(longest >> BUCKET, _ROOM),
    )  # fmt: skip
    return _walk_back(nodes, board.stride, goal), expansions


@compiled
def _reach(  # noqa: PLR0917
    jump_board: JumpBoard,
    bits: UInt8[Array, " bytes"],
    stride: int,
    first: int,
    last: int,
    needed: UInt8[Array, "10 512"],
    heuristic: Heuristic,
    found: Int64[Array, "most 3"],
    queue: Int32[Array, " size"],
    ring: int,
) -> tuple[Int64[Array, "nodes 4"], int, int]:
    """Nodes, the goal's number among them, 0 if there is no way, and the count of expansions."""
    goal = last // stride, last % stride
    floor = _to_go(heuristic, stride, first, goal)
    nodes = _start(first)
    table, count, ends = _table(nodes, 2), 2, 1 if first == last else 0
    push(queue, ring, 0, 1)
    best, bucket, waiting, expansions = 0 if ends else FAR, 0, 1, 0
    while waiting > 0:
        while is_empty(queue, ring, bucket):
            bucket += 1
        if floor + (bucket << BUCKET) >= best:
            break
        node = pop(queue, ring, bucket)
        waiting -= 1
        cell, so_far, way = nodes[node, 0], nodes[node, 1], nodes[node, 3]
        if way & _CLOSED or so_far >= best:
            continue
        nodes[node, 3], expansions = way | _CLOSED, expansions + 1
        moves = int64(needed[way, surroundings(bits, stride, cell)])
        reached = jumps(jump_board, stride, cell, last, moves, found)
        while is_full(queue, ring, waiting + reached):
            queue = enlarged(queue)
        while count + reached > len(nodes):
            nodes = _doubled(nodes)
            table = _table(nodes, count)
        for i in range(reached):
            to, length = found[i, 0], so_far + found[i, 1]
            estimate = length + _to_go(heuristic, stride, to, goal)
            if estimate >= best:
                continue
            place = _hash(to) & (len(table) - 1)
            while table[place] != 0 and nodes[table[place], 0] != to:
                place = (place + 1) & (len(table) - 1)
            known = int64(table[place])
            if known == 0:
                table[place] = known = count
                count += 1
            elif length >= nodes[known, 1]:
                continue
            nodes[known, 0], nodes[known, 1] = to, length
            nodes[known, 2], nodes[known, 3] = node, found[i, 2] + 1
            if to == last:
                best, ends = length, known
            push(queue, ring, max(bucket, (estimate - floor) >> BUCKET), known)
            waiting += 1
    return nodes, ends, expansions


@inlined
def _to_go(heuristic: Heuristic, stride: int, cell: int, goal: tuple[int, int]) -> int:
    """The heuristic from a cell to the goal's row and column."""
    row = int64(uint32(cell) // uint32(stride))
    return to_go(heuristic, row - goal[0], cell - row * stride - goal[1])


@inlined
def _hash(cell: int) -> int:
    """A number in which neighbours are far apart (Knuth, TAOCP vol. 3, sec. 6.4)."""
    return (cell * 0x9E3779B1 >> 7) & 0x7FFFFFFF


@compiled
def _start(cell: int) -> Int64[Array, "nodes 4"]:
    """Room for nodes, and as the first the start's; node 0 is none.

    Of the few cells that are nodes, each has its number of the board, the length of the shortest
    way known, the node that this leads over, and how it was reached (as in :mod:`astar`). The queue
    holds nodes.
    """
    nodes = np.empty((_ROOM, 4), np.int64)
    nodes[1, 0], nodes[1, 1], nodes[1, 2], nodes[1, 3] = cell, 0, 0, BEGIN
    return nodes


@compiled
def _table(nodes: Int64[Array, "nodes 4"], count: int) -> Int32[Array, " places"]:
    """The first ``count`` nodes by the hash of their cell, open addressing; half or more is 0."""
    size = 1
    while size < 2 * len(nodes):
        size *= 2
    table = np.zeros(size, np.int32)
    for node in range(1, count):
        place = _hash(nodes[node, 0]) & (size - 1)
        while table[place] != 0:
            place = (place + 1) & (size - 1)
        table[place] = node
    return table


@compiled
def _doubled(nodes: Int64[Array, "nodes 4"]) -> Int64[Array, "more 4"]:
    """The nodes with room for as many again."""
    more = np.empty((2 * len(nodes), 4), np.int64)
    more[: len(nodes)] = nodes
    return more


@compiled
def _walk_back(nodes: Int64[Array, "nodes 4"], stride: int, goal: int) -> Int32[Array, " cells"]:
    """Cells up to a node; from a parent, a way is diagonal and then straight."""
    count, node = min(goal, 1), goal
    while goal and nodes[node, 2] != 0:
        cell, parent = nodes[node, 0], nodes[nodes[node, 2], 0]
        rows, cols = cell // stride - parent // stride, cell % stride - parent % stride
        count += max(abs(rows), abs(cols))
        node = nodes[node, 2]
    way, node, at = np.empty(count, np.int32), goal, count - 1
    while at > 0:
        cell, parent = nodes[node, 0], nodes[nodes[node, 2], 0]
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
        node = nodes[node, 2]
    if count > 0:
        way[0] = nodes[1, 0]
    return way
