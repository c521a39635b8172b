"""Jump-point search that scans 64 cells at a time."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, Shaped, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.astar import BUCKET_SHIFT, Progress
from omnidrive.planning.search.bit_ops import int64, uint32
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
from omnidrive.planning.search.jump_grid import JUMP, JumpGrid, jumps
from omnidrive.planning.search.moves import START_MOVE, neighbourhood

_NODE = np.dtype([
    ("cell", "i8"),
    ("length", "i8"),
    ("parent", "i8"),
    ("last_move", "i8"),
], align=True)  # fmt: skip
"""Index of the cell, length of the shortest known path, index of the parent node, and code of the
last move, as in :mod:`astar`. The queue holds indices of nodes."""
_CLOSED = 16  # flag of an expanded node
_CAPACITY = 1 << 9  # initial number of nodes and of slots of the queue


class JumpPointSearch:
    """A* over jump points that can be interrupted, and continues where it was.

    Harabor & Grastien 2011, "Online graph pruning for pathfinding on grid maps", and 2014,
    "Improving jump point search". Rows and columns are scanned 64 cells at a time. The cells of a
    diagonal run are not put into the queue, only their successors.

    Args:
        bitgrid: The cells.
        jump_grid: The same cells by rows and by columns.
        start: Index of the start cell.
        goal: Index of the goal cell.
        move_table: Pruned moves among eight neighbours without cutting corners.
        heuristic: Estimate of the remaining length.
    """

    def __init__(  # noqa: PLR0917
        self,
        bitgrid: BitGrid,
        jump_grid: JumpGrid,
        start: int,
        goal: int,
        move_table: UInt8[Array, "10 512"],
        heuristic: Heuristic,
    ) -> None:
        short, long = sorted(bitgrid.shape)
        found = np.empty(4 * (2 * short + 2), JUMP)  # enough for the successors of one cell
        # a jump and the rise of the heuristic
        longest = 5 * (DIAGONAL * short + STRAIGHT * long) // 2
        queue, self._ring = bucket_queue(longest >> BUCKET_SHIFT, _CAPACITY, 1)
        self._problem = (
            jump_grid, bitgrid.bits, bitgrid.stride, (start, goal), move_table, heuristic, found,
        )  # fmt: skip
        nodes = _create_nodes(start)
        self._memory = nodes, _table(nodes, 2), queue
        self._counts = 2, 1 if start == goal else 0
        self.progress = Progress.of((start, goal))
        self._stride, self._ends, self._heuristic = bitgrid.stride, (start, goal), heuristic

    def explore(self, most: int) -> bool:
        """Expand up to ``most`` jump points; return whether the search has ended."""
        self._memory, self._counts, self.progress = _explore(
            *self._problem, *self._memory, self._ring, self._counts, self.progress.until(most)
        )
        return self.progress.waiting == 0

    def path(self) -> Int32[Array, " cells"]:
        """Return the cells of the best path so far, empty if there is none."""
        return _reconstruct_path(self._memory[0], self._stride, self._counts[1])

    @property
    def lower_bound(self) -> float:
        """Length that no path falls below, in cell widths, if the heuristic is consistent."""
        start, goal = self._ends
        estimate = _cost_to_go(self._heuristic, self._stride, start, divmod(goal, self._stride))
        return (estimate + (self.progress.bucket << BUCKET_SHIFT)) / STRAIGHT


@compiled
def _explore(  # noqa: PLR0917
    jump_grid: JumpGrid,
    bits: UInt8[Array, " bytes"],
    stride: int,
    ends: tuple[int, int],
    move_table: UInt8[Array, "10 512"],
    heuristic: Heuristic,
    found: Shaped[Array, " most"],
    nodes: Shaped[Array, " nodes"],
    table: Int32[Array, " slots"],
    queue: Int32[Array, " size"],
    ring: int,
    counts: tuple[int, int],
    progress: Progress,
) -> tuple[tuple, tuple[int, int], Progress]:
    """Return nodes, table and queue; the numbers of nodes and of the goal's node; the progress."""
    goal, goal_cell = ends[1], (ends[1] // stride, ends[1] % stride)
    start_estimate = _cost_to_go(heuristic, stride, ends[0], goal_cell)
    (best, bucket, waiting, expansions, _, last), (count, goal_node) = progress, counts
    while waiting > 0 and expansions < last:
        while is_empty(queue, ring, bucket):
            bucket += 1
        if start_estimate + (bucket << BUCKET_SHIFT) >= best:
            waiting = 0
            break
        node = pop(queue, ring, bucket)
        waiting -= 1
        cell, so_far, last_move = nodes[node].cell, nodes[node].length, nodes[node].last_move
        if last_move & _CLOSED or so_far >= best:
            continue
        nodes[node].last_move, expansions = last_move | _CLOSED, expansions + 1
        moves = int64(move_table[last_move, neighbourhood(bits, stride, cell)])
        reached = jumps(jump_grid, stride, cell, goal, moves, found)
        while is_full(queue, ring, waiting + reached):
            queue = enlarge(queue)
        while count + reached > len(nodes):
            nodes = _enlarge_nodes(nodes)
            table = _table(nodes, count)
        for i in range(reached):
            to, length = found[i].cell, so_far + found[i].length
            estimate = length + _cost_to_go(heuristic, stride, to, goal_cell)
            if estimate >= best:
                continue
            slot = _hash(to) & (len(table) - 1)
            while table[slot] != 0 and nodes[table[slot]].cell != to:
                slot = (slot + 1) & (len(table) - 1)
            known = int64(table[slot])
            if known == 0:
                table[slot] = known = count
                count += 1
            elif length >= nodes[known].length:
                continue
            nodes[known].cell, nodes[known].length = to, length
            nodes[known].parent, nodes[known].last_move = node, found[i].move + 1
            if to == goal:
                best, goal_node = length, known
            push(queue, ring, max(bucket, (estimate - start_estimate) >> BUCKET_SHIFT), known)
            waiting += 1
    progress = Progress(best, bucket, waiting, expansions, 0, last)
    return (nodes, table, queue), (count, goal_node), progress


@inlined
def _cost_to_go(heuristic: Heuristic, stride: int, cell: int, goal_cell: tuple[int, int]) -> int:
    """Evaluate the heuristic from a cell to the row and column of the goal."""
    row = int64(uint32(cell) // uint32(stride))
    return cost_to_go(heuristic, row - goal_cell[0], cell - row * stride - goal_cell[1])


@inlined
def _hash(cell: int) -> int:
    """Multiplicative hash of a cell index (Knuth, TAOCP vol. 3, sec. 6.4)."""
    return (cell * 0x9E3779B1 >> 7) & 0x7FFFFFFF


@compiled
def _create_nodes(cell: int) -> Shaped[Array, " nodes"]:
    """Create the array of nodes with the start as node 1; node 0 is unused."""
    nodes = np.empty(_CAPACITY, _NODE)
    nodes[1].cell, nodes[1].length, nodes[1].parent, nodes[1].last_move = cell, 0, 0, START_MOVE
    return nodes


@compiled
def _table(nodes: Shaped[Array, " nodes"], count: int) -> Int32[Array, " slots"]:
    """Create a hash table (open addressing, at most half full) of the first ``count`` nodes."""
    size = 1
    while size < 2 * len(nodes):
        size *= 2
    table = np.zeros(size, np.int32)
    for node in range(1, count):
        slot = _hash(nodes[node].cell) & (size - 1)
        while table[slot] != 0:
            slot = (slot + 1) & (size - 1)
        table[slot] = node
    return table


@compiled
def _enlarge_nodes(nodes: Shaped[Array, " nodes"]) -> Shaped[Array, " more"]:
    """Return the array of nodes with twice its capacity."""
    more = np.empty(2 * len(nodes), _NODE)
    more[: len(nodes)] = nodes
    return more


@compiled
def _reconstruct_path(
    nodes: Shaped[Array, " nodes"], stride: int, goal_node: int
) -> Int32[Array, " cells"]:
    """Return the cells up to a node; the path from a parent is diagonal first, then straight."""
    count, node = min(goal_node, 1), goal_node
    while goal_node and nodes[node].parent != 0:
        cell, parent = nodes[node].cell, nodes[nodes[node].parent].cell
        rows, cols = cell // stride - parent // stride, cell % stride - parent % stride
        count += max(abs(rows), abs(cols))
        node = nodes[node].parent
    path, node, at = np.empty(count, np.int32), goal_node, count - 1
    while at > 0:
        cell, parent = nodes[node].cell, nodes[nodes[node].parent].cell
        rows, cols = cell // stride - parent // stride, cell % stride - parent % stride
        down, right = np.sign(rows) * stride, np.sign(cols)
        diagonal = min(abs(rows), abs(cols))
        for remaining in range(max(abs(rows), abs(cols)), 0, -1):
            path[at] = cell
            at -= 1
            if remaining <= diagonal:
                cell -= down + right
            else:
                cell -= down if abs(rows) > abs(cols) else right
        node = nodes[node].parent
    if count > 0:
        path[0] = nodes[1].cell
    return path
