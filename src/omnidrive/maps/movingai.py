"""Maps of the MovingAI benchmarks (``.map``)."""

from __future__ import annotations

from omnidrive.errors import InvalidMap, one_line, short_repr
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import FREE, OCCUPIED, occupied
from omnidrive.maps.map_file import MAX_TEXT_BYTES, check_resolution, check_size, read_content
from omnidrive.maps.text_rows import read_rows

_TERRAIN = {
    ".": FREE,
    "G": FREE,
    "S": FREE,
    "@": OCCUPIED,
    "O": OCCUPIED,
    "T": OCCUPIED,
    "W": OCCUPIED,
}
_HEADER_LINES = 4


def load_movingai_map(path: StrPath, *, resolution: float = 1.0) -> OccupancyGrid:
    """Read a ``.map`` file of type octile.

    Format: Sturtevant 2012, "Benchmarks for grid-based pathfinding". Ground (``.``,
    ``G``) and swamp (``S``) are free; everything else (``@``, ``O``, ``T``, ``W``) is an obstacle.
    The first line of cells, y = 0 in the file, is the topmost row of the map: the file's cell
    (x, y) is row ``height - 1 - y``, column x of the grid. The lower left corner of the map is the
    origin of the world frame W.

    Args:
        path: The file.
        resolution: Side of a cell, 0.001 to 10 m; the format states none.

    Raises:
        InvalidMap: The file is missing, malformed or has more than 50 million cells, or the
            resolution is out of range.
    """
    path = to_path(path)
    name = one_line(str(path))
    check_resolution(resolution, name)
    content = read_content(path, MAX_TEXT_BYTES)
    *header, cells = [*content.split(b"\n", _HEADER_LINES), b""][: _HEADER_LINES + 1]
    height, width = _size([line[:80].decode("latin-1").split() for line in header], name)
    check_size(height, width, name)
    kinds = read_rows(cells, _TERRAIN, name, _HEADER_LINES + 1)
    if kinds.shape != (height, width):
        rows, cols = kinds.shape
        raise InvalidMap(
            f"{name} states {height:,} rows of {width:,} cells, but contains {rows:,} rows of "
            f"{cols:,}"
        )
    return OccupancyGrid(occupied(kinds, "occupied"), resolution)


def _size(header: list[list[str]], name: str) -> tuple[int, int]:
    """Return height and width from the words of the header lines."""
    lines = {words[0]: words[1:] for words in header if words}
    if header[:1] != [["type", "octile"]] or header[3:] != [["map"]]:
        raise InvalidMap(
            f"{name} is not a MovingAI map: its first lines must be 'type octile', "
            "'height ...', 'width ...' and 'map'"
        )
    sizes = []
    for key in ("height", "width"):
        words = lines.get(key, [])
        if len(words) != 1 or not (words[0].isascii() and words[0].isdigit()) or len(words[0]) > 9:
            value = short_repr(" ".join(words))
            raise InvalidMap(f"{name}: {key} must be a whole number, got {value}")
        sizes.append(int(words[0]))
    return sizes[0], sizes[1]
