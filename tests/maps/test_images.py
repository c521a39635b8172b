"""Images of maps: pixel formats, opacity, and malformed files."""

import struct
import zlib
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from omnidrive.errors import InvalidMap
from omnidrive.maps import load_nav2_map
from tests.examples import examples
from tests.maps.test_nav2 import write
from tests.memory import allocates_at_most


def image_map(folder, content):
    """Write a map whose image file has these bytes."""
    path = write(folder, image="map.image")
    (folder / "map.image").write_bytes(content)
    return path


def png(depth, kind, row, *chunks):
    """Create a PNG of one row of two pixels."""

    def chunk(name, data):
        crc = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + crc

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 1, depth, kind, 0, 0, 0))
    rest = b"".join(chunk(*c) for c in chunks)
    pixels = chunk(b"IDAT", zlib.compress(b"\0" + row))
    return b"\x89PNG\r\n\x1a\n" + head + rest + pixels + chunk(b"IEND", b"")


GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
BLACK_WHITE = (b"PLTE", b"\0\0\0\xff\xff\xff")


def test_colours_are_reduced_to_luma(tmp_path):
    """Yellow has the luma 0.299 + 0.587 of white."""
    Image.fromarray(np.array([[[255, 255, 0]]], np.uint8)).save(tmp_path / "map.png")
    path = write(tmp_path, image="map.png", free_thresh=0.12)
    assert not load_nav2_map(path).occupied[0, 0]
    path = write(tmp_path, image="map.png", free_thresh=0.11)
    assert load_nav2_map(path).occupied[0, 0]


@pytest.mark.parametrize(
    ("palette", "entries"), [(None, 0), (b"", 0), (b"\xff" * 3, 1), (b"\xff" * 5, 1)]
)
def test_pixels_without_a_colour_in_the_palette_are_rejected(tmp_path, palette, entries):
    chunks = [] if palette is None else [(b"PLTE", palette)]
    (tmp_path / "map.png").write_bytes(png(8, PALETTE, b"\0\1", *chunks))
    path = write(tmp_path, image="map.png")
    with pytest.raises(InvalidMap, match=f"map.png has no colour .* palette has {entries} entries"):
        load_nav2_map(path)
    (tmp_path / "map.png").write_bytes(png(8, PALETTE, b"\0\1", BLACK_WHITE))
    assert load_nav2_map(path).occupied[0].tolist() == [True, False]


def test_truncated_image_is_rejected(tmp_path):
    path = write(tmp_path)
    (tmp_path / "map.pgm").write_bytes((tmp_path / "map.pgm").read_bytes()[:-5])
    with pytest.raises(InvalidMap, match="image"):
        load_nav2_map(path)


@pytest.mark.parametrize(
    ("content", "occupied"),
    [
        # two grey values, 10 % and 90 % white, in 16 bits
        (b"P5 2 1 65535 " + struct.pack(">HH", 6554, 58982), [True, False]),
        (b"P5 2 1 1000 " + struct.pack(">HH", 100, 900), [True, False]),
        (b"P2 2 1 65535 6554 58982\n", [True, False]),
        (b"P6 2 1 65535 " + struct.pack(">6H", *[6554] * 3, *[58982] * 3), [True, False]),
        (png(16, GREY, struct.pack(">HH", 6554, 58982)), [True, False]),
        (png(16, RGB, struct.pack(">6H", *[6554] * 3, *[58982] * 3)), [True, False]),
        # black and white in less than 8 bits
        (b"P4 2 1 \x80", [True, False]),
        (png(1, GREY, b"\x40"), [True, False]),
        (png(4, GREY, b"\x0f"), [True, False]),
        (png(8, PALETTE, b"\0\1", BLACK_WHITE), [True, False]),
        # two white pixels, the first not opaque
        (png(8, GREY_ALPHA, b"\xff\xfe\xff\xff"), [True, False]),
        (png(8, RGBA, b"\xff\xff\xff\0" + b"\xff" * 4), [True, False]),
        (png(16, GREY_ALPHA, b"\xff\xff\0\0" + b"\xff" * 4), [True, False]),
        (png(8, PALETTE, b"\1\0", (b"PLTE", b"\xff" * 6), (b"tRNS", b"\xff\x80")), [True, False]),
        # a white pixel declared transparent, and a light one that is not
        (png(8, GREY, b"\xff\xfe", (b"tRNS", b"\0\xff")), [True, False]),
        (png(4, GREY, b"\xfe", (b"tRNS", b"\0\x0f")), [True, False]),
        (png(2, GREY, b"\xf0", (b"tRNS", b"\0\x03")), [True, True]),
        (png(1, GREY, b"\xc0", (b"tRNS", b"\0\x01")), [True, True]),
        (png(16, GREY, b"\xff\xff\xff\xfe", (b"tRNS", b"\xff\xff")), [True, False]),
        (png(8, RGB, b"\xff" * 5 + b"\xfe", (b"tRNS", b"\0\xff" * 3)), [True, False]),
    ],
)
def test_pixel_formats(tmp_path, content, occupied):
    assert load_nav2_map(image_map(tmp_path, content)).occupied.tolist() == [occupied]


