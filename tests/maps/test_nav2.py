"""Nav2 maps: the rules of its map server, real maps, and hostile files."""

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from omnidrive.errors import InvalidMap
from omnidrive.maps import OccupancyGrid, load_nav2_map, save_nav2_map
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


def test_the_last_row_of_the_picture_is_the_first_of_the_map(tmp_path):
    grid = load_nav2_map(write(tmp_path, [[254, 254], [254, 254], [0, 254]]))
    assert grid.occupied.tolist() == [[True, False], [False, False], [False, False]]
    assert grid.centre(0, 0) == pytest.approx((1.05, -1.95))


@pytest.mark.parametrize(
    ("shade", "negate", "free_thresh", "free"),
    [
        (254, 0, 0.25, True),
        (205, 0, 0.25, True),  # 205: 0.196 occupied; the grey of unknown cells
        (205, 0, 0.196, False),
        (205, 0, 0.1, False),
        (0, 0, 0.25, False),
        (0, 1, 0.25, True),
        (255, 1, 0.25, False),
        (204, 0, 0.2, True),  # exactly 0.2: thresholds are inclusive
    ],
)
def test_which_shades_are_free(tmp_path, shade, negate, free_thresh, free):
    path = write(tmp_path, [[shade]], negate=negate, free_thresh=free_thresh)
    assert load_nav2_map(path).occupied[0, 0] == (not free)


def test_colours_are_averaged(tmp_path):
    Image.fromarray(np.array([[[255, 255, 0]]], np.uint8)).save(tmp_path / "map.png")
    path = write(tmp_path, image="map.png", free_thresh=0.4)
    assert not load_nav2_map(path).occupied[0, 0]
    path = write(tmp_path, image="map.png", free_thresh=0.3)
    assert load_nav2_map(path).occupied[0, 0]


@settings(max_examples=20, deadline=None)
@given(occupied=arrays(bool, (3, 5)), x=st.floats(-50, 50), y=st.floats(-50, 50))
def test_what_is_saved_is_read_again(tmp_path_factory, occupied, x, y):
    path = tmp_path_factory.mktemp("map") / "saved.yaml"
    save_nav2_map(OccupancyGrid(occupied, 0.05, (x, y)), path)
    again = load_nav2_map(path)
    assert (again.occupied == occupied).all()
    assert (again.resolution, again.origin) == (0.05, (x, y))


@pytest.mark.parametrize(
    ("name", "shape", "free_share"),
    [
        ("depot", (307, 604), 0.968),
        ("tb3_sandbox", (384, 384), 0.054),
        ("smoothers_world", (300, 300), 0.882),
        ("demo_map", (400, 400), 0.309),
    ],
)
def test_real_maps(name, shape, free_share):
    grid = load_nav2_map(shared(f"maps/nav2/{name}.yaml"))
    assert grid.occupied.shape == shape
    assert (~grid.occupied).mean() == pytest.approx(free_share, abs=5e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"resolution": 0.0}, "resolution must be positive"),
        ({"resolution": "5 cm"}, "resolution must be a number, got '5 cm'"),
        ({"resolution": None}, "does not set 'resolution'"),
        ({"origin": [0, 0]}, r"origin must be \[x, y, yaw\]"),
        ({"origin": [0, float("nan"), 0]}, r"origin must be \[x, y, yaw\]"),
        ({"origin": [0, 0, 1.57]}, "yaw is 1.57 rad; only 0"),
        ({"free_thresh": 0.7}, "free_thresh .0.7. must be below"),
        ({"mode": "raw"}, "mode 'raw' is not read"),
        ({"image": "no.pgm"}, "cannot read the map's picture .*no.pgm: No such file"),
        ({"image": None}, "does not set 'image'"),
        ({"image": "map.yaml"}, "is not a picture"),
    ],
)
def test_a_bad_map_says_what_is_wrong(tmp_path, changes, message):
    with pytest.raises(InvalidMap, match=message):
        load_nav2_map(write(tmp_path, **changes))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image: [unclosed", "is not YAML"),
        ("just words", "is not a Nav2 map"),
        ("!!python/object/apply:os.system ['true']", "is not YAML"),
        ("a: &a [1]\n" + "x" * 200_000, "too large"),
    ],
)
def test_hostile_yaml_is_refused(tmp_path, text, message):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(InvalidMap, match=message):
        load_nav2_map(path)


def test_a_cut_picture_is_refused(tmp_path):
    path = write(tmp_path)
    (tmp_path / "map.pgm").write_bytes((tmp_path / "map.pgm").read_bytes()[:-5])
    with pytest.raises(InvalidMap, match="picture"):
        load_nav2_map(path)


def test_a_missing_map_is_named(tmp_path):
    with pytest.raises(InvalidMap, match=r"cannot read the map .*none.yaml: No such file"):
        load_nav2_map(tmp_path / "none.yaml")
