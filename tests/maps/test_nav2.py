"""Nav2 maps: rules of the map server, real maps and malformed files."""

import os
from fractions import Fraction
from inspect import unwrap

import numpy as np
import pytest
import yaml
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from omnidrive.errors import InvalidInput, InvalidMap
from omnidrive.maps import OccupancyGrid, load_nav2_map, save_nav2_map
from omnidrive.maps.kinds import FREE, OCCUPIED, UNKNOWN
from omnidrive.maps.nav2 import kinds_of_greys
from tests.examples import examples
from tests.shared_data import shared

META = {
    "image": "map.pgm",
    "resolution": 0.1,
    "origin": [1.0, -2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.25,
}


def write(folder, pixels=None, **changes):
    meta = {k: v for k, v in {**META, **changes}.items() if v is not None}
    pixels = np.full((3, 4), 254) if pixels is None else np.asarray(pixels)
    Image.fromarray(pixels.astype(np.uint8)).save(folder / "map.pgm")
    (folder / "map.yaml").write_text(yaml.safe_dump(meta))
    return folder / "map.yaml"


def is_short_line(folder, error):
    text = str(error).replace(str(folder), "")
    return text.encode() and text.isprintable() and len(text) < 600


def test_last_image_row_is_row_0_of_the_grid(tmp_path):
    grid = load_nav2_map(write(tmp_path, [[254, 254], [254, 254], [0, 254]]))
    assert grid.occupied.tolist() == [[True, False], [False, False], [False, False]]
    assert grid.centre(0, 0) == pytest.approx((1.05, -1.95))


@pytest.mark.parametrize(
    ("mode", "negate", "free_thresh", "occupied_thresh", "free", "taken"),
    # computed by hand: ranges of free and of occupied grey values; the others are unknown
    [
        ("trinary", 0, 0.25, 0.65, (192, 255), (0, 89)),  # 63.75 and 165.75 less than 255
        (
            "trinary",
            0,
            0.196,
            0.65,
            (206, 255),
            (0, 89),
        ),  # 205, the usual grey of unknown cells: 0.19608
        ("trinary", 0, 0.1, 0.65, (230, 255), (0, 89)),
        ("trinary", 0, 0.2, 0.8, (204, 255), (0, 51)),  # 204 and 51 meet the thresholds
        ("trinary", 0, 0.0, 1.0, (255, 255), (0, 0)),
        ("trinary", 1, 0.25, 0.65, (0, 63), (166, 255)),
        ("trinary", 1, 0.2, 0.8, (0, 51), (204, 255)),
        ("scale", 0, 0.196, 0.65, (205, 255), (0, 89)),  # grade of 205: 0.02
        ("scale", 1, 0.25, 0.65, (0, 64), (166, 255)),  # grade of 64: 0.25
        ("scale", 0, 0.0, 1.0, (254, 255), (0, 1)),  # grades of 254 and 1: 0.4 and 99.6
        ("Trinary", 0, 0.25, 0.65, (192, 255), (0, 89)),
        ("SCALE", 0, 0.0, 1.0, (254, 255), (0, 1)),
        ("Raw", 0, 0.25, 0.65, (0, 25), (65, 100)),
        ("raw", 0, 0.25, 0.65, (0, 25), (65, 100)),
        ("raw", 1, 0.25, 0.65, (0, 25), (65, 100)),  # raw ignores negate
        ("raw", 0, 0.196, 0.9, (0, 20), (90, 100)),  # in whole percent
        ("raw", 0, 0.0, 1.0, (0, 0), (100, 100)),
    ],
)
@pytest.mark.parametrize("unknown", ["occupied", "free"])
def test_kinds_of_grey_values(
    tmp_path, mode, negate, free_thresh, occupied_thresh, free, taken, unknown
):
    path = write(
        tmp_path, [range(256)], mode=mode, negate=negate, free_thresh=free_thresh,
        occupied_thresh=occupied_thresh,
    )  # fmt: skip
    expected = [unknown == "occupied"] * 256
    expected[free[0] : free[1] + 1] = [False] * (free[1] - free[0] + 1)
    expected[taken[0] : taken[1] + 1] = [True] * (taken[1] - taken[0] + 1)
    assert load_nav2_map(path, unknown=unknown).occupied[0].tolist() == expected


def test_default_mode_is_trinary_without_negation(tmp_path):
    path = write(tmp_path, [[0, 100, 255]], mode=None, negate=None)
    assert load_nav2_map(path).occupied.tolist() == [[True, True, False]]


@examples(30)
@given(
    negate=st.booleans(), low=st.floats(0, 1), high=st.floats(0, 1),
    mode=st.sampled_from(["trinary", "scale"]),
)  # fmt: skip
def test_grey_values_against_exact_fractions(negate, low, high, mode):
    """Exact arithmetic, except within single precision of a threshold."""
    low, high = sorted((low, high))
    assume(high - low > 1e-3)
    kinds = kinds_of_greys(mode, negate=negate, free_thresh=low, occupied_thresh=high)
    half_grade = Fraction(1, 200) * (Fraction(high) - Fraction(low)) if mode == "scale" else 0
    free, taken = Fraction(low) + half_grade, Fraction(high) - half_grade
    for grey in range(256):
        occupancy = Fraction(grey if negate else 255 - grey, 255)
        if min(abs(occupancy - free), abs(occupancy - taken)) < 1e-6:
            continue
        expected = FREE if occupancy <= free else OCCUPIED if occupancy >= taken else UNKNOWN
        assert kinds[grey] == expected


def test_invalid_treatment_of_unknown_cells_is_rejected():
    with pytest.raises(
        InvalidInput,
        match="there is no treatment of unknown cells 'grey'; there are occupied, free",
    ):
        unwrap(load_nav2_map)("absent.yaml", unknown="grey")


def test_rotated_map(tmp_path):
    grid = load_nav2_map(write(tmp_path, [[254, 0], [254, 254]], origin=[1.0, 2.0, 0.5]))
    assert grid.yaw == 0.5
    corner = complex(1.0, 2.0) + complex(0.15, 0.15) * np.exp(0.5j)
    assert grid.centre(1, 1) == pytest.approx((corner.real, corner.imag))
    assert grid.is_occupied(*grid.centre(1, 1))


@examples(20)
@given(
    occupied=arrays(bool, (3, 5)), x=st.floats(-50, 50), y=st.floats(-50, 50), yaw=st.floats(-7, 7),
    unknown=st.sampled_from(["occupied", "free"]),
)  # fmt: skip
def test_round_trip(tmp_path_factory, occupied, x, y, yaw, unknown):
    path = tmp_path_factory.mktemp("map") / "saved.yaml"
    origin = np.array([x, y])
    save_nav2_map(OccupancyGrid(occupied, 0.05, (origin[0], origin[1]), yaw=yaw), path)
    again = load_nav2_map(path, unknown=unknown)
    assert (again.occupied == occupied).all()
    assert (again.resolution, again.origin, again.yaw) == (0.05, (x, y), yaw)


@pytest.mark.parametrize(
    ("name", "shape", "free", "taken"),
    [
        ("depot", (307, 604), 179481, 5947),
        ("tb3_sandbox", (384, 384), 7903, 870),
        ("smoothers_world", (300, 300), 79424, 10576),
        ("demo_map", (400, 400), 49371, 5714),
    ],
)
def test_real_maps(name, shape, free, taken):
    path = shared(f"maps/nav2/{name}.yaml")
    grid = load_nav2_map(path)
    assert grid.occupied.shape == shape
    assert np.count_nonzero(~grid.occupied) == free
    assert np.count_nonzero(load_nav2_map(path, unknown="free").occupied) == taken


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"resolution": 0.0}, r"map.yaml: resolution is 0 m per cell, need 0\.001 to 10 m"),
        ({"resolution": -0.05}, "resolution is -0.05 m per cell, need"),
        ({"resolution": 50}, "resolution is 50 m per cell, need"),
        ({"resolutoin": 0.05}, "unknown key 'resolutoin'; did you mean 'resolution'"),
        ({"resolution": "5 cm"}, "resolution must be a number, got '5 cm'"),
        ({"resolution": None}, "does not set 'resolution'"),
        ({"origin": [0, 0]}, r"origin must be \[x, y, yaw\]"),
        ({"origin": [1e308, 0, 0]}, r"map.yaml: the origin .* is more than 1e\+12 cells of 0.1 m"),
        ({"mode": None, "origin": [0, -1e13, 0.3]}, "move the map nearer to it"),
        ({"mode": "Trinari"}, "mode 'Trinari' is not one of trinary, scale, raw"),
        ({"origin": [0, float("nan"), 0]}, r"origin must be \[x, y, yaw\]"),
        ({"origin": [0, 0, "east"]}, r"origin must be \[x, y, yaw\]"),
        ({"free_thresh": 0.7}, "free_thresh .0.7. must be below"),
        ({"mode": "rgb"}, "mode 'rgb' is not one of trinary, scale, raw"),
        ({"image": "no.pgm"}, "map.yaml: cannot read the map's image .*no.pgm: No such file"),
        ({"image": None}, "does not set 'image'"),
        ({"image": "map.yaml"}, "map.yaml: .*map.yaml is not an image"),
        ({"image": "a\0b"}, r"a\\x00b: embedded null byte"),
        ({"image": "a\nb"}, r"a\\nb: No such file"),
        ({"image": "b" * 5000}, r"bbb\.\.\.: File name too long"),
        ({"image": "."}, "cannot read the map's image .* is not a file"),
        ({"image": "loop.pgm"}, "cannot read the map's image .*: Too many levels"),
        ({"image": "pipe.pgm"}, "cannot read the map's image .* is not a file"),
        ({"mode": ["raw"]}, r"mode \['raw'\] is not one of"),
        ({"resolution": "nan"}, "resolution must be a number, got 'nan'"),
        ({"resolution": "0.0_5"}, "resolution must be a number, got '0.0_5'"),
        ({"resolution": "0.٠5"}, "resolution must be a number"),
        ({"resolution": int("9" * 400)}, "is not a YAML map: found an integer beyond"),
        ({"resolution": "x" * 9000}, r"resolution must be a number, got 'xxx[x]*\.\.\.$"),
        ({"origin": [[1] * 3000, 0, 0]}, r"origin must be .* got \[\[1, [1, ]*\.\.\.$"),
        ({"origin": "123"}, r"origin must be \[x, y, yaw\]"),
    ],
)
def test_malformed_map_is_reported(tmp_path, changes, message):
    (tmp_path / "loop.pgm").symlink_to("loop.pgm")
    os.mkfifo(tmp_path / "pipe.pgm")
    with pytest.raises(InvalidMap, match=message) as caught:
        load_nav2_map(write(tmp_path, **changes))
    assert is_short_line(tmp_path, caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image: [unclosed", "is not a YAML map"),
        ("just words", "is not a Nav2 map"),
        ("!!python/object/apply:os.system ['true']", "is not a YAML map"),
        ("f: &f [1]\norigin: *f", "is not a YAML map: aliases"),
        ("a: !!bool maybe", "is not a YAML map"),
        ("a: !!int ''", "is not a YAML map"),
        ("a: !!timestamp soon", "is not a YAML map"),
        ("a: \0", "is not a YAML map"),
        (b"a: \xff", "is not a YAML map: 'utf-8' codec"),
        ("[" * 50_000, "is not a YAML map: it is nested more than 30 deep"),
        ("a: &a [1]\n" + "x" * 200_000, "too large"),
    ],
)
def test_malformed_yaml_is_rejected(tmp_path, text, message):
    path = tmp_path / "map.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InvalidMap, match=message) as caught:
        load_nav2_map(path)
    assert is_short_line(tmp_path, caught.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("folder", "cannot read the map .*folder: it is not a file"),
        ("loop", "cannot read the map .*loop: Too many levels"),
        ("a\0b", r"cannot read the map .*a\\x00b: embedded null byte"),
    ],
)
def test_path_that_is_not_a_file_is_rejected(tmp_path, name, message):
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(InvalidMap, match=message):
        load_nav2_map(tmp_path / name)


