"""Scenario files of the MovingAI benchmarks: queries with the lengths of shortest paths."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.errors import InvalidMap, one_line, short_repr
from omnidrive.files.number_text import parse_number
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.map_file import read_content

_MAX_BYTES = 16_000_000
_FIELDS = 9  # bucket, map, width, height, start x, start y, goal x, goal y, length


class Query(NamedTuple):
    """Search query with the known length of a shortest path.

    Attributes:
        start: Row and column in the grid.
        goal: Row and column in the grid.
        length: Length of a shortest path over eight neighbours, in cells, as the file states it.
            A diagonal move has length sqrt(2) and must not cut corners.
        rounding: Half of the last decimal that the file writes of ``length``, in cells.
        line: Line of the file, from 1; 0: not from a file.
    """

    start: tuple[int, int]
    goal: tuple[int, int]
    length: float
    rounding: float = 0.0
    line: int = 0


def load_queries(path: StrPath, grid: OccupancyGrid) -> list[Query]:
    """Read a ``.scen`` file of version 1 for a map loaded by :func:`load_movingai_map`.

    The file counts y from the top: its cell (x, y) is row ``height - 1 - y``, column x of the grid.

    Args:
        path: The file.
        grid: The map; its size must match the size stated in the file.

    Raises:
        InvalidMap: The file is missing, malformed, too large or for a map of another size.
    """
    path = to_path(path)
    name = one_line(str(path))
    lines = read_content(path, _MAX_BYTES).decode("latin-1").split("\n")
    if lines[0].split() not in (["version", "1"], ["version", "1.0"]):
        raise InvalidMap(
            f"{name} is not a MovingAI scenario: its first line must be 'version 1', "
            f"got {short_repr(lines[0].strip())}"
        )
    return [
        _query(line, f"{name}, line {number}", *grid.occupied.shape)._replace(line=number)
        for number, line in enumerate(lines[1:], 2)
        if line.strip()
    ]


def file_cell(grid: OccupancyGrid, row: int, col: int) -> tuple[int, int]:
    """Return x and y of a cell of the grid as MovingAI files count them: y from the top."""
    return col, grid.occupied.shape[0] - 1 - row


def _query(line: str, where: str, rows: int, cols: int) -> Query:
    """Parse one line."""
    words = (
        line.split("\t") if "\t" in line else line.split()
    )  # the name of a map may contain spaces
    if len(words) != _FIELDS:
        raise InvalidMap(f"{where} has {len(words)} fields, need {_FIELDS}")
    width, height, *ends = (_whole(word.strip(), where) for word in words[2:8])
    if (height, width) != (rows, cols):
        raise InvalidMap(
            f"{where} is for a map of {height:,} rows of {width:,} cells, "
            f"but this map has {rows:,} rows of {cols:,}"
        )
    start, goal = (_cell(x, y, where, rows, cols) for x, y in (ends[:2], ends[2:]))
    length = words[8].strip()
    return Query(start, goal, _length(length, where), _rounding(length))


def _whole(word: str, where: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) <= 9):
        raise InvalidMap(f"{where}: {short_repr(word)} is not a whole number")
    return int(word)


def _cell(x: int, y: int, where: str, rows: int, cols: int) -> tuple[int, int]:
    if x >= cols or y >= rows:
        raise InvalidMap(f"{where}: the cell ({x}, {y}) lies outside the map")
    return rows - 1 - y, x


def _length(word: str, where: str) -> float:
    length = parse_number(word)
    if length is None or length < 0.0:
        raise InvalidMap(f"{where}: {short_repr(word)} is not the length of a path")
    return length


def _rounding(word: str) -> float:
    """Return half of the last decimal of a number: 0.005 for 1.41, 0.05 for 1.4e0."""
    mantissa, _, exponent = word.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 0.5 * 10.0 ** max(-300, min(int(exponent or "0") - decimals, 300))
