"""Maps stored as NumPy arrays (``.npy``)."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from os import fstat
from typing import BinaryIO

import numpy as np
from jaxtyping import Float32, Shaped, UInt8
from numpy.lib import format as npy

from omnidrive.arrays import Array
from omnidrive.choices import Unknown
from omnidrive.errors import InvalidMap, one_line, short_repr
from omnidrive.files.bounded_file import open_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import FREE, OCCUPIED, UNKNOWN, check_unknown, occupied
from omnidrive.maps.map_file import check_resolution, check_size

_BLOCK = 1 << 20  # cells read at a time
_VERSION = (1, 0)  # later versions are for structured types, which are not maps


def load_numpy_map(
    path: StrPath, *, resolution: float = 1.0, unknown: Unknown = "occupied"
) -> OccupancyGrid:
    """Read an ``.npy`` file: a two-dimensional array [row, column].

    Rows grow along the y axis and columns along the x axis of the world frame W; the outer corner
    of element [0, 0] is its origin. Flip an image whose row 0 is the topmost (``numpy.flipud``).

    In a boolean array, True is an obstacle. In a numeric array, 0 is free, negative numbers and NaN
    are unknown (ROS uses -1), and all other numbers are obstacles. Nothing is unpickled.

    Args:
        path: The file.
        resolution: Side of a cell, 0.001 to 10 m.
        unknown: Whether unknown cells count as occupied or free.

    Raises:
        InvalidInput: ``unknown`` is neither "occupied" nor "free".
        InvalidMap: The file is missing, malformed or has more than 50 million cells, or the
            resolution is out of range.
    """
    check_unknown(unknown)
    check_resolution(resolution, one_line(str(to_path(path))))
    return OccupancyGrid(occupied(_read(path, "map", _kind_of, np.uint8), unknown), resolution)


def load_numbers(path: StrPath) -> Float32[Array, "rows cols"]:
    """Read a two-dimensional array of numbers in single precision.

    Raises:
        InvalidMap: The file is missing, malformed or has more than 50 million elements.
    """
    return _read(path, "array", _single, np.float32)


def _read(
    path: StrPath, kind: str, convert: Callable[[np.ndarray], np.ndarray], dtype: type
) -> np.ndarray:
    """Return the elements of an array after a conversion to ``dtype``, block by block."""
    path = to_path(path)
    name = one_line(str(path))
    with open_file(path, kind, InvalidMap) as file:
        shape, columns_first, stored = _header(file, name)
        _check_length(fstat(file.fileno()).st_size - file.tell(), shape, stored, name)
        count = prod(shape)
        found: np.ndarray = np.empty(count, dtype)
        for start in range(0, count, _BLOCK):
            size = min(_BLOCK, count - start)
            content = file.read(size * stored.itemsize)
            if len(content) < size * stored.itemsize:
                raise InvalidMap(f"{name} is truncated")
            found[start : start + size] = convert(np.frombuffer(content, stored))
    rows = found.reshape(shape[::-1]).T if columns_first else found.reshape(shape)
    return np.ascontiguousarray(rows)


def _header(file: BinaryIO, name: str) -> tuple[tuple[int, int], bool, np.dtype]:
    """Return the shape, whether the array is in column-major order, and its type."""
    try:
        version = npy.read_magic(file)
        if version == _VERSION:
            shape, columns_first, dtype = npy.read_array_header_1_0(file)
    except Exception as error:  # NumPy's parser raises errors of many types
        reason = one_line(" ".join(str(error).split()), 200)
        raise InvalidMap(f"{name} is not a NumPy array (.npy): {reason}") from None
    if version != _VERSION:
        raise InvalidMap(
            f"{name} has version {version} of the NumPy format; only (1, 0) is supported"
        )
    if len(shape) != 2:
        raise InvalidMap(
            f"{name} must contain a two-dimensional array, got shape {short_repr(shape)}"
        )
    if dtype.kind not in "biuf":
        raise InvalidMap(f"{name} must contain booleans or numbers, got {short_repr(str(dtype))}")
    check_size(*shape, name)
    return shape, columns_first, dtype


def _check_length(size: int, shape: tuple[int, int], dtype: np.dtype, name: str) -> None:
    """Raise InvalidMap if the file has fewer bytes after its header than the array needs."""
    needed = prod(shape) * dtype.itemsize
    if size < needed:
        raise InvalidMap(
            f"{name} is truncated: it has {size:,} bytes of data, but an array of "
            f"{shape[0]:,} rows of {shape[1]:,} {dtype} needs {needed:,}"
        )


def _kind_of(values: Shaped[Array, " cells"]) -> UInt8[Array, " cells"]:
    """Return the kind of each number; NaN is unknown, because NaN >= 0 is false."""
    known = values >= 0
    return np.where(known, np.where(values == 0, FREE, OCCUPIED), UNKNOWN).astype(np.uint8)


def _single(values: Shaped[Array, " cells"]) -> Float32[Array, " cells"]:
    """Return numbers in single precision; those beyond its range are infinite."""
    with np.errstate(over="ignore"):
        return values.astype(np.float32)
