"""Images of maps: grey values and opacity of the pixels."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Bool, UInt8
from PIL import Image, UnidentifiedImageError
from PIL.ImageFile import ImageFile

from omnidrive.arrays import Array
from omnidrive.errors import InvalidMap, one_line
from omnidrive.files.bounded_file import open_file
from omnidrive.maps.map_file import MAX_CELLS

_FORMATS = ("PPM", "PNG", "BMP")  # PPM: PGM and PBM as well
_GREY = {"1", "L", "LA"}
_INDEXED = {"P", "PA"}
_COLOUR = {*_INDEXED, "RGB", "RGBA"}
_GREY_16_BIT = {"I", "I;16", "I;16B"}  # I: mode of a PGM with more than 256 grey values in Pillow

Pixels = tuple[UInt8[Array, "rows cols"], Bool[Array, "rows cols"] | None]


def read_image(file: Path) -> Pixels:
    """Read a PGM, PNG or BMP image, the top row first.

    Returns:
        Grey values from 0 (black) to 255 (white); a colour is reduced to its luma 0.299 R + 0.587 G
        + 0.114 B (ITU-R BT.601), and 16 bits are rounded to 8. And whether each pixel is fully
        opaque, None if all are.

    Raises:
        InvalidMap: The file is missing, malformed or too large.
    """
    name = one_line(str(file))
    with open_file(file, "map's image", InvalidMap) as content:
        try:
            return _decode(content, name)
        except InvalidMap:
            raise
        except Image.DecompressionBombError:
            raise InvalidMap(f"{name} has more than {MAX_CELLS:,} cells; crop it") from None
        except (UnidentifiedImageError, SyntaxError, ValueError):
            raise InvalidMap(f"{name} is not an image (PGM, PNG or BMP), or it is empty") from None


def _decode(content: BinaryIO, name: str) -> Pixels:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow warns about sizes that are rejected below
        with Image.open(content, formats=_FORMATS) as image:
            if image.width * image.height > MAX_CELLS:
                raise Image.DecompressionBombError
            return _pixels(image, name)


def _pixels(image: ImageFile, name: str) -> Pixels:
    if image.mode in _GREY_16_BIT:
        wide = np.asarray(image).astype(np.int32)
        transparent = image.info.get("transparency")
        grey = ((wide + 128) // 257).astype(np.uint8)
        return grey, None if transparent is None else wide != transparent
    if image.mode not in _GREY | _COLOUR:
        raise InvalidMap(
            f"{name} has the pixel mode {image.mode}; save it as greyscale, RGB or RGBA"
        )
    if image.mode in _INDEXED:
        colours = len(image.getpalette() or ()) // 3
        if int(np.asarray(image).max()) >= colours:
            raise InvalidMap(
                f"{name} has no colour for some of its pixels: its palette has {colours} entries; "
                "save it as greyscale"
            )
    if image.mode == "L" and "transparency" in image.info:
        # for 4 or 16 grey values, Pillow scales the pixels but not the transparent value
        image.info["transparency"] *= {"L;2": 85, "L;4": 17}.get(str(image.tile[0][3]), 1)
    if "A" not in image.getbands() and "transparency" not in image.info:
        return np.array(image.convert("L")), None
    layers = image.convert("LA" if image.mode in _GREY else "RGBA")
    return np.array(layers.convert("L")), np.asarray(layers.getchannel("A")) == 255
