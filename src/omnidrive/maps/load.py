"""Loading of map files of any supported format, and of named maps."""

from __future__ import annotations

import os
from inspect import signature
from pathlib import Path
from typing import Any

from omnidrive.choices import Unknown
from omnidrive.components import Component, component_names, find_component
from omnidrive.errors import PART_ERRORS, InvalidMap, OmnidriveError, closest, one_line, short_repr
from omnidrive.files.bounded_file import read_head
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps.ascii import ASCII_CELLS
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import check_unknown

_OWN = {".yaml", ".yml", ".map", ".npy", ".txt"}
"""Suffixes of the formats of this package."""
_IMAGES = {".pgm", ".png", ".bmp"}
"""Suffixes of images, which alone are no maps; they are recognised for the error message."""
_MAGIC_BYTES = {
    b"type ": ".map", b"\x93NUMPY": ".npy", b"image:": ".yaml", b"\x89PNG": ".png",
    b"P5": ".pgm", b"P2": ".pgm", b"BM": ".bmp",
}  # fmt: skip
"""Suffix of each format by the first bytes of its files."""

_HEAD = 512  # bytes at the start of a file from which its format is detected


def is_named_map(source: str) -> bool:
    """Return whether a text is the name of an installed map, such as ``paper``, and not a file."""
    return not source.startswith(".") and source in component_names("maps")


def load_map(
    path: StrPath, *, resolution: float | None = None, unknown: Unknown = "occupied"
) -> OccupancyGrid:
    """Read a map in the format of its suffix, or return a named map.

    The formats are Nav2 (``.yaml``, ``.yml``), MovingAI (``.map``), NumPy (``.npy``), text
    (``.txt``), and those of installed distributions: an entry point of the group ``omnidrive.maps``
    whose name begins with a dot is the suffix of a format, and its object is a function
    ``load(path, *, resolution=..., unknown=...) -> OccupancyGrid``, of which both options may be
    absent. The format of a file with another suffix is detected from its first bytes. An entry
    point with another name is a named map: a function without arguments that returns it.

    Args:
        path: The file, for a Nav2 map the YAML file, not the image; or a name, as text.
        resolution: Side of a cell in m, for formats that do not state it. None: 1 m, or the
            resolution that the file states.
        unknown: Whether unknown cells count as occupied or free; MovingAI maps have none.

    Raises:
        InvalidInput: ``unknown`` is neither "occupied" nor "free".
        InvalidMap: The file is missing, malformed, too large or of an unsupported format; the
            resolution is outside its range; or one is given for a file that states its own.
    """
    check_unknown(unknown)
    options: dict[str, Any] = {} if resolution is None else {"resolution": resolution}
    if isinstance(path, str) and is_named_map(path):
        return _call(find_component("maps", path), f"the map {path}", **options)
    file = to_path(path)
    name = one_line(str(file))
    suffix: str | None = file.suffix.lower()
    suffixes = [each for each in component_names("maps") if each.startswith(".")]
    if suffix not in suffixes:
        _check_name(file)
        suffix = suffix if suffix in _IMAGES else _detect_format(file)
    if suffix in suffixes:
        reader = find_component("maps", suffix)
        if "unknown" in signature(reader.factory).parameters:
            options["unknown"] = unknown
        return _call(reader, name, file, **options)
    if suffix in _IMAGES:
        raise InvalidMap(
            f"{name} is an image, which states no resolution; load the YAML file of its Nav2 map "
            f"({file.with_suffix('.yaml').name}), or write one with image, resolution, origin, "
            "free_thresh and occupied_thresh"
        )
    others = ", ".join(sorted(set(suffixes) - _OWN))
    raise InvalidMap(
        f"{name} is not a map: need a Nav2 map (.yaml), a MovingAI map (.map), a NumPy array "
        f"(.npy) or text (.txt) of the characters {' '.join(map(repr, ASCII_CELLS))}"
        + (f"; other installed formats: {others}" if others else "")
    )


def _check_name(file: Path) -> None:
    """Raise InvalidMap for a file that does not exist and has nearly the name of a named map."""
    near = closest(file.name, filter(is_named_map, component_names("maps")), cutoff=0.7)
    if near and not os.path.lexists(file):
        raise InvalidMap(
            f"there is no map {one_line(str(file))}; did you mean the named map '{near}'?"
        )


def _call(component: Component, name: str, *arguments: Path, **options: Any) -> OccupancyGrid:
    """Return the map of a component; an error or an exit of its code becomes InvalidMap.

    Args:
        component: Reader of a format, or a named map.
        name: The file or map, for messages.
        arguments: The file of a reader.
        options: Arguments by keyword.
    """
    if "resolution" in options and "resolution" not in signature(component.factory).parameters:
        raise InvalidMap(f"{name} states its own resolution; omit the resolution option")
    try:
        grid = component.factory(*arguments, **options)
    except OmnidriveError:
        raise
    except PART_ERRORS as error:
        fact = one_line(f"{type(error).__name__}: {error}", 200)
        raise InvalidMap(
            f"{name} cannot be loaded by {component.name} of {component.origin}: {fact}"
        ) from error
    if not isinstance(grid, OccupancyGrid):
        raise InvalidMap(
            f"{name}: {component.name} of {component.origin} must return an OccupancyGrid, "
            f"got {short_repr(grid)}"
        )
    return grid


def _detect_format(path: Path) -> str | None:
    """Return the suffix of the format detected from the first bytes of a file, None if unknown."""
    head = read_head(path, _HEAD, "map", InvalidMap)
    for magic, suffix in _MAGIC_BYTES.items():
        if head.startswith(magic):
            return suffix
    # a text map consists of cell characters and line ends only, and not of spaces alone
    cells = "".join(ASCII_CELLS).encode()
    return ".txt" if head.strip() and not head.strip(cells + b"\r\n") else None
