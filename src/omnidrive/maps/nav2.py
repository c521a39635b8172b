"""Maps in the format of ROS 2 Nav2's map server: a YAML file beside an image."""

from __future__ import annotations

import warnings
from difflib import get_close_matches
from math import isfinite, nan
from pathlib import Path
from stat import S_ISREG
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float
from PIL import Image, UnidentifiedImageError
from PIL.ImageFile import ImageFile

from omnidrive.errors import InvalidMap
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.yaml_file import one_line, read_yaml, shown

Array = np.ndarray

_KEYS = ("image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_FINEST, _COARSEST = 1e-3, 10.0  # m per cell; beyond, the unit is wrong
_MAX_CELLS = 50_000_000
_FORMATS = ("PPM", "PNG", "BMP")  # PPM: PGM and PBM as well
_GREY = {"1", "L", "LA"}
_COLOUR = {"P", "PA", "RGB", "RGBA"}
_GREY_16_BIT = {"I", "I;16", "I;16B"}  # I: how Pillow reads a PGM of more than 256 shades


def load_nav2_map(path: Path) -> OccupancyGrid:
    """Read a Nav2 map; cells that are not known to be free count as obstacles.

    The rules are those of nav2_map_server for the modes `trinary` and `scale`: with p the mean of a
    pixel's colours, occupancy is 1 - p / 255 (p / 255 if `negate`), a cell is free where it is at
    most `free_thresh`; one that is not opaque is never free. The image's last row is the map's
    first.

    Args:
        path: The YAML file; `image` is looked up beside it.

    Raises:
        InvalidMap: The file is missing, malformed, too large or uses `raw` mode or a turned origin.
    """
    meta = read_yaml(path, "map", InvalidMap)
    if not isinstance(meta, dict):
        raise InvalidMap(f"{path} is not a Nav2 map: it must set image, resolution and origin")
    for key in meta:
        if key not in _KEYS:
            near = get_close_matches(str(key), _KEYS, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(_KEYS)}"
            raise InvalidMap(f"{path}: unknown key {shown(key)}; {hint}")
    resolution = _number(path, meta, "resolution")
    if not _FINEST <= resolution <= _COARSEST:
        raise InvalidMap(
            f"{path}: resolution is {resolution:g} m per cell, "
            f"need {_FINEST:g} to {_COARSEST:g} m per cell"
        )
    free_below = _number(path, meta, "free_thresh")
    occupied_above = _number(path, meta, "occupied_thresh")
    if not 0.0 <= free_below < occupied_above <= 1.0:
        raise InvalidMap(
            f"{path}: free_thresh ({free_below:g}) must be below occupied_thresh "
            f"({occupied_above:g}), both in 0 to 1"
        )
    mode = meta.get("mode", "trinary")
    if mode not in ("trinary", "scale"):  # a tuple: a list has no hash
        raise InvalidMap(f"{path}: mode {shown(mode)} is not read; use trinary or scale")
    negate = _number(path, meta, "negate", default=0.0) != 0.0
    origin = _origin(path, meta)
    shade = _read_image(path, meta)
    occupancy = shade if negate else 1.0 - shade
    return OccupancyGrid(~(occupancy[::-1] <= free_below), resolution, origin)  # NaN: not free


def save_nav2_map(grid: OccupancyGrid, path: Path) -> None:
    """Write ``path`` (YAML) and a PGM image of the same stem; :func:`load_nav2_map` reads both."""
    image = path.with_suffix(".pgm")
    pixels = np.where(grid.occupied[::-1], 0, 254).astype(np.uint8)
    Image.fromarray(pixels).save(image)
    meta = {
        "image": image.name,
        "mode": "trinary",
        "resolution": grid.resolution,
        "origin": [*grid.origin, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.25,
    }
    path.write_text(yaml.safe_dump(meta, sort_keys=False))


def _number(path: Path, meta: dict[Any, Any], key: str, default: float | None = None) -> float:
    value = meta.get(key, default)
    if value is None:
        raise InvalidMap(f"{path} does not set '{key}'")
    number = _as_float(value)
    if not isfinite(number):
        raise InvalidMap(f"{path}: {key} must be a number, got {shown(value)}")
    return number


def _as_float(value: Any) -> float:
    """``value`` as a number, NaN if it is none; YAML 1.1 takes 5e-2 for text, Nav2 does not."""
    try:
        return float(value) if isinstance(value, (int, float, str)) else nan
    except ValueError:
        return nan


def _origin(path: Path, meta: dict[Any, Any]) -> tuple[float, float]:
    origin: Any = meta.get("origin")
    numbers = [_as_float(v) for v in origin] if isinstance(origin, list) else []
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise InvalidMap(f"{path}: origin must be [x, y, yaw] in m, m, rad, got {shown(origin)}")
    x, y, yaw = numbers
    if yaw != 0.0:
        raise InvalidMap(f"{path}: the origin's yaw is {yaw:g} rad; only 0 is read")
    return x, y


def _read_image(path: Path, meta: dict[Any, Any]) -> Float[Array, "rows cols"]:
    """Shades from 0 (black) to 1 (white), NaN where the picture is not opaque."""
    if not isinstance(meta.get("image"), str):
        raise InvalidMap(f"{path} does not set 'image', the name of the map's picture")
    file = path.parent / meta["image"]
    name = one_line(str(file))
    try:
        return _decode(file, name)
    except InvalidMap:
        raise
    except Image.DecompressionBombError:
        raise InvalidMap(f"{name} has more than {_MAX_CELLS:,} cells") from None
    except (UnidentifiedImageError, SyntaxError, ValueError):
        raise InvalidMap(f"{name} is not a picture (PGM, PNG or BMP), or an empty one") from None
    except OSError as error:
        raise InvalidMap(
            f"cannot read the map's picture {name}: {error.strerror or error}"
        ) from None


def _decode(file: Path, name: str) -> Float[Array, "rows cols"]:
    if not S_ISREG(file.stat().st_mode):  # a pipe would be waited for
        raise InvalidMap(f"cannot read the map's picture {name}: it is not a file")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow warns of what is refused here
        with Image.open(file, formats=_FORMATS) as image:
            return _shades(image, name)


def _shades(image: ImageFile, name: str) -> Float[Array, "rows cols"]:
    if image.width * image.height > _MAX_CELLS:
        raise InvalidMap(f"{name} has more than {_MAX_CELLS:,} cells")
    if image.mode in _GREY_16_BIT:
        grey = np.asarray(image, dtype=float)
        return np.where(grey == image.info.get("transparency"), nan, grey / 65535.0)
    if image.mode not in _GREY | _COLOUR:
        raise InvalidMap(
            f"{name} has pixels of the kind {image.mode}; save it as grey, RGB or RGBA"
        )
    if image.mode == "L" and "transparency" in image.info:
        # of a picture with 4 or 16 shades, Pillow scales the pixels but not the transparent shade
        image.info["transparency"] *= {"L;2": 85, "L;4": 17}.get(str(image.tile[0][3]), 1)
    layers = np.asarray(image.convert("LA" if image.mode in _GREY else "RGBA"))
    shade = layers[..., :-1].mean(axis=2) / 255.0
    return np.where(layers[..., -1] == 255, shade, nan)
