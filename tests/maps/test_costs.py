"""Costs of a map: inflation, keep-out and speed masks of Nav2, lanes, own costs."""

import numpy as np
import pytest
import yaml
from PIL import Image

from omnidrive.errors import InvalidMap
from omnidrive.maps import CostMap, Inflation, Lane, OccupancyGrid, load_costs
from omnidrive.maps.nav2 import load_nav2_grades

GRID = OccupancyGrid(np.zeros((4, 6), bool), 0.5, (-1.0, 2.0))


def mask(tmp_path, pixels, **meta):
    """Write a Nav2 map with these pixels, the top row first."""
    Image.fromarray(np.array(pixels, np.uint8)).save(tmp_path / "mask.pgm", format="PPM")
    content = {
        "image": "mask.pgm", "mode": "raw", "resolution": 0.5, "origin": [-1.0, 2.0, 0.0],
        "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.25, **meta,
    }  # fmt: skip
    (tmp_path / "mask.yaml").write_text(yaml.safe_dump(content))
    return tmp_path / "mask.yaml"


def pixels(value, rows=4, cols=6):
    """Return pixels of which the top left one has a value."""
    found = np.zeros((rows, cols))
    found[0, 0] = value
    return found


def test_inflation_decays_as_nav2s():
    occupied = np.zeros((1, 40), bool)
    occupied[0, 0] = True
    grid = OccupancyGrid(occupied, 0.1, walled=False)
    costs = CostMap.of(grid).with_inflation(0.2, Inflation(1.0, 3.0, 2.0)).costs[0]
    away = 0.1 * np.arange(40) - 0.05
    expected = 2.0 * np.exp(-3.0 * np.maximum(away - 0.2, 0.0))
    expected[away >= 1.0] = 0.0
    assert costs[1:] == pytest.approx(expected[1:], rel=1e-5)
    assert costs[0] == 2.0


def test_distances_are_those_of_the_clearance():
    rng = np.random.default_rng(2)
    for walled in (True, False):
        grid = OccupancyGrid(rng.random((30, 23)) < 0.05, 0.05, (3.0, -2.0), walled, 0.4)
        cells = np.argwhere(np.ones((30, 23)))
        exact = grid.clearance(grid.centres(cells)).reshape(30, 23)
        for limit in (0.12, 0.3, 100.0):
            found = grid.centre_distances(limit)
            assert found == pytest.approx(np.clip(exact, 0.0, limit), rel=1e-5)


def test_grades_of_masks(tmp_path):
    _, raw = load_nav2_grades(mask(tmp_path, [[0, 30, 100, 101, 255, 1]] * 4))
    assert raw[0].tolist() == pytest.approx([0, 30, 100, np.nan, np.nan, 1], nan_ok=True)
    frame, scale = load_nav2_grades(
        mask(tmp_path, [[254, 205, 128, 100, 89, 0]] * 4, mode="scale", free_thresh=0.0)
    )
    # (1 - grey / 255) / 0.65, in percent, rounded; from 65 % on occupied
    assert scale[3].tolist() == [1, 30, 77, 94, 100, 100]
    assert frame.origin == GRID.origin
    _, trinary = load_nav2_grades(mask(tmp_path, [[254, 128, 0, 0, 0, 0]] * 4, mode="trinary"))
    assert trinary[0, :3].tolist() == pytest.approx([0, np.nan, 100], nan_ok=True)


def test_keepout_mask_occupies_and_costs(tmp_path):
    values = pixels(100)
    values[3, 5] = 50
    costs = CostMap.of(GRID).with_keepout(mask(tmp_path, values), weight=3.0)
    assert np.argwhere(costs.grid.occupied).tolist() == [[3, 0]]  # row 0 is the lowest
    assert np.argwhere(costs.kept_out).tolist() == [[3, 0]]
    assert costs.costs[0, 5] == 1.5
    assert np.count_nonzero(costs.costs) == 1
    assert not GRID.occupied.any()


