"""Maps in the format of the ROS 2 Nav2 map server: a YAML file and an image."""

from __future__ import annotations

from math import isfinite, nan
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import yaml
from jaxtyping import Bool, Float32, UInt8
from PIL import Image

from omnidrive.arrays import Array
from omnidrive.choices import Unknown
from omnidrive.errors import InvalidMap, closest, one_line, short_repr
from omnidrive.files.number_text import parse_number
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.image import read_image
from omnidrive.maps.kinds import FREE, OCCUPIED, UNKNOWN, check_unknown, occupied
from omnidrive.maps.map_file import check_resolution

FILTER_KEYS = ("type", "base", "multiplier")
"""Keys of Nav2's costmap filters, which may stand beside those of a mask's map."""

Mode = Literal["trinary", "scale", "raw"]
MODES: tuple[Mode, ...] = get_args(Mode)

_KEYS = (
    "image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh",
    *FILTER_KEYS,
)  # fmt: skip
_TYPICAL = {
    "resolution": ", the side of a cell in m",
    "free_thresh": ", usually 0.25",
    "occupied_thresh": ", usually 0.65",
}
_MAX_RAW = 100  # a raw pixel is an occupancy in percent; greater values are unknown


def load_nav2_map(path: StrPath, *, unknown: Unknown = "occupied") -> OccupancyGrid:
    """Read a Nav2 map.

    The rules are those of ``nav2_map_server/src/map_io.cpp`` since 2025. Let p be the grey value of
    a pixel, 0 to 255 (the luma of a colour). The occupancy is 1 - p / 255, or p / 255 if
    ``negate``. In the modes ``trinary`` and ``scale``, a cell is free if the occupancy is at most
    ``free_thresh``, an obstacle if it is at least ``occupied_thresh``, and unknown otherwise or if
    the pixel is not opaque. The mode ``scale`` maps the occupancies between the thresholds to
    grades from 0 to 100: a cell whose grade rounds to 0 is free as well, and one whose grade rounds
    to 100 an obstacle. In the mode ``raw``, p is the occupancy in percent, independent of
    ``negate`` and opacity. Above 100 it is unknown; otherwise it is compared with the thresholds in
    whole percent, as Nav2 does when it saves the map as ``trinary``. Upper case in the name of the
    mode is ignored. The last row of the image is row 0 of the grid.

    Args:
        path: The YAML file; ``image`` is relative to its folder.
        unknown: Whether unknown cells count as occupied or free.

    Raises:
        InvalidInput: ``unknown`` is neither "occupied" nor "free".
        InvalidMap: The YAML file or its image is missing or malformed, the map has more than
            50 million cells, or the resolution is out of range.
    """
    check_unknown(unknown)
    file = _read(path)
    kinds = kinds_of_greys(
        file.mode, negate=file.negate, free_thresh=file.free, occupied_thresh=file.occupied
    )[file.grey]
    if file.opaque is not None and file.mode != "raw":
        kinds[~file.opaque] = UNKNOWN
    return file.grid(occupied(kinds[::-1], unknown))


def load_nav2_grades(path: StrPath) -> tuple[OccupancyGrid, Float32[Array, "rows cols"]]:
    """Read the graded occupancies of a Nav2 map, such as a filter mask or a saved costmap.

    Args:
        path: The YAML file, as for :func:`load_nav2_map`, and of every mode. With ``trinary``,
            occupancies are 0 or 100 percent.

    Returns:
        A grid without obstacles in the frame of the map, and the occupancy of each of its cells in
        percent, 0 to 100; NaN where it is unknown.

    Raises:
        InvalidMap: As for :func:`load_nav2_map`.
    """
    file = _read(path)
    grades = grades_of_greys(
        file.mode, negate=file.negate, free_thresh=file.free, occupied_thresh=file.occupied
    )[file.grey]
    if file.opaque is not None and file.mode != "raw":
        grades[~file.opaque] = nan
    return file.grid(np.zeros(grades.shape, bool)), np.ascontiguousarray(grades[::-1])


class _Nav2File(NamedTuple):
    """Content of the files of a map."""

    name: str
    mode: Mode
    negate: bool
    free: float
    occupied: float
    resolution: float
    origin: tuple[float, float, float]
    grey: UInt8[Array, "rows cols"]
    opaque: Bool[Array, "rows cols"] | None

    def grid(self, mask: Bool[Array, "rows cols"]) -> OccupancyGrid:
        """Return a grid in the frame of the map."""
        x, y, yaw = self.origin
        try:
            return OccupancyGrid(mask, self.resolution, (x, y), yaw=yaw)
        except InvalidMap as error:
            raise InvalidMap(f"{self.name}: {error}") from None


def _read(path: StrPath) -> _Nav2File:
    """Read the YAML file and its image."""
    path = to_path(path)
    name = one_line(str(path))
    meta = read_yaml(path, "map", InvalidMap)
    if not isinstance(meta, dict):
        raise InvalidMap(
            f"{name} is not a Nav2 map: it must set 'image', 'resolution' and 'origin'"
        )
    for key in meta:
        if key not in _KEYS:
            near = closest(str(key), _KEYS, cutoff=0.75)
            if near:  # keys without similarity to ours belong to other programs
                raise InvalidMap(f"{name}: unknown key {short_repr(key)}; did you mean '{near}'?")
    resolution = _number(name, meta, "resolution")
    check_resolution(resolution, name)
    mode = _mode(name, meta)
    free, occupied, negate = _thresholds(name, meta)
    origin = _origin(name, meta)
    if not isinstance(meta.get("image"), str):
        raise InvalidMap(f"{name} does not set 'image', the file name of the map's image")
    try:
        grey, opaque = read_image(path.parent / meta["image"])
    except InvalidMap as error:
        raise InvalidMap(f"{name}: {error}") from None
    return _Nav2File(name, mode, negate, free, occupied, resolution, origin, grey, opaque)


