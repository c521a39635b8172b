"""Bounded reading of map files, and limits on the size and resolution of a map."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from omnidrive.errors import InvalidMap
from omnidrive.files.bounded_file import read_bounded

MAX_CELLS = 50_000_000
"""Greatest number of cells of a map."""

MAX_TEXT_BYTES = MAX_CELLS + MAX_CELLS // 10
"""Greatest size in bytes of a text map: one character per cell, and line ends."""

FINEST, COARSEST = 1e-3, 10.0
"""Least and greatest side of a cell, in m; other values indicate a wrong unit."""


def read_content(path: Path, maximum: int) -> bytes:
    """Read a map file of at most ``maximum`` bytes.

    Raises:
        InvalidMap: The path is not a file, or the file cannot be read or is larger.
    """
    excess = f"is larger than {maximum:,} bytes, the maximum"
    return read_bounded(path, maximum, "map", InvalidMap, excess=excess)


def check_size(rows: int, cols: int, name: str) -> None:
    """Raise InvalidMap for a map without cells or with more than :data:`MAX_CELLS`."""
    if rows < 1 or cols < 1:
        raise InvalidMap(f"{name} has no cells: {rows} rows of {cols}")
    if rows * cols > MAX_CELLS:
        raise InvalidMap(
            f"{name} has {rows:,} rows of {cols:,}: more than {MAX_CELLS:,} cells; crop the map or "
            "make its cells larger"
        )


def check_resolution(resolution: float, name: str) -> None:
    """Raise InvalidMap for a resolution outside :data:`FINEST` to :data:`COARSEST`."""
    if not (isfinite(resolution) and FINEST <= resolution <= COARSEST):
        raise InvalidMap(
            f"{name}: resolution is {resolution:g} m per cell, "
            f"need {FINEST:g} to {COARSEST:g} m per cell"
        )
