"""Occupied cells as bits, sixty-four to a word."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, Integer, UInt8, UInt64

from omnidrive.arrays import Array
from omnidrive.compiled import inlined

Cell = tuple[int, int]

MARGIN = 64
"""Border bits before the cells of a row; they also end the row before."""
_NARROW = 16  # rows per column from which the rows of the board are the columns of the grid


@dataclass(frozen=True, eq=False, slots=True)
class BitBoard:
    """The cells of a grid and a border of occupied ones, bit after bit and row after row.

    A bit's number stands for its cell: its neighbours are one and ``stride`` bits away, and no
    walk over free cells leaves the board. Two megabytes hold 4096 x 4096 cells, so that a search
    finds its map in the processor's cache.

    Attributes:
        words: The bits, lowest first; 1 where a cell is occupied or border.
        shape: Rows and columns without the border.
        stride: Bits per row.
        turned: Whether rows and columns are exchanged, as they are for tall narrow grids: there,
            the border would be most of the board.
    """

    words: UInt64[Array, " words"]
    shape: tuple[int, int]
    stride: int
    turned: bool = False

    @classmethod
    def of(cls, occupied: Bool[Array, "rows cols"]) -> BitBoard:
        """The board of a grid."""
        turned = occupied.shape[0] > _NARROW * occupied.shape[1]
        occupied = occupied.T if turned else occupied
        board = cls.full(occupied.shape[0], occupied.shape[1], turned)
        packed = np.packbits(occupied, axis=1, bitorder="little")
        if occupied.shape[1] % 8:
            packed[:, -1] |= np.uint8(0xFF << occupied.shape[1] % 8 & 0xFF)
        rows = board.words[:-1].view(np.uint8).reshape(board.shape[0] + 2, -1)
        rows[1:-1, MARGIN // 8 : MARGIN // 8 + packed.shape[1]] = packed
        return board

    @classmethod
    def full(cls, rows: int, cols: int, turned: bool = False) -> BitBoard:
        """A board on which every cell is occupied."""
        stride = MARGIN + 64 * -(-cols // 64)
        words = np.full((rows + 2) * stride // 64 + 1, ~np.uint64(0))
        return cls(words, (rows, cols), stride, turned)

    @property
    def size(self) -> int:
        """Bits, border included: every number of a cell is less."""
        return 64 * (len(self.words) - 1)

    @property
    def bits(self) -> UInt8[Array, " bytes"]:
        """The same bits, eight to a byte."""
        return self.words.view(np.uint8)

    def number(self, cell: Cell) -> int:
        """Number of the bit of a cell (row, column)."""
        row, col = cell[::-1] if self.turned else cell
        return (row + 1) * self.stride + col + MARGIN

    def cells(self, numbers: Integer[Array, " cells"]) -> Int[Array, "cells 2"]:
        """Rows and columns of the cells with these numbers."""
        row, cells = numbers // self.stride, np.empty((len(numbers), 2), int)
        cells[:, int(self.turned)] = row - 1
        cells[:, 1 - int(self.turned)] = numbers - row * self.stride - MARGIN
        return cells


@inlined
def is_occupied(bits: UInt8[Array, " bytes"], number: int) -> bool:
    """Whether a cell is occupied or border."""
    return bool(bits[number >> 3] >> (number & 7) & 1)
