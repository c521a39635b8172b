"""A map's file, which may be hostile: what is read of it, and bounds on what it may claim."""

from __future__ import annotations

from math import isfinite
from os import stat_result
from pathlib import Path
from stat import S_ISREG

from omnidrive.errors import InvalidMap
from omnidrive.yaml_file import one_line

MAX_CELLS = 50_000_000
"""Most cells of a map."""

FINEST, COARSEST = 1e-3, 10.0
"""Least and greatest side of a cell, in m; beyond, the unit is wrong."""


def read_content(path: Path, most: int) -> bytes:
    """All of a file that has at most ``most`` bytes.

    Raises:
        InvalidMap: It cannot be read, is no file or is larger.
    """
    content = read_head(path, most + 1)
    if len(content) > most:
        raise InvalidMap(f"{one_line(str(path))} is larger than {most:,} bytes, the most read")
    return content


def read_head(path: Path, count: int = 512) -> bytes:
    """The first ``count`` bytes of a file.

    Raises:
        InvalidMap: It cannot be read or is no file.
    """
    name = one_line(str(path))
    try:
        refuse_no_file(path.stat(), f"the map {name}")
        with path.open("rb") as file:
            return file.read(count)
    except InvalidMap:
        raise
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise InvalidMap(f"cannot read the map {name}: {reason}") from None


def refuse_no_file(status: stat_result, what: str) -> None:
    """Refuse a folder, and a pipe, which would be waited for."""
    if not S_ISREG(status.st_mode):
        raise InvalidMap(f"cannot read {what}: it is not a file")


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
