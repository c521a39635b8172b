"""A queue of cells in buckets of nearly equal length, last in first out within a bucket.

Buckets stand in a ring. A cell that is farther ahead of the least than the ring is long comes too
early, which costs a search that may expand a cell again no more than that.

One array holds it all, and nothing here branches: so the compiler can take away the two atomic
operations that a call costs for every array. First stand the buckets' first places, then the first
place that is free, then the places, each a cell and the place after it in its bucket; a place that
was never used is followed by the one beside it, written 0.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.machine import int64

_MOST_BUCKETS = 1 << 16


def bucket_queue(buckets: int, room: int) -> tuple[Int32[Array, " size"], int]:
    """An empty queue with room for some cells, and the number of its last bucket.

    Args:
        buckets: How far cells may be ahead of the least; within bounds.
        room: Number of cells.
    """
    last = min(_MOST_BUCKETS, 1 << buckets.bit_length()) - 1
    queue = np.zeros(last + 2 + 2 * room, np.int32)
    queue[last + 1] = last + 2
    return queue, last


@inlined
def is_full(queue: Int32[Array, " size"], last: int, cells: int) -> bool:
    """Whether there is not room for so many cells."""
    return last + 4 + 2 * cells > len(queue)


@compiled
def enlarged(queue: Int32[Array, " size"]) -> Int32[Array, " size"]:
    """The queue with twice the room."""
    larger = np.zeros(2 * len(queue), np.int32)
    larger[: len(queue)] = queue
    return larger


@inlined
def is_empty(queue: Int32[Array, " size"], last: int, bucket: int) -> bool:
    """Whether no cell is in a bucket."""
    return bool(queue[bucket & last] == 0)


@inlined
def push(queue: Int32[Array, " size"], last: int, bucket: int, cell: int) -> None:
    """Put a cell into a bucket; there must be room."""
    place = int64(queue[last + 1])
    after = queue[place + 1]
    queue[last + 1] = after + (after == 0) * (place + 2)
    queue[place], queue[place + 1] = cell, queue[bucket & last]
    queue[bucket & last] = place


@inlined
def pop(queue: Int32[Array, " size"], last: int, bucket: int) -> int:
    """Take the last cell out of a bucket that is not empty."""
    place = int64(queue[bucket & last])
    queue[bucket & last] = queue[place + 1]
    queue[place + 1] = queue[last + 1]
    queue[last + 1] = place
    cell: int = int64(queue[place])
    return cell
