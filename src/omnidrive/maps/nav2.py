"""Maps in the format of ROS 2 Nav2's map server: a YAML file beside an image."""

from __future__ import annotations

from math import isfinite, nan
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import yaml
from jaxtyping import UInt8
from PIL import Image

from omnidrive.arrays import Array
from omnidrive.errors import CannotWrite, InvalidMap, closest
from omnidrive.files.bounded_file import one_line, short_repr
from omnidrive.files.yaml_file import read_yaml
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.kinds import FREE, TAKEN, UNKNOWN, Unknown, occupied
from omnidrive.maps.picture import read_picture
from omnidrive.maps.source import refuse_resolution

Mode = Literal["trinary", "scale", "raw"]

_KEYS = ("image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_MOST_OF_RAW = 100  # a raw pixel is an occupancy in percent; more is unknown


def load_nav2_map(path: Path, *, unknown: Unknown = "occupied") -> OccupancyGrid:
    """Read a Nav2 map.

    The rules are those of ``nav2_map_server/src/map_io.cpp`` since 2025. With p the grey of a pixel
    (0 to 255; of a colour, its luma), occupancy is 1 - p / 255, or p / 255 if ``negate``. In the
    modes ``trinary`` and ``scale``, a cell is free where that is at most ``free_thresh``, an
    obstacle where it is at least ``occupied_thresh``, and else unknown (``scale`` grades such
    cells, but grades do not say whether they are free); one that is not opaque is unknown. In the
    mode ``raw``, p is the occupancy in percent, whatever ``negate`` and the opacity; above 100 it
    is unknown, else compared to the thresholds in whole percent, as Nav2 compares it to save the
    map as ``trinary``. The image's last row is the map's first.

    Args:
        path: The YAML file; ``image`` is looked up beside it.
        unknown: What unknown cells count as.

    Raises:
        InvalidMap: The file is missing, malformed or too large.
    """
    meta = read_yaml(path, "map", InvalidMap)
    if not isinstance(meta, dict):
        raise InvalidMap(f"{path} is not a Nav2 map: it must set image, resolution and origin")
    for key in meta:
        if key not in _KEYS:
            near = closest(str(key), _KEYS, cutoff=0.75)
            if near:  # other keys are those of other programs
                raise InvalidMap(f"{path}: unknown key {short_repr(key)}; did you mean '{near}'?")
    resolution = _number(path, meta, "resolution")
    refuse_resolution(resolution, one_line(str(path)))
    table = _kinds_of_greys(path, meta)
    x, y, yaw = _origin(path, meta)
    if not isinstance(meta.get("image"), str):
        raise InvalidMap(f"{path} does not set 'image', the name of the map's picture")
    grey, opaque = read_picture(path.parent / meta["image"])
    kinds = table[grey]
    if opaque is not None and meta.get("mode") != "raw":
        kinds[~opaque] = UNKNOWN
    return OccupancyGrid(occupied(kinds[::-1], unknown), resolution, (x, y), yaw=yaw)


def _kinds_of_greys(path: Path, meta: dict[Any, Any]) -> UInt8[Array, " 256"]:
    """Kind of a cell by the grey of its pixel, 0 to 255."""
    free = _number(path, meta, "free_thresh")
    taken = _number(path, meta, "occupied_thresh")
    if not 0.0 <= free < taken <= 1.0:
        raise InvalidMap(
            f"{path}: free_thresh ({free:g}) must be below occupied_thresh ({taken:g}), "
            "both in 0 to 1"
        )
    mode = meta.get("mode", "trinary")
    if mode not in get_args(Mode):  # a tuple: a list has no hash
        raise InvalidMap(
            f"{path}: mode {short_repr(mode)} is not one of {', '.join(get_args(Mode))}"
        )
    negate = _number(path, meta, "negate", default=0.0) != 0.0
    return kinds_of_greys(mode, negate=negate, free_thresh=free, occupied_thresh=taken)


def kinds_of_greys(
    mode: Mode, *, negate: bool, free_thresh: float, occupied_thresh: float
) -> UInt8[Array, " 256"]:
    """Kind of a cell by the grey of its opaque pixel, 0 to 255; see :func:`load_nav2_map`.

    In single precision, as Nav2 computes it: thresholds that a grey meets exactly are inclusive
    only up to its rounding.
    """
    greys = np.arange(256)
    if mode == "raw":
        free, taken = np.rint((100.0 * free_thresh, 100.0 * occupied_thresh))
        kinds = np.where(greys <= free, FREE, np.where(greys >= taken, TAKEN, UNKNOWN))
        return np.where(greys <= _MOST_OF_RAW, kinds, UNKNOWN).astype(np.uint8)
    shade = greys.astype(np.float32) / np.float32(255.0)
    occupancy = shade if negate else np.float32(1.0) - shade
    taken_or_not = np.where(occupancy >= np.float32(occupied_thresh), TAKEN, UNKNOWN)
    return np.where(occupancy <= np.float32(free_thresh), FREE, taken_or_not).astype(np.uint8)


def save_nav2_map(grid: OccupancyGrid, path: Path) -> None:
    """Write ``path`` (YAML) and a PGM image of the same stem; :func:`load_nav2_map` reads both.

    The format does not say whether the outside is taken; it is, when the map is read.

    Raises:
        InvalidMap: Nav2 maps have no such resolution, or ``path`` ends in another way.
        CannotWrite: A file cannot be written.
    """
    name = one_line(str(path))
    if path.suffix.lower() not in {".yaml", ".yml"}:
        raise InvalidMap(f"{name}: a Nav2 map is saved as .yaml, with its picture beside it")
    refuse_resolution(grid.resolution, name)
    image = path.with_suffix(".pgm")
    pixels = np.where(grid.occupied[::-1], 0, 254).astype(np.uint8)
    meta = {
        "image": image.name,
        "mode": "trinary",
        "resolution": float(grid.resolution),
        "origin": [float(number) for number in (*grid.origin, grid.yaw)],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.25,
    }
    try:
        Image.fromarray(pixels).save(image)
        path.write_text(yaml.safe_dump(meta, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise CannotWrite(f"cannot write the map {name}: {error.strerror or error}") from None


def _number(path: Path, meta: dict[Any, Any], key: str, default: float | None = None) -> float:
    value = meta.get(key, default)
    if value is None:
        raise InvalidMap(f"{path} does not set '{key}'")
    number = _as_float(value)
    if not isfinite(number):
        raise InvalidMap(f"{path}: {key} must be a number, got {short_repr(value)}")
    return number


def _as_float(value: Any) -> float:
    """``value`` as a number, NaN if it is none; YAML 1.1 takes 5e-2 for text, Nav2 does not."""
    try:
        return float(value) if isinstance(value, (int, float, str)) else nan
    except ValueError:
        return nan


def _origin(path: Path, meta: dict[Any, Any]) -> tuple[float, float, float]:
    origin: Any = meta.get("origin")
    numbers = [_as_float(v) for v in origin] if isinstance(origin, list) else []
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise InvalidMap(
            f"{path}: origin must be [x, y, yaw] in m, m, rad, got {short_repr(origin)}"
        )
    x, y, yaw = numbers
    return x, y, yaw