def _mode(name: str, meta: dict[Any, Any]) -> Mode:
    """Return the mode, which Nav2 converts to lower case."""
    given = meta.get("mode", "trinary")
    for mode in MODES:
        if isinstance(given, str) and given.lower() == mode:
            return mode
    raise InvalidMap(f"{name}: mode {short_repr(given)} is not one of {', '.join(MODES)}")


def _thresholds(name: str, meta: dict[Any, Any]) -> tuple[float, float, bool]:
    """Return the thresholds of free and occupied cells, and whether the image is negated."""
    free = _number(name, meta, "free_thresh")
    occupied = _number(name, meta, "occupied_thresh")
    if not 0.0 <= free < occupied <= 1.0:
        raise InvalidMap(
            f"{name}: free_thresh ({free:g}) must be below occupied_thresh ({occupied:g}), "
            "both from 0 to 1"
        )
    return free, occupied, _number(name, meta, "negate", default=0.0) != 0.0


def kinds_of_greys(
    mode: Mode, *, negate: bool, free_thresh: float, occupied_thresh: float
) -> UInt8[Array, " 256"]:
    """Return the kind of a cell for each grey value of its opaque pixel; see :func:`load_nav2_map`.

    Computed in single precision, as in Nav2: a grey value exactly at a threshold is included only
    up to rounding.
    """
    greys = np.arange(256)
    if mode == "raw":
        free, occupied = np.rint((100.0 * free_thresh, 100.0 * occupied_thresh))
        kinds = np.where(greys <= free, FREE, np.where(greys >= occupied, OCCUPIED, UNKNOWN))
        return np.where(greys <= _MAX_RAW, kinds, UNKNOWN).astype(np.uint8)
    shade = greys.astype(np.float32) / np.float32(255.0)
    occupancy = shade if negate else np.float32(1.0) - shade
    is_free = occupancy <= np.float32(free_thresh)
    is_occupied = occupancy >= np.float32(occupied_thresh)
    if mode == "scale":
        span = np.float32(occupied_thresh - free_thresh)
        grade = (occupancy - np.float32(free_thresh)) / span * np.float32(100.0)
        # half a grade is rounded up, to 1 and to 100
        is_free |= grade < 0.5
        is_occupied |= grade >= 99.5
    return np.where(is_free, FREE, np.where(is_occupied, OCCUPIED, UNKNOWN)).astype(np.uint8)


def grades_of_greys(
    mode: Mode, *, negate: bool, free_thresh: float, occupied_thresh: float
) -> Float32[Array, " 256"]:
    """Return the occupancy in percent for each grey value of an opaque pixel, NaN if unknown.

    In the mode ``scale`` occupancies between the thresholds have grades from 0 to 100, rounded; in
    the mode ``raw`` the grey value is the grade; see :func:`load_nav2_map`.
    """
    greys = np.arange(256, dtype=np.float32)
    if mode == "raw":
        return np.where(greys <= _MAX_RAW, greys, np.float32(nan))
    kinds = kinds_of_greys(
        mode, negate=negate, free_thresh=free_thresh, occupied_thresh=occupied_thresh
    )
    shade = greys / np.float32(255.0)
    occupancy = shade if negate else np.float32(1.0) - shade
    span = np.float32(occupied_thresh - free_thresh)
    between = np.float32(nan)
    if mode == "scale":
        grade = (occupancy - np.float32(free_thresh)) / span * np.float32(100.0)
        between = np.floor(grade + np.float32(0.5))
    return np.where(kinds == FREE, 0.0, np.where(kinds == OCCUPIED, 100.0, between)).astype(
        np.float32
    )


def save_nav2_map(grid: OccupancyGrid, path: StrPath) -> None:
    """Write ``path`` (YAML) and a PGM image of the same stem, to be read by :func:`load_nav2_map`.

    The format does not store ``walled``; a loaded map is walled.

    Raises:
        InvalidMap: The resolution is out of range, or the suffix is not .yaml or .yml.
        CannotWrite: A file cannot be written.
    """
    path = to_path(path)
    name = one_line(str(path))
    if path.suffix.lower() not in {".yaml", ".yml"}:
        raise InvalidMap(f"{name}: a Nav2 map is saved as .yaml, with its image beside it")
    check_resolution(grid.resolution, name)
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
    with output_file(image) as part:
        Image.fromarray(pixels).save(part, format="PPM")
    with output_file(path) as part:
        part.write_text(yaml.safe_dump(meta, sort_keys=False), encoding="utf-8")


def _number(name: str, meta: dict[Any, Any], key: str, default: float | None = None) -> float:
    value = meta.get(key, default)
    if value is None:
        raise InvalidMap(f"{name} does not set '{key}'{_TYPICAL.get(key, '')}")
    number = _as_float(value)
    if not isfinite(number):
        raise InvalidMap(f"{name}: {key} must be a number, got {short_repr(value)}")
    return number


def _as_float(value: Any) -> float:
    """Return ``value`` as a number or NaN; 5e-2 is text in YAML 1.1, but not in Nav2."""
    if isinstance(value, str):
        number = parse_number(value)
        return nan if number is None else number
    return float(value) if isinstance(value, (int, float)) else nan


def _origin(name: str, meta: dict[Any, Any]) -> tuple[float, float, float]:
    origin: Any = meta.get("origin")
    numbers = [_as_float(v) for v in origin] if isinstance(origin, list) else []
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise InvalidMap(
            f"{name}: origin must be [x, y, yaw] in m, m, rad, got {short_repr(origin)}"
        )
    x, y, yaw = numbers
    return x, y, yaw
