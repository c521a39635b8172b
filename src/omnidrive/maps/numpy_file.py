"""Maps saved as NumPy arrays."""

from __future__ import annotations

from math import prod
from os import fstat
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Shaped, UInt8
from numpy.lib import format as npy

from omnidrive.arrays import Array
from omnidrive.errors import InvalidMap
from omnidrive.files.bounded_file import one_line, open_file, short_repr
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import FREE, TAKEN, UNKNOWN, Unknown, occupied
from omnidrive.maps.source import refuse_resolution, refuse_size

_BLOCK = 1 << 20  # cells read at a time
_VERSION = (1, 0)  # later ones are for long descriptions, of arrays that are no map


def load_numpy_map(
    path: Path, *, resolution: float = 1.0, unknown: Unknown = "occupied"
) -> OccupancyGrid:
    """Read an ``.npy`` file: an array of rows and columns, row 0 first, as a grid holds it.

    True is an obstacle. Of numbers, 0 is free, what is negative or NaN is unknown (as in ROS, where
    -1 is), and all else is an obstacle. Nothing in the file is unpickled.

    Args:
        path: The file.
        resolution: Side of a cell, in m.
        unknown: What unknown cells count as.

    Raises:
        InvalidMap: The file is missing, malformed or too large.
    """
    name = one_line(str(path))
    refuse_resolution(resolution, name)
    with open_file(path, "map", InvalidMap) as file:
        shape, columns_first, dtype = _header(file, name)
        _refuse_short(fstat(file.fileno()).st_size - file.tell(), shape, dtype, name)
        kinds = _kinds(file, prod(shape), dtype, name)
    rows = kinds.reshape(shape[::-1]).T if columns_first else kinds.reshape(shape)
    return OccupancyGrid(occupied(rows, unknown), resolution)


def _header(file: BinaryIO, name: str) -> tuple[tuple[int, int], bool, np.dtype]:
    """Shape, whether it is stored by columns, and type of the numbers."""
    try:
        version = npy.read_magic(file)
        if version == _VERSION:
            shape, columns_first, dtype = npy.read_array_header_1_0(file)
    except Exception as error:  # NumPy's parser lets errors of many kinds through
        reason = one_line(" ".join(str(error).split()), 200)
        raise InvalidMap(f"{name} is not a NumPy array (.npy): {reason}") from None
    if version != _VERSION:
        raise InvalidMap(f"{name} is of version {version} of NumPy's format, only (1, 0) is read")
    if len(shape) != 2:
        raise InvalidMap(f"{name} must hold rows and columns, got the shape {short_repr(shape)}")
    if dtype.kind not in "biuf":
        raise InvalidMap(f"{name} must hold booleans or numbers, got {short_repr(str(dtype))}")
    refuse_size(*shape, name)
    return shape, columns_first, dtype


def _refuse_short(size: int, shape: tuple[int, int], dtype: np.dtype, name: str) -> None:
    """Refuse a file with fewer bytes behind its header than the array has."""
    needed = prod(shape) * dtype.itemsize
    if size < needed:
        raise InvalidMap(
            f"{name} ends after {size:,} bytes of numbers; an array of "
            f"{shape[0]:,} rows of {shape[1]:,} {dtype} has {needed:,}"
        )


def _kinds(file: BinaryIO, count: int, dtype: np.dtype, name: str) -> UInt8[Array, " cells"]:
    """Kind of every cell, read block by block."""
    kinds = np.empty(count, np.uint8)
    for start in range(0, count, _BLOCK):
        size = min(_BLOCK, count - start)
        content = file.read(size * dtype.itemsize)
        if len(content) < size * dtype.itemsize:
            raise InvalidMap(f"{name} ends before its last cell")
        kinds[start : start + size] = _kind_of(np.frombuffer(content, dtype))
    return kinds


def _kind_of(values: Shaped[Array, " cells"]) -> UInt8[Array, " cells"]:
    """What each number says; NaN is neither at least 0 nor 0."""
    known = values >= 0
    return np.where(known, np.where(values == 0, FREE, TAKEN), UNKNOWN).astype(np.uint8)
