"""Plain-text maps with one character per cell."""

from __future__ import annotations

from omnidrive.choices import Unknown
from omnidrive.errors import one_line
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import FREE, OCCUPIED, UNKNOWN, check_unknown, occupied
from omnidrive.maps.map_file import MAX_TEXT_BYTES, check_resolution, read_content
from omnidrive.maps.text_rows import read_rows

ASCII_CELLS = {
    ".": FREE,
    " ": FREE,
    "0": FREE,
    "#": OCCUPIED,
    "@": OCCUPIED,
    "1": OCCUPIED,
    "?": UNKNOWN,
}
"""Kind of cell for each character."""


def load_ascii_map(
    path: StrPath, *, resolution: float = 1.0, unknown: Unknown = "occupied"
) -> OccupancyGrid:
    """Read a text file with one character per cell, the topmost row first.

    Free cells are ``.``, a space or ``0``, obstacles ``#``, ``@`` or ``1``, unknown cells ``?``.
    All lines have the same length. The lower left corner of the map is the origin of the world
    frame W.

    Args:
        path: The file.
        resolution: Side of a cell, 0.001 to 10 m.
        unknown: Whether unknown cells count as "occupied" or "free".

    Raises:
        InvalidInput: ``unknown`` is neither "occupied" nor "free".
        InvalidMap: The file is missing, malformed or has more than 50 million cells, or the
            resolution is out of range.
    """
    check_unknown(unknown)
    path = to_path(path)
    name = one_line(str(path))
    check_resolution(resolution, name)
    content = read_content(path, MAX_TEXT_BYTES)
    return OccupancyGrid(occupied(read_rows(content, ASCII_CELLS, name), unknown), resolution)
