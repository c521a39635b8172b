"""Maps in the format of ROS 2 Nav2's map server: a YAML file beside an image."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float
from PIL import Image, UnidentifiedImageError

from omnidrive.errors import InvalidMap
from omnidrive.maps.grid import OccupancyGrid

Array = np.ndarray

_MAX_YAML_BYTES = 100_000
_MAX_CELLS = 50_000_000


def load_nav2_map(path: Path) -> OccupancyGrid:
    """Read a Nav2 map; cells that are not known to be free count as obstacles.

    The rules are those of nav2_map_server for the modes `trinary` and `scale`: with p the mean of a
    pixel's colours, occupancy is 1 - p / 255 (p / 255 if `negate`), a cell is free where it is at
    most `free_thresh`. The image's last row is the map's first.

    Args:
        path: The YAML file; `image` is looked up beside it.

    Raises:
        InvalidMap: The file is missing, malformed, too large or uses `raw` mode or a turned origin.
    """
    meta = _read_yaml(path)
    resolution = _number(path, meta, "resolution")
    free_below = _number(path, meta, "free_thresh")
    occupied_above = _number(path, meta, "occupied_thresh")
    if not 0.0 <= free_below < occupied_above <= 1.0:
        raise InvalidMap(
            f"{path}: free_thresh ({free_below:g}) must be below occupied_thresh "
            f"({occupied_above:g}), both in 0 to 1"
        )
    if meta.get("mode", "trinary") not in {"trinary", "scale"}:
        raise InvalidMap(f"{path}: mode '{meta['mode']}' is not read; use trinary or scale")
    negate = _number(path, meta, "negate", default=0.0) != 0.0
    shade = _read_image(path, meta) / 255.0
    occupancy = shade if negate else 1.0 - shade
    return OccupancyGrid(occupancy[::-1] > free_below, resolution, _origin(path, meta))


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


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > _MAX_YAML_BYTES:
            raise InvalidMap(f"{path} is too large for a map's YAML file")
        meta = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidMap(f"cannot read the map {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InvalidMap(f"{path} is not YAML: {' '.join(str(error).split())[:200]}") from None
    if not isinstance(meta, dict):
        raise InvalidMap(f"{path} is not a Nav2 map: it must set image, resolution and origin")
    return meta


def _number(path: Path, meta: dict[str, Any], key: str, default: float | None = None) -> float:
    value = meta.get(key, default)
    if value is None:
        raise InvalidMap(f"{path} does not set '{key}'")
    if not isinstance(value, (int, float)) or not isfinite(value):
        raise InvalidMap(f"{path}: {key} must be a number, got {value!r}")
    return float(value)


def _origin(path: Path, meta: dict[str, Any]) -> tuple[float, float]:
    origin: Any = meta.get("origin")
    numbers = isinstance(origin, list) and all(isinstance(v, (int, float)) for v in origin)
    if not numbers or len(origin) != 3 or not all(map(isfinite, origin)):
        raise InvalidMap(f"{path}: origin must be [x, y, yaw] in m, m, rad, got {origin!r}")
    if origin[2] != 0.0:
        raise InvalidMap(f"{path}: the origin's yaw is {origin[2]:g} rad; only 0 is read")
    return float(origin[0]), float(origin[1])


def _read_image(path: Path, meta: dict[str, Any]) -> Float[Array, "rows cols"]:
    if not isinstance(meta.get("image"), str):
        raise InvalidMap(f"{path} does not set 'image', the name of the map's picture")
    file = path.parent / meta["image"]
    try:
        with Image.open(file) as image:
            if image.width * image.height > _MAX_CELLS:
                raise InvalidMap(f"{file} has more than {_MAX_CELLS:,} cells")
            if image.mode == "L":
                return np.asarray(image, dtype=float)
            colours = np.asarray(image.convert("RGB"), dtype=float)
            mean: Float[Array, "rows cols"] = colours.mean(axis=2)
            return mean
    except (UnidentifiedImageError, SyntaxError, ValueError):
        raise InvalidMap(f"{file} is not a picture (PGM, PNG or BMP)") from None
    except OSError as error:
        raise InvalidMap(
            f"cannot read the map's picture {file}: {error.strerror or error}"
        ) from None
