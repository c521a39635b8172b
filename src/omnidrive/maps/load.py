"""Loading of map files of any supported format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from omnidrive.choices import Unknown
from omnidrive.errors import InvalidMap
from omnidrive.files.bounded_file import one_line, read_head
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps.ascii import ASCII_CELLS, load_ascii_map
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import check_unknown
from omnidrive.maps.movingai import load_movingai_map
from omnidrive.maps.nav2 import load_nav2_map
from omnidrive.maps.numpy_file import load_numpy_map

# an image alone is no map; it is recognised for the error message
_SUFFIXES = {
    ".yaml": "nav2", ".yml": "nav2", ".map": "movingai", ".npy": "numpy", ".txt": "ascii",
    ".pgm": "image", ".png": "image", ".bmp": "image",
}  # fmt: skip
_MAGIC_BYTES = {
    b"type ": "movingai", b"\x93NUMPY": "numpy", b"image:": "nav2", b"\x89PNG": "image",
    b"P5": "image", b"P2": "image", b"BM": "image",
}  # fmt: skip

_HEAD = 512  # bytes at the start of a file from which its format is detected


def load_map(
    path: StrPath, *, resolution: float | None = None, unknown: Unknown = "occupied"
) -> OccupancyGrid:
    """Read a map in the format of its suffix.

    The formats are Nav2 (``.yaml``, ``.yml``), MovingAI (``.map``), NumPy (``.npy``) and text
    (``.txt``). The format of a file with another suffix is detected from its first bytes.

    Args:
        path: The file; for a Nav2 map the YAML file, not the image.
        resolution: Side of a cell in m, for formats that do not state it. None: 1 m, or the
            resolution that the file states.
        unknown: Whether unknown cells count as occupied or free; MovingAI maps have none.

    Raises:
        InvalidInput: ``unknown`` is neither "occupied" nor "free".
        InvalidMap: The file is missing, malformed, too large or of an unsupported format; the
            resolution is outside its range; or one is given for a file that states its own.
    """
    check_unknown(unknown)
    path = to_path(path)
    name = one_line(str(path))
    map_format = _SUFFIXES.get(path.suffix.lower()) or _detect_format(path)
    if map_format == "nav2":
        if resolution is not None:
            raise InvalidMap(f"{name} states its own resolution; omit the resolution option")
        return load_nav2_map(path, unknown=unknown)
    side = 1.0 if resolution is None else resolution
    if map_format == "movingai":
        return load_movingai_map(path, resolution=side)
    readers: dict[str, Callable[..., OccupancyGrid]] = {
        "numpy": load_numpy_map,
        "ascii": load_ascii_map,
    }
    if map_format in readers:
        return readers[map_format](path, resolution=side, unknown=unknown)
    if map_format == "image":
        raise InvalidMap(
            f"{name} is an image, which states no resolution; load the YAML file of its Nav2 map "
            f"({path.with_suffix('.yaml').name})"
        )
    raise InvalidMap(
        f"{name} is not a map: need a Nav2 map (.yaml), a MovingAI map (.map), a NumPy array "
        "(.npy) or text (.txt) of the characters " + " ".join(map(repr, ASCII_CELLS))
    )


def _detect_format(path: Path) -> str | None:
    """Return the format detected from the first bytes of a file, None if unknown."""
    head = read_head(path, _HEAD, "map", InvalidMap)
    for magic, map_format in _MAGIC_BYTES.items():
        if head.startswith(magic):
            return map_format
    # a text map consists of cell characters and line ends only, and not of spaces alone
    cells = "".join(ASCII_CELLS).encode()
    return "ascii" if head.strip() and not head.strip(cells + b"\r\n") else None
