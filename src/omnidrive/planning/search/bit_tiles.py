"""Tiled array with one word for each cell of a bitmap; neighbouring cells are close in memory.

The rows of the bitmap are divided into strips, each of which is stored column by column.
"""

from __future__ import annotations

import mmap

import numpy as np
from jaxtyping import Int64, UInt32

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.planning.search.bitgrid import BitGrid

Tiles = UInt32[Array, " words"] | Int64[Array, " words"]
"""One word per cell, at the index from :func:`tile_index`."""

_BITS = 3
ROWS = 1 << _BITS
"""Rows of a strip; a cache line of 64 bytes is 8 rows x 2 columns of words of 32 bits."""
_LARGE = 1 << 22
"""Size from which NumPy requests huge pages for an array, bytes."""


def empty_tiles(bitgrid: BitGrid, wide: bool) -> Tiles:
    """Create a word of 32 bits for each cell, or of 64 bits if ``wide``, all 0.

    The operating system maps the pages of a large array on first access, so a short path on a large
    map costs little memory and time. This requires small pages: a huge page of 2 MB, which NumPy
    requests for arrays of 4 MB or more, is 128 rows of 4096 words, and zeroing the pages touched by
    a path across the map took a third of the search time.
    """
    dtype = np.dtype(np.int64 if wide else np.uint32)
    count = -(-bitgrid.size // (bitgrid.stride * ROWS)) * ROWS * bitgrid.stride
    if count * dtype.itemsize < _LARGE:
        return np.zeros(count, dtype)
    memory = mmap.mmap(-1, count * dtype.itemsize)
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, dtype)


@inlined
def tile_index(stride: int, row: int, col: int) -> int:
    """Return the index of a cell's word.

    Args:
        stride: Number of cells per row of the bitmap, with its border.
        row: Row of the cell in the bitmap; the border has the first row.
        col: Column of the cell in the bitmap; the border has the first columns.
    """
    return ((row >> _BITS) * stride + col) << _BITS | (row & ROWS - 1)
