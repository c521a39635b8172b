"""A word for every cell of a board, where neighbours in all directions lie close together."""

from __future__ import annotations

import mmap

import numpy as np
from jaxtyping import Int64, UInt32

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.planning.search.board import BitBoard

Tiles = UInt32[Array, " places"] | Int64[Array, " places"]

_BITS = 3
ROWS = 1 << _BITS
"""Rows of a strip, which stands column after column: 64 bytes are 8 x 2 cells of 32 bits."""
_LARGE = 1 << 22


def empty_tiles(board: BitBoard, wide: bool) -> Tiles:
    """Words of 32 bits, or of 64, all 0.

    Of many, the system gives memory when they are first touched: a short way costs little on a
    large map. That holds for small pages only. Those of 2 MB, which NumPy asks for from 4 MB on,
    are 128 rows of 4096 words: to fill with zeros all those that a way across the map touches took
    a third of the time.
    """
    dtype = np.dtype(np.int64 if wide else np.uint32)
    count = -(-board.size // (board.stride * ROWS)) * ROWS * board.stride
    if count * dtype.itemsize < _LARGE:
        return np.zeros(count, dtype)
    memory = mmap.mmap(-1, count * dtype.itemsize)
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, dtype)


@inlined
def place(stride: int, row: int, col: int) -> int:
    """Where the word of a cell is; row and column are those of the board, border included."""
    return ((row >> _BITS) * stride + col) << _BITS | (row & ROWS - 1)
