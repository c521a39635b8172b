"""Map formats and named maps of another distribution, and errors of its code."""

import json
import sys

import numpy as np
import pytest

from omnidrive.cli.main import load_verb
from omnidrive.components.entry_points import entries_of
from omnidrive.errors import InvalidInput, InvalidMap
from omnidrive.maps import OccupancyGrid, is_named_map, load_map, save_nav2_map
from omnidrive.planning import Waypoint
from omnidrive.scenario import load_scenario, map_scenario, plan_scenario, save_scenario
from tests.components.distribution import install

CODE = """
    import numpy as np
    from omnidrive.maps import OccupancyGrid

    def load_arena(path, *, resolution=0.5, unknown="occupied"):
        cells = np.array([[c == "x" or (c == "u") * (unknown == "occupied") for c in line]
                          for line in path.read_text().split()], bool)
        return OccupancyGrid(cells, resolution)

    def load_fixed(path):
        return OccupancyGrid(np.zeros((2, 3), bool), 0.25)

    def hall():
        return OccupancyGrid(np.zeros((60, 80), bool), 0.1)

    def broken(path):
        return {}["width"]

    def quit(path):
        raise SystemExit(0)

    def number():
        return 5
"""
POINTS = """
    [omnidrive.maps]
    .arena = their_maps:load_arena
    .fixed = their_maps:load_fixed
    .broken = their_maps:broken
    .gone = their_maps:gone
    .quit = their_maps:quit
    .png = their_maps:load_fixed
    hall = their_maps:hall
    number = their_maps:number
"""


@pytest.fixture(autouse=True)
def installed(tmp_path, monkeypatch):
    """Install a distribution with map formats on the search path."""
    folder = tmp_path / "site"
    install(folder, "their-maps", "2.1", POINTS, CODE)
    monkeypatch.syspath_prepend(folder)
    entries_of.cache_clear()
    yield
    sys.modules.pop("their_maps", None)
    entries_of.cache_clear()


def write(folder, name, content="..x\nu..\n"):
    (folder / name).write_text(content)
    return folder / name


def test_reader_of_another_distribution(tmp_path):
    path = write(tmp_path, "m.ARENA")
    grid = load_map(path)
    assert grid.occupied.tolist() == [[False, False, True], [True, False, False]]
    assert grid.resolution == 0.5
    assert load_map(str(path), resolution=0.2, unknown="free").resolution == 0.2
    assert not load_map(path, unknown="free").occupied[1, 0]


def test_options_that_a_reader_does_not_have(tmp_path):
    path = write(tmp_path, "m.fixed")
    assert load_map(path, unknown="free").occupied.shape == (2, 3)
    with pytest.raises(InvalidMap, match=r"m\.fixed states its own resolution; omit"):
        load_map(path, resolution=0.1)


def test_registered_suffix_of_an_image_is_a_map(tmp_path):
    assert load_map(write(tmp_path, "m.png")).resolution == 0.25
    with pytest.raises(InvalidMap, match="is an image, which states no resolution"):
        load_map(write(tmp_path, "m.bmp"))


def test_named_maps(tmp_path, monkeypatch):
    assert load_map("hall").occupied.shape == (60, 80)
    assert load_map("paper").occupied.shape == (50, 50)
    assert is_named_map("hall")
    assert not any(map(is_named_map, (".arena", "hall.arena", "./hall", "", "hal")))
    with pytest.raises(InvalidMap, match="the map hall states its own resolution"):
        load_map("hall", resolution=0.1)
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "hall", "...\n")
    assert load_map("./hall").occupied.shape == (1, 3)


@pytest.mark.parametrize(
    ("name", "fact"),
    [
        ("m.broken", r"m.broken cannot be loaded by .broken of their-maps 2.1: KeyError: 'width'"),
        ("m.quit", r"m.quit cannot be loaded by .quit of their-maps 2.1: SystemExit: 0"),
        ("m.arena", r"m.arena cannot be loaded by .arena of their-maps 2.1: FileNotFoundError"),
        ("m.xyz", r"m.xyz is not a map: need a Nav2 map .*; other installed formats: .arena, .br"),
    ],
)
def test_errors_of_a_reader_name_file_and_distribution(tmp_path, name, fact):
    if name != "m.arena":
        write(tmp_path, name, "?!")
    with pytest.raises(InvalidMap, match=fact):
        load_map(tmp_path / name)


def test_reader_that_cannot_be_imported(tmp_path):
    with pytest.raises(InvalidInput, match=r"'\.gone' of the distribution their-maps cannot be"):
        load_map(write(tmp_path, "m.gone"))


def test_result_that_is_no_map():
    with pytest.raises(InvalidMap, match=r"the map number: .* must return an Occ.*, got 5"):
        load_map("number")


def test_nearest_name_of_a_map_that_does_not_exist(tmp_path):
    with pytest.raises(InvalidMap, match="there is no map hal; did you mean the named map 'hall'"):
        load_map("hal")
    with pytest.raises(InvalidMap, match=r"there is no map .*papr; did you mean the .*'paper'"):
        load_map(tmp_path / "papr")
    with pytest.raises(InvalidMap, match="No such file"):
        load_map(tmp_path / "warehouse")


@pytest.mark.parametrize("words", [["hall"], ["--map", "hall"]])
def test_command_on_a_named_map(capsys, words):
    options = ["--start", "1,1", "--goal", "6,4", "--robot", "small", "--json"]
    load_verb("plan")([*words, *options], standalone_mode=False)
    assert 5.0 < json.loads(capsys.readouterr().out)["length_m"] < 7.0


@pytest.mark.parametrize("source", ["hall", "m.arena"])
def test_scenario_on_a_map_of_another_distribution(tmp_path, source):
    write(tmp_path, "m.arena", "\n".join(["." * 16] * 12))
    scenario = map_scenario(
        source, Waypoint(1.0, 1.0), Waypoint(6.0, 4.0), robot="small", name="theirs"
    )
    save_scenario(scenario, tmp_path / "s.yaml")
    again = load_scenario(tmp_path / "s.yaml")
    assert again.map.source == (source if source == "hall" else str(tmp_path / source))
    planned = plan_scenario(again)
    assert planned.obstacles.resolution == (0.1 if source == "hall" else 0.5)
    assert planned.path.length > 5.0


def test_own_formats_are_components_too(tmp_path):
    names = set(entries_of("maps"))
    assert {"paper", ".yaml", ".yml", ".map", ".npy", ".txt"} <= names
    save_nav2_map(OccupancyGrid(np.zeros((2, 2), bool), 0.1), tmp_path / "m.yaml")
    assert load_map(tmp_path / "m.yaml").resolution == 0.1
