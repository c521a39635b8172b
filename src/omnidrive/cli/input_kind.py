"""Kind of an input file or folder, by its name and, for YAML, its keys."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Literal

from omnidrive.components import component_names
from omnidrive.errors import InvalidInput, one_line
from omnidrive.files.bounded_file import read_head
from omnidrive.study.output_paths import WAYPOINT_FORMATS

Kind = Literal["map", "waypoints", "scenario"]

FUZZY_SUFFIXES = (".fis", ".fll", ".fcl", ".fml")
"""Suffixes of the files of fuzzy systems, without those of any XML file."""

_HEAD = 65_536  # bytes of a YAML file that are searched for keys


def input_kind(path: Path) -> Kind:
    """Return the kind of a file, a folder or an installed map.

    A folder is a scenario. A YAML file with the key `image` is a map, one with the key `poses` is
    a waypoint file; any other, also one that cannot be read, is a scenario. Other files are
    waypoint files if they have one of their suffixes, else maps. A path without a suffix that does
    not exist is a scenario.
    """
    if str(path) in component_names("maps"):
        return "map"
    if os.path.isdir(path):  # Path.is_dir raises OSError for names that are too long
        return "scenario"
    suffix = path.suffix.lower()
    if suffix in {".yaml", ".yml"}:
        return _yaml_kind(path)
    if suffix in WAYPOINT_FORMATS:
        return "waypoints"
    return "map" if suffix or os.path.isfile(path) else "scenario"


def _yaml_kind(path: Path) -> Kind:
    """Return the kind of a YAML file, found from the keys at its start."""
    try:
        head = read_head(path, _HEAD, "file", InvalidInput)
    except InvalidInput:
        return "scenario"  # the error is reported when it is loaded
    if _has_key(head, b"image"):
        return "map"
    return "waypoints" if _has_key(head, b"poses") else "scenario"


def _has_key(head: bytes, key: bytes) -> bool:
    """Return whether the start of a YAML file has a key, at any level."""
    return re.search(rb"""(?:^|[{,])\s*["']?%b["']?\s*:""" % key, head, re.MULTILINE) is not None


def check_map_name(file: Path) -> None:
    """Raise InvalidInput unless ``file`` is an installed map or has the suffix of a map format."""
    if file.suffix.lower() in FUZZY_SUFFIXES:
        name = one_line(str(file), 60)
        raise InvalidInput(
            f"{name} is a fuzzy system, not a scenario; show it with omnidrive fuzzy show {name}, "
            f"or let it tune gains with --controller fuzzy_t1,fuzzy.file={name}"
        )
    known = component_names("maps")
    if str(file) not in known and file.suffix.lower() not in known:
        maps = ", ".join(name for name in known if name.startswith("."))
        raise InvalidInput(
            f"cannot tell what {one_line(str(file))} is from its name; need a scenario (.yaml or "
            f"its folder), a waypoint file ({', '.join(WAYPOINT_FORMATS[:-1])}), or a map "
            f"({maps}) with --start X,Y and --goal X,Y"
        )