@pytest.mark.parametrize("number", ["1_000", "1:30", "0x10", "0b1", "1_0.5", "1:30.5"])
def test_numbers_of_yaml_in_other_notations_are_rejected(tmp_path, number):
    path = write(tmp_path, origin=[1234, 0, 0])
    path.write_text(path.read_text().replace("1234", number))
    with pytest.raises(InvalidMap, match=r"origin must be .* got \['" + number):
        load_nav2_map(path)


def test_number_with_leading_zeros_is_decimal(tmp_path):
    path = write(tmp_path, origin=[1234, 0, 0])
    path.write_text(path.read_text().replace("1234", "010"))
    assert load_nav2_map(path).origin == (10.0, 0.0)


def test_numbers_with_exponent_but_without_point(tmp_path):
    """YAML 1.1 reads such a number as text."""
    path = write(tmp_path)
    text = path.read_text().replace("0.1", "5e-2").replace("- -2.0", "- -2e0")
    assert "5e-2" in text
    assert "- -2e0" in text
    path.write_text(text)
    assert load_nav2_map(path).resolution == 0.05
    assert load_nav2_map(path).origin == (1.0, -2.0)


ODD_VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.dates(),
    st.text(),
    st.binary(),
    st.sampled_from([10**400, "5e-2", "\0", "a\nb", "\x1b[2J", "map.pgm", "raw", "."]),
)
ODD_STRUCTURES = st.recursive(
    ODD_VALUES,
    lambda v: st.lists(v, max_size=4) | st.dictionaries(ODD_VALUES, v, max_size=3),
    max_leaves=6,
)


