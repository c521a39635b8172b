"""Occupancy bitmap: one bit per cell, 64 cells per word."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, Integer, UInt8, UInt64

from omnidrive.arrays import Array
from omnidrive.compiled import inlined

Cell = tuple[int, int]

MARGIN = 64
"""Number of border bits before the cells of a row; they also end the previous row."""
_NARROW = 16  # ratio of rows to columns above which the bitmap is transposed


@dataclass(frozen=True, eq=False, slots=True)
class BitGrid:
    """Bitmap of the cells of a grid with a border of occupied cells, row by row.

    A cell is identified by the index of its bit: its neighbours are 1 and ``stride`` bits away, and
    no sequence of moves over free cells leaves the bitmap. A grid of 4096 x 4096 cells takes 2 MB,
    which fits into the cache of the processor.

    Attributes:
        words: The bits, lowest first; 1 if a cell is occupied or belongs to the border.
        shape: Rows and columns without the border.
        stride: Number of bits per row.
        transposed: Whether rows and columns are exchanged. Tall narrow grids are transposed,
            because their border would otherwise be larger than the grid.
    """

    words: UInt64[Array, " words"]
    shape: tuple[int, int]
    stride: int
    transposed: bool = False

    @classmethod
    def of(cls, occupied: Bool[Array, "rows cols"]) -> BitGrid:
        """Create the bitmap of a grid."""
        transposed = occupied.shape[0] > _NARROW * occupied.shape[1]
        occupied = occupied.T if transposed else occupied
        bitgrid = cls.full(occupied.shape[0], occupied.shape[1], transposed)
        packed = np.packbits(occupied, axis=1, bitorder="little")
        if occupied.shape[1] % 8:
            packed[:, -1] |= np.uint8(0xFF << occupied.shape[1] % 8 & 0xFF)
        rows = bitgrid.words[:-1].view(np.uint8).reshape(bitgrid.shape[0] + 2, -1)
        rows[1:-1, MARGIN // 8 : MARGIN // 8 + packed.shape[1]] = packed
        return bitgrid

    @classmethod
    def full(cls, rows: int, cols: int, transposed: bool = False) -> BitGrid:
        """Create a bitmap in which every cell is occupied."""
        stride = MARGIN + 64 * -(-cols // 64)
        words = np.full((rows + 2) * stride // 64 + 1, ~np.uint64(0))
        return cls(words, (rows, cols), stride, transposed)

    @property
    def size(self) -> int:
        """Number of bits, border included; upper bound of every cell index."""
        return 64 * (len(self.words) - 1)

    @property
    def bits(self) -> UInt8[Array, " bytes"]:
        """View of the bits as bytes."""
        return self.words.view(np.uint8)

    def index_of(self, cell: Cell) -> int:
        """Return the bit index of a cell (row, column) of the grid."""
        row, col = cell[::-1] if self.transposed else cell
        return (row + 1) * self.stride + col + MARGIN

    def cells(self, indices: Integer[Array, " cells"]) -> Int[Array, "cells 2"]:
        """Return row and column in the grid of the cells with these bit indices."""
        row, cells = indices // self.stride, np.empty((len(indices), 2), int)
        cells[:, int(self.transposed)] = row - 1
        cells[:, 1 - int(self.transposed)] = indices - row * self.stride - MARGIN
        return cells


@inlined
def is_occupied(bits: UInt8[Array, " bytes"], index: int) -> bool:
    """Whether a cell is occupied or belongs to the border."""
    return bool(bits[index >> 3] >> (index & 7) & 1)
