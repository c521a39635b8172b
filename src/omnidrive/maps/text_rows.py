"""A map drawn with one character per cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import UInt8

from omnidrive.arrays import Array
from omnidrive.errors import InvalidMap
from omnidrive.files.bounded_file import short_repr
from omnidrive.maps.source import refuse_size

_NEW_LINE = ord("\n")
_NO_CELL = 255


def read_rows(
    content: bytes, kinds: Mapping[str, int], name: str, first_line: int = 1
) -> UInt8[Array, "rows cols"]:
    """Kind of every cell; the last line is row 0, as y grows upwards.

    Args:
        content: Lines of one length, ended by a line feed or by a carriage return and one; empty
            lines at the end do not count.
        kinds: What each character stands for.
        name: The file's name, for messages.
        first_line: Number of the first line in its file, for messages.

    Raises:
        InvalidMap: There is no cell, there are too many, one is drawn with another character, or a
            line is longer or shorter than the first.
    """
    data = content.replace(b"\r\n", b"\n").rstrip(b"\n") + b"\n"
    width = data.index(b"\n")
    refuse_size(1, width, name)
    codes = np.frombuffer(data, np.uint8)
    _refuse_ragged(codes, width, name, first_line)
    refuse_size(len(codes) // (width + 1), width, name)
    table = np.full(256, _NO_CELL, np.uint8)
    for character, kind in kinds.items():
        table[ord(character)] = kind
    cells = table[codes.reshape(-1, width + 1)[:, :-1]]
    if cells.max() == _NO_CELL:
        row, col = np.argwhere(cells == _NO_CELL)[0].tolist()
        found = chr(codes[row * (width + 1) + col])
        raise InvalidMap(
            f"{name}, line {first_line + row}, column {col + 1}: {short_repr(found)} is no cell; "
            f"there are {' '.join(map(repr, kinds))}"
        )
    return np.ascontiguousarray(cells[::-1])


def _refuse_ragged(codes: UInt8[Array, " bytes"], width: int, name: str, first_line: int) -> None:
    """Refuse lines of unequal length."""
    ends = np.flatnonzero(codes == _NEW_LINE)
    lengths = np.diff(ends, prepend=-1) - 1
    uneven = np.flatnonzero(lengths != width)
    if len(uneven):
        row = int(uneven[0])
        raise InvalidMap(
            f"{name}, line {first_line + row} has {lengths[row]:,} cells, "
            f"line {first_line} has {width:,}"
        )