@pytest.mark.parametrize(
    ("meta", "expected"),
    [
        ({}, 0.7 * 2.0),  # in percent: 100 - 30
        ({"type": 1, "base": 0.0, "multiplier": 1.0}, 0.3 * 2.0),
        ({"type": 2, "base": 3.5, "multiplier": -0.1}, 0.5),
    ],
)
def test_speed_mask(tmp_path, meta, expected):
    costs = CostMap.of(GRID).with_speed_mask(mask(tmp_path, pixels(30), **meta), 2.0)
    limits = costs.max_speeds(np.array([[-0.9, 3.9], [-0.4, 3.9], [-0.9, 3.4], [50.0, 0.0]]))
    assert limits.tolist() == pytest.approx([expected, np.inf, np.inf, np.inf])


def test_lanes_mark_cells_in_their_polygon():
    lane = Lane([(-1.0, 2.0), (0.0, 2.0), (0.0, 4.0)], 1.5)
    costs = CostMap.of(GRID).with_lanes([lane])
    marked = np.argwhere(np.isfinite(costs.directions)).tolist()
    assert marked == [[0, 0], [0, 1], [1, 1], [2, 1]]
    assert costs.against == 10.0
    assert CostMap.of(GRID).with_lanes([]).is_plain


@pytest.mark.parametrize(
    ("values", "meta", "message"),
    [
        (pixels(9, 5, 6), {}, "has 6 x 5 cells, the map 6 x 4"),
        (pixels(9), {"resolution": 0.4}, "has cells of 0.4 m, the map of 0.5 m"),
        (pixels(9), {"origin": [0.0, 2.0, 0.0]}, r"has the origin \(0.0, 2.0, 0.0\), the map"),
        (pixels(9), {"origin": [-1.0, 2.0, 0.3]}, "has the origin"),
        (pixels(9, 2, 2), {"resolution": 1.0}, "2 x 2 cells.*cells of 1 m"),
        (pixels(9), {"mode": "wrong"}, "mode 'wrong'"),
    ],
)
def test_masks_of_another_size_or_frame_are_refused(tmp_path, values, meta, message):
    file = mask(tmp_path, values, **meta)
    with pytest.raises(InvalidMap, match=message):
        CostMap.of(GRID).with_keepout(file)
    with pytest.raises(InvalidMap, match=message):
        CostMap.of(GRID).with_speed_mask(file, 1.0)


@pytest.mark.parametrize(
    ("meta", "message"),
    [
        ({"type": 3}, r"1 \(percent\) or 2 \(m/s\), got 3"),
        ({"type": 2, "base": 1.0, "multiplier": -0.1}, "limit is 0 or negative"),
        ({"base": 90.0, "multiplier": 1.0}, "above 100 %"),
        ({"base": "fast"}, "base must be a number, got 'fast'"),
        ({"multiplier": float("nan")}, "multiplier must be a number"),
    ],
)
def test_bad_speed_masks_are_refused(tmp_path, meta, message):
    with pytest.raises(InvalidMap, match=message):
        CostMap.of(GRID).with_speed_mask(mask(tmp_path, pixels(30), **meta), 1.0)


def test_own_costs(tmp_path):
    np.save(tmp_path / "costs.npy", np.arange(24).reshape(4, 6))
    assert load_costs(tmp_path / "costs.npy", GRID)[3, 5] == 23.0
    for bad, message in (
        (np.zeros((3, 6)), r"shape \(3, 6\), the map \(4, 6\)"),
        (np.full((4, 6), -1.0), "24 of the costs are not numbers from 0 to 250"),
        (np.full((4, 6), np.nan), "24 of the costs"),
        (np.full((4, 6), 1e300), "24 of the costs"),
        (np.zeros(4), "two-dimensional"),
    ):
        np.save(tmp_path / "bad.npy", bad)
        with pytest.raises(InvalidMap, match=message):
            load_costs(tmp_path / "bad.npy", GRID)
    with pytest.raises(InvalidMap, match=r"nothing.npy"):
        load_costs(tmp_path / "nothing.npy", GRID)
