"""Bucket queue of cells: buckets of nearly equal length, last in, first out within a bucket.

The buckets form a ring. A cell whose length exceeds the minimum by more than the ring holds is
popped too early; a search that may expand a cell again then expands it once more.

The queue is a single array, and its operations do not branch, so that the compiler can remove the
two atomic operations (reference counts) that a call costs per array. Layout: the index of the first
slot of every bucket, the index of the first unused slot, and the slots. A slot holds a cell and the
index of the next slot in its bucket; 0 in an unused slot stands for the adjacent slot.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.planning.search.bit_ops import int64

_MAX_BUCKETS = 1 << 16


def bucket_queue(
    buckets: int, capacity: int, first: int | None = None
) -> tuple[Int32[Array, " size"], int]:
    """Create an empty queue; return it and the index of its last bucket.

    Args:
        buckets: Greatest difference between the lengths of two queued cells, in buckets; limited
            to 2^16.
        capacity: Number of cells.
        first: Cell to put into bucket 0; None: the queue is empty.
    """
    last = min(_MAX_BUCKETS, 1 << buckets.bit_length()) - 1
    queue = np.zeros(last + 2 + 2 * capacity, np.int32)
    queue[last + 1] = last + 2
    if first is not None:
        queue[[0, last + 1, last + 2]] = last + 2, last + 4, first
    return queue, last


@inlined
def is_full(queue: Int32[Array, " size"], last: int, cells: int) -> bool:
    """Whether the capacity is less than ``cells``."""
    return last + 4 + 2 * cells > len(queue)


@compiled
def enlarge(queue: Int32[Array, " size"]) -> Int32[Array, " size"]:
    """Return the queue with twice its capacity."""
    larger = np.zeros(2 * len(queue), np.int32)
    larger[: len(queue)] = queue
    return larger


@inlined
def is_empty(queue: Int32[Array, " size"], last: int, bucket: int) -> bool:
    """Whether a bucket is empty."""
    return bool(queue[bucket & last] == 0)


@inlined
def push(queue: Int32[Array, " size"], last: int, bucket: int, cell: int) -> None:
    """Put a cell into a bucket; the queue must not be full."""
    slot = int64(queue[last + 1])
    after = queue[slot + 1]
    queue[last + 1] = after + (after == 0) * (slot + 2)
    queue[slot], queue[slot + 1] = cell, queue[bucket & last]
    queue[bucket & last] = slot


@inlined
def pop(queue: Int32[Array, " size"], last: int, bucket: int) -> int:
    """Remove and return the cell last put into a bucket, which must not be empty."""
    slot = int64(queue[bucket & last])
    queue[bucket & last] = queue[slot + 1]
    queue[slot + 1] = queue[last + 1]
    queue[last + 1] = slot
    cell: int = int64(queue[slot])
    return cell
