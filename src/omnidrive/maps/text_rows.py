"""Parsing of maps with one character per cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import UInt8

from omnidrive.arrays import Array
from omnidrive.errors import InvalidMap, short_repr
from omnidrive.maps.map_file import check_size

_NEW_LINE = ord("\n")
_NO_CELL = 255


def read_rows(
    content: bytes, kinds: Mapping[str, int], name: str, first_line: int = 1
) -> UInt8[Array, "rows cols"]:
    """Return the kind of every cell; the last line is row 0, because y points upwards.

    Args:
        content: Lines of equal length, ended by LF or CR LF; trailing empty lines are ignored.
        kinds: Kind of each permitted character.
        name: Name of the file, for messages.
        first_line: Number of the first line in the file, for messages.

    Raises:
        InvalidMap: There are no cells or too many, a character is not permitted, or the lines
            differ in length.
    """
    data = content.replace(b"\r\n", b"\n").rstrip(b"\n") + b"\n"
    width = data.index(b"\n")
    check_size(1, width, name)
    codes = np.frombuffer(data, np.uint8)
    _check_line_lengths(codes, width, name, first_line)
    check_size(len(codes) // (width + 1), width, name)
    table = np.full(256, _NO_CELL, np.uint8)
    for character, kind in kinds.items():
        table[ord(character)] = kind
    cells = table[codes.reshape(-1, width + 1)[:, :-1]]
    if cells.max() == _NO_CELL:
        row, col = np.argwhere(cells == _NO_CELL)[0].tolist()
        found = chr(codes[row * (width + 1) + col])
        raise InvalidMap(
            f"{name}, line {first_line + row}, column {col + 1}: {short_repr(found)} "
            f"is not a cell; use {' '.join(map(repr, kinds))}"
        )
    return np.ascontiguousarray(cells[::-1])


def _check_line_lengths(
    codes: UInt8[Array, " bytes"], width: int, name: str, first_line: int
) -> None:
    """Raise InvalidMap for lines of unequal length."""
    ends = np.flatnonzero(codes == _NEW_LINE)
    lengths = np.diff(ends, prepend=-1) - 1
    uneven = np.flatnonzero(lengths != width)
    if len(uneven):
        row = int(uneven[0])
        raise InvalidMap(
            f"{name}, line {first_line + row} has {lengths[row]:,} cells, "
            f"line {first_line} has {width:,}"
        )