@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize("mode", ["trinary", "Scale"])
def test_transparent_cell_is_unknown(tmp_path, mode, negate):
    for grey in (b"\0", b"\xff"):
        path = image_map(tmp_path, png(8, GREY_ALPHA, (grey + b"\x80") * 2))
        path.write_text(path.read_text().replace("negate: 0", f"negate: {negate}\nmode: {mode}"))
        assert load_nav2_map(path).occupied.all()
        assert not load_nav2_map(path, unknown="free").occupied.any()


def test_raw_mode_ignores_opacity(tmp_path):
    path = image_map(tmp_path, png(8, GREY_ALPHA, b"\x00\x80\x64\x80"))
    path.write_text(path.read_text() + "mode: Raw\n")
    assert load_nav2_map(path).occupied.tolist() == [[False, True]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"P5 20000 20000 255\n", "has more than 50,000,000 cells"),  # Pillow raises an error
        (b"P5 10000 10000 255\n", "has more than 50,000,000 cells"),  # Pillow warns
        (b"P5 8000 8000 255\n", "has more than 50,000,000 cells"),
        (b"P5 0 1 255\n", "is not an image .* or it is empty"),
        (b"P5 1 0 255\n", "is not an image .* or it is empty"),
        (b"", "is not an image"),
        (b"Pf 1 1 -1.0\n\0\0\0\0", "the pixel mode F; save it as greyscale, RGB or RGBA"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n", "is not an image"),
    ],
)
def test_malformed_image_is_reported(tmp_path, content, message):
    with pytest.raises(InvalidMap, match=message):
        load_nav2_map(image_map(tmp_path, content))


def test_length_of_a_chunk_allocates_no_memory(tmp_path):
    """Pillow skips the rest of the chunk of pixels by the length that it states."""
    content = png(8, GREY, b"\xff\xff")
    at = content.index(b"IDAT")
    path = image_map(tmp_path, content[: at - 4] + b"\xef\xff\xff\xff" + content[at:])
    with allocates_at_most(20e6):
        assert load_nav2_map(path).occupied.tolist() == [[False, False]]


IMAGES = [
    b"P5 3 2 255\n" + b"\xfe" * 6,
    b"P2 3 2 9 1 2 3 4 5 6\n",
    png(8, GREY_ALPHA, b"\xff\xfe\xff\xff"),
    png(8, PALETTE, b"\0\1", BLACK_WHITE, (b"tRNS", b"\0")),
    b"BM"
    + struct.pack("<IHHIIiiHHIIiiII", 60, 0, 0, 54, 40, 1, 1, 1, 24, 0, 0, 0, 0, 0, 0)
    + b"\xfe" * 4,
]


@examples(200)
@given(
    content=st.sampled_from(IMAGES), at=st.integers(0, 99), cut=st.integers(0, 9), new=st.binary()
)
def test_mutated_images_raise_only_invalid_map(tmp_path_factory, content, at, cut, new):
    folder = tmp_path_factory.mktemp("map")
    with suppress(InvalidMap):
        load_nav2_map(image_map(folder, content[:at] + new + content[at + cut :]))