@st.composite
def mutated(draw):
    """Draw a valid YAML file with one value, key or piece of text replaced."""
    meta = dict(META)
    key = draw(st.sampled_from(sorted(meta)))
    change = draw(st.sampled_from(["value", "key", "text"]))
    if change == "value":
        meta[key] = draw(ODD_STRUCTURES)
    elif change == "key":
        meta[draw(ODD_VALUES)] = meta.pop(key)
    text = yaml.safe_dump(meta)
    if change == "text":
        a, b = sorted(draw(st.tuples(*[st.integers(0, len(text))] * 2)))
        text = (
            text[:a]
            + draw(st.text() | st.text("[]{}:,-&*!|>'\"#%@`? \n\t0.e", max_size=9))
            + text[b:]
        )
    return text.encode(errors="surrogatepass")


@examples(200)
@given(content=mutated() | st.binary() | st.text().map(str.encode))
def test_mutated_yaml_raises_only_invalid_map(tmp_path_factory, content):
    path = write(tmp_path_factory.mktemp("map"))
    path.write_bytes(content)
    try:
        load_nav2_map(path)
    except InvalidMap as error:
        assert is_short_line(path.parent, error)  # noqa: PT017


def test_missing_map_is_reported(tmp_path):
    with pytest.raises(InvalidMap, match=r"cannot read the map .*none.yaml: No such file"):
        load_nav2_map(tmp_path / "none.yaml")
