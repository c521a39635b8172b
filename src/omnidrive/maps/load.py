"""A map from a file of any known format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from omnidrive.errors import InvalidMap
from omnidrive.files.bounded_file import one_line, read_head
from omnidrive.maps.ascii import ASCII_CELLS, load_ascii_map
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import Unknown
from omnidrive.maps.movingai import load_movingai_map
from omnidrive.maps.nav2 import load_nav2_map
from omnidrive.maps.numpy_file import load_numpy_map

_SUFFIXES = {
    ".yaml": "nav2", ".yml": "nav2", ".map": "movingai", ".npy": "numpy", ".txt": "ascii",
    ".pgm": "picture", ".png": "picture", ".bmp": "picture",
}  # fmt: skip
_BEGINNINGS = {
    b"type ": "movingai", b"\x93NUMPY": "numpy", b"image:": "nav2", b"\x89PNG": "picture",
    b"P5": "picture", b"P2": "picture", b"BM": "picture",
}  # fmt: skip

_HEAD = 512  # bytes that show the format


def load_map(
    path: Path, *, resolution: float | None = None, unknown: Unknown = "occupied"
) -> OccupancyGrid:
    """Read a map: Nav2's (``.yaml``), MovingAI's (``.map``), NumPy's (``.npy``) or text (``.txt``).

    A file with another suffix is known by how it begins.

    Args:
        path: The file; of a Nav2 map the YAML file, not the picture.
        resolution: Side of a cell, in m, for the formats that do not say it; 1 m if not given.
        unknown: What cells count as of which the file does not say whether they are free.

    Raises:
        InvalidMap: The file is missing, malformed, too large or of no known format, or states its
            resolution and another one is given.
    """
    name = one_line(str(path))
    kind = _SUFFIXES.get(path.suffix.lower()) or _by_content(path)
    if kind == "nav2":
        if resolution is not None:
            raise InvalidMap(f"{name} states its own resolution; give none beside it")
        return load_nav2_map(path, unknown=unknown)
    side = 1.0 if resolution is None else resolution
    if kind == "movingai":
        return load_movingai_map(path, resolution=side)
    readers: dict[str, Callable[..., OccupancyGrid]] = {
        "numpy": load_numpy_map,
        "ascii": load_ascii_map,
    }
    if kind in readers:
        return readers[kind](path, resolution=side, unknown=unknown)
    if kind == "picture":
        raise InvalidMap(
            f"{name} is a picture, which has no scale; name the YAML file of its Nav2 map "
            f"({path.with_suffix('.yaml').name})"
        )
    raise InvalidMap(
        f"{name} is not a map: need a Nav2 map (.yaml), a MovingAI map (.map), a NumPy array "
        "(.npy) or text (.txt) of the characters " + " ".join(map(repr, ASCII_CELLS))
    )


def _by_content(path: Path) -> str | None:
    """The format that a file's first bytes show; None if they show none."""
    head = read_head(path, _HEAD, "map", InvalidMap)
    for beginning, kind in _BEGINNINGS.items():
        if head.startswith(beginning):
            return kind
    cells = "".join(ASCII_CELLS).encode()
    return "ascii" if head.strip() and not head.strip(cells + b"\r\n") else None
