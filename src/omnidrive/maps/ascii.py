"""Maps drawn as plain text."""

from __future__ import annotations

from pathlib import Path

from omnidrive.files.bounded_file import one_line
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import FREE, TAKEN, UNKNOWN, Unknown, occupied
from omnidrive.maps.source import MAX_TEXT, read_content, refuse_resolution
from omnidrive.maps.text_rows import read_rows

ASCII_CELLS = {".": FREE, " ": FREE, "0": FREE, "#": TAKEN, "@": TAKEN, "1": TAKEN, "?": UNKNOWN}


def load_ascii_map(
    path: Path, *, resolution: float = 1.0, unknown: Unknown = "occupied"
) -> OccupancyGrid:
    """Read a text file with one character per cell, the top of the map first.

    Free cells are ``.``, a blank or ``0``, obstacles ``#``, ``@`` or ``1``, unknown cells ``?``.
    All lines have the same length. The lower left corner is the origin.

    Args:
        path: The file.
        resolution: Side of a cell, in m.
        unknown: What unknown cells count as.

    Raises:
        InvalidMap: The file is missing, malformed or too large.
    """
    name = one_line(str(path))
    refuse_resolution(resolution, name)
    content = read_content(path, MAX_TEXT)
    return OccupancyGrid(occupied(read_rows(content, ASCII_CELLS, name), unknown), resolution)
