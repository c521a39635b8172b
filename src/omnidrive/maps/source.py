"""A map's file, which may be hostile: what is read of it, and bounds on what it may claim."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from omnidrive.errors import InvalidMap
from omnidrive.files.bounded_file import read_bounded

MAX_CELLS = 50_000_000
"""Most cells of a map."""

MAX_TEXT = MAX_CELLS + MAX_CELLS // 10
"""Most bytes of a map that is drawn with one character per cell; the rest are ends of lines."""

FINEST, COARSEST = 1e-3, 10.0
"""Least and greatest side of a cell, in m; beyond, the unit is wrong."""


def read_content(path: Path, most: int) -> bytes:
    """All of a map's file that has at most ``most`` bytes.

    Raises:
        InvalidMap: It cannot be read, is no file or is larger.
    """
    excess = f"is larger than {most:,} bytes, the most read"
    return read_bounded(path, most, "map", InvalidMap, excess=excess)


def refuse_size(rows: int, cols: int, name: str) -> None:
    """Refuse a map without cells or with more than :data:`MAX_CELLS`."""
    if rows < 1 or cols < 1:
        raise InvalidMap(f"{name} has no cells: {rows} rows of {cols}")
    if rows * cols > MAX_CELLS:
        raise InvalidMap(f"{name} has {rows:,} rows of {cols:,}: more than {MAX_CELLS:,} cells")


def refuse_resolution(resolution: float, name: str) -> None:
    """Refuse a side of the cells outside :data:`FINEST` to :data:`COARSEST`."""
    if not (isfinite(resolution) and FINEST <= resolution <= COARSEST):
        raise InvalidMap(
            f"{name}: resolution is {resolution:g} m per cell, "
            f"need {FINEST:g} to {COARSEST:g} m per cell"
        )
