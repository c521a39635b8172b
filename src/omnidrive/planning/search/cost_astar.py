"""A* over cells with travel costs."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, Int64, UInt8, UInt16

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.astar import (
    CLOSED,
    COLS,
    LENGTH_SHIFT,
    ROWS,
    STEPS,
    Progress,
    reconstruct_path,
)
from omnidrive.planning.search.bit_ops import int64
from omnidrive.planning.search.bit_tiles import Tiles, empty_tiles, tile_index
from omnidrive.planning.search.bitgrid import MARGIN, BitGrid
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

UNIT = 256
"""Weight of a cell without costs: a move costs its length times the weights of both its cells."""
DIRECTIONS = 64
"""Number of directions of lanes."""
_BUCKET_SHIFT = 25
"""Number of low bits of a cost that one bucket spans: about 0.14 cells without costs."""
_CAPACITY = 1 << 12
_MOVE_OF = np.zeros((3, 3), np.int64)
_MOVE_OF[ROWS + 1, COLS + 1] = np.arange(len(MOVES))


class CostAStar:
    """Search of a path of the least cost that can be interrupted, and continues where it was.

    A move costs its integer length (see :mod:`~omnidrive.planning.search.heuristics`) times the sum
    of the weights of both cells. Costs are integers, so that they compare exactly. The heuristic is
    that of a map without costs.

    Args:
        bitgrid: The map.
        weights: Weight of each cell of the bitmap, :data:`UNIT` or more.
        lanes: Direction of the lane of each cell plus 1, of :data:`DIRECTIONS`; 0 for no lane.
        against: Weight that is added where a move is opposite to the lane; half of it across.
        start: Bit index of a free cell.
        goal: Bit index of a free cell.
        allowed: Allowed moves by neighbourhood.
        heuristic: Estimate of the remaining length.
        largest: Greatest weight of a cell with its lane; None: it is computed.
    """

    def __init__(  # noqa: PLR0917
        self,
        bitgrid: BitGrid,
        weights: UInt16[Array, "rows cols"],
        lanes: UInt8[Array, "rows cols"],
        against: int,
        start: int,
        goal: int,
        allowed: UInt8[Array, " neighbourhoods"],
        heuristic: Heuristic,
        largest: int | None = None,
    ) -> None:
        if largest is None:
            largest = largest_weight(weights, lanes, against)
        self._ends, self._stride, self._heuristic = (start, goal), bitgrid.stride, heuristic
        self._words = empty_tiles(bitgrid, wide=True)
        buckets = DIAGONAL * 2 * (largest + UNIT) >> _BUCKET_SHIFT
        self._queue, self._ring = bucket_queue(buckets, _CAPACITY, start)
        self._words[tile_index(bitgrid.stride, *divmod(start, bitgrid.stride))] = START_MOVE
        self._problem = (
            bitgrid.bits, bitgrid.stride, weights, lanes, lane_weights(against), self._ends,
            allowed, heuristic, self._words,
        )  # fmt: skip
        self.progress = Progress.of(self._ends)

    def explore(self, most: int) -> bool:
        """Expand up to ``most`` cells; return whether the search has ended."""
        self._queue, self.progress = _explore(
            *self._problem, self._queue, self._ring, self.progress.until(most)
        )
        return self.progress.waiting == 0

    def path(self) -> Int32[Array, " cells"]:
        """Return the cells of the best path so far, empty if there is none."""
        return reconstruct_path(self._words, self._stride, *self._ends)

    @property
    def lower_bound(self) -> float:
        """Cost that no path falls below, in cell widths, if the heuristic is consistent."""
        (row, col), (goal_row, goal_col) = (divmod(end, self._stride) for end in self._ends)
        estimate = _to_go(self._heuristic, row - goal_row, col - goal_col)
        level = self.progress.bucket << _BUCKET_SHIFT
        return (estimate + level) / (2.0 * UNIT * STRAIGHT)


def largest_weight(
    weights: UInt16[Array, "rows cols"], lanes: UInt8[Array, "rows cols"], against: int
) -> int:
    """Return the greatest weight of a cell with its lane."""
    return int(weights.max()) + (against if lanes.any() else 0)


def path_cost(
    weights: UInt16[Array, "rows cols"],
    lanes: UInt8[Array, "rows cols"],
    against: int,
    stride: int,
    indices: Int32[Array, " cells"],
) -> int:
    """Return the cost of a path over neighbouring cells, given by their bit indices."""
    rows, cols = indices // stride - 1, indices % stride - MARGIN
    down, right = np.diff(rows), np.diff(cols)
    moves = _MOVE_OF[down + 1, right + 1]
    added, lane = lane_weights(against), lanes[rows, cols]
    weight = weights[rows, cols].astype(np.int64)
    factors = weight[:-1] + weight[1:] + added[lane[:-1], moves] + added[lane[1:], moves]
    return int((STEPS[moves] * factors).sum())


def lane_weights(against: int) -> Int64[Array, "lanes moves"]:
    """Return the weight that is added to a cell, by its lane and by the move."""
    angles = 2.0 * np.pi * np.arange(DIRECTIONS)[:, None] / DIRECTIONS
    turn = np.arctan2(ROWS, COLS)[None] - angles
    added = np.rint(0.5 * against * (1.0 - np.cos(turn))).astype(np.int64)
    return np.vstack([np.zeros((1, len(MOVES)), np.int64), added])


@compiled
def _explore(  # noqa: PLR0917
    bits: UInt8[Array, " bytes"],
    stride: int,
    weights: UInt16[Array, "rows cols"],
    lanes: UInt8[Array, "rows cols"],
    added: Int64[Array, "lanes moves"],
    ends: tuple[int, int],
    allowed: UInt8[Array, " neighbourhoods"],
    heuristic: Heuristic,
    words: Tiles,
    queue: Int32[Array, " size"],
    ring: int,
    progress: Progress,
) -> tuple[Int32[Array, " more"], Progress]:
    """Fill ``words``; return queue and progress at the interruption or the end."""
    start, goal = ends
    goal_row, goal_col, row, col = goal // stride, goal % stride, start // stride, start % stride
    start_estimate = _to_go(heuristic, row - goal_row, col - goal_col)
    best, bucket, waiting, expansions, _, last = progress
    while waiting > 0 and expansions < last:
        while is_empty(queue, ring, bucket):
            bucket += 1
        if start_estimate + (bucket << _BUCKET_SHIFT) >= best:
            waiting = 0
            break
        cell, waiting = pop(queue, ring, bucket), waiting - 1
        row, col = cell // stride, cell % stride
        at = tile_index(stride, row, col)
        word = int64(words[at])
        so_far = word >> LENGTH_SHIFT
        if word & CLOSED or so_far >= best:
            continue
        words[at], expansions = word | CLOSED, expansions + 1
        if is_full(queue, ring, waiting + 8):
            queue = enlarge(queue)
        moves = allowed[neighbourhood(bits, stride, cell)]
        weight, lane = int64(weights[row - 1, col - MARGIN]), lanes[row - 1, col - MARGIN]
        for move in range(8):
            if moves >> move & 1 == 0:
                continue
            down, right = row + ROWS[move], col + COLS[move]
            ahead, on = int64(weights[down - 1, right - MARGIN]), lanes[down - 1, right - MARGIN]
            factor = weight + ahead + added[lane, move] + added[on, move]
            cost, at = so_far + STEPS[move] * factor, tile_index(stride, down, right)
            known = int64(words[at])
            if known != 0 and known >> LENGTH_SHIFT <= cost:
                continue
            estimate = cost + _to_go(heuristic, down - goal_row, right - goal_col)
            if estimate >= best:
                continue
            words[at] = cost << LENGTH_SHIFT | move + 1
            if down == goal_row and right == goal_col:
                best = cost
                continue
            waiting += 1
            level = (estimate - start_estimate) >> _BUCKET_SHIFT
            push(queue, ring, max(bucket, level), down * stride + right)
    return queue, Progress(best, bucket, waiting, expansions, 0, last)


@inlined
def _to_go(heuristic: Heuristic, rows: int, cols: int) -> int:
    """Return the least cost over ``rows`` and ``cols`` cells without costs."""
    return 2 * UNIT * cost_to_go(heuristic, rows, cols)
