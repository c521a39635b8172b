"""Scenario files: round trip, and errors that name the key and the way out."""

import copy

import pytest
import yaml

from omnidrive.errors import InvalidScenario
from omnidrive.planning import Place
from omnidrive.study import load_scenario, map_scenario, paper_scenario, retime, save_scenario
from omnidrive.study.scenario_file import scenario_data
from tests.shared_data import shared


@pytest.mark.parametrize("preset", ["paper", "published-code"])
def test_a_saved_scenario_is_read_again(tmp_path, preset):
    scenario = paper_scenario(preset)
    save_scenario(scenario, tmp_path / "s.yaml")
    assert load_scenario(tmp_path / "s.yaml") == scenario


def test_a_map_is_looked_up_beside_its_scenario(tmp_path):
    scenario = map_scenario("map.yaml", Place(1, 1), Place(2, 2, 0.5), robot="small", name="x")
    save_scenario(scenario, tmp_path / "s.yaml")
    again = load_scenario(tmp_path / "s.yaml")
    assert again.map.source == str(tmp_path / "map.yaml")
    assert (again.start, again.goal) == (scenario.start, scenario.goal)


def changed(*path, value):
    data = copy.deepcopy(scenario_data(paper_scenario()))
    spot = data
    for key in path[:-1]:
        spot = spot[key]
    spot[path[-1]] = value
    return data


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (changed("sead", value=1), "unknown key 'sead'; did you mean 'seed'?"),
        (changed("path", "spaceing", value=1), "unknown key 'path.spaceing'; did you mean 'spac"),
        (changed("tasks", "trak", value=1), "unknown key 'tasks.trak'; did you mean 'track'?"),
        (changed("recommended", "k", value=1), "'recommended.k'; there are position, heading"),
        (changed("tasks", "track", "duration", value=1), "did you mean 'durations'?"),
        (changed("tasks", "track", "durations", value=["20 s"]), "number without a unit, got '20"),
        (changed("tasks", "track", "durations", value=[]), "at least 1 item"),
        (changed("tasks", "track", "durations", value=[-20]), "is -20 s, need 0.1 to 3600 s"),
        (changed("sample_time", value=100), "sample_time is 100 s, need 0.005 to 1 s"),
        (changed("sample_time", value=float("nan")), "sample_time: input should be a finite"),
        (changed("start", value=[1, 1, 90]), "is 90 rad, need -6.3 to 6.3 rad"),
        (changed("start", value=[1]), "'start.1' is missing"),
        (changed("start", value=[1, float("inf")]), "start.1: input should be a finite number"),
        (changed("recommended", "position", value=-1), "recommended.position is -1 1/s, need 0"),
        (changed("path", "spacing", value=-0.5), "path.spacing is -0.5 m, need 0 to 10 m"),
        (changed("map", "margin", value=-0.5), "map.margin is -0.5 m, need 0 to 10 m"),
        (changed("plant", value="rolers"), "plant: input should be 'rollers', 'ball' or 'kinem"),
        (changed("controllers", value=["nmcp"]), "'recommended', got 'nmcp'"),
        (changed("nmpc", "horizon", value=0), "nmpc.horizon is 0 steps, need 1 to 200 steps"),
        (changed("tasks", value={}), "tasks names no task; there are track, noise"),
        (changed("format", value="omnidrive-scenario-2"), "format: input should be 'omnidrive-sc"),
        (changed("name", value="../../etc"), "name: string should match pattern"),
        (changed("seed", value=1.5), "seed: input should be a valid integer"),
        ({}, "'name' is missing"),
    ],
)
def test_a_wrong_scenario_says_what_is_wrong_and_what_would_be_right(tmp_path, data, message):
    path = tmp_path / "s.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InvalidScenario) as refused:
        load_scenario(path)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [", "is not a YAML scenario"),
        ("nothing", "is not a scenario"),
        ("a: &a [x]\nb: [*a, *a]", "aliases"),
        ("!!python/object/apply:os.system ['true']", "is not a YAML scenario"),
        ("[" * 50_000, "is not a YAML scenario"),
        ("x" * 200_000, "too large"),
    ],
)
def test_hostile_files_are_refused(tmp_path, text, message):
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.raises(InvalidScenario, match=message):
        load_scenario(path)


def test_a_missing_scenario_is_named(tmp_path):
    with pytest.raises(InvalidScenario, match=r"none.yaml: No such file"):
        load_scenario(tmp_path / "none.yaml")


def test_times_that_suit_a_map():
    source = str(shared("maps/nav2/depot.yaml"))
    scenario = map_scenario(source, Place(2.0, 2.0), Place(27.0, 13.0), robot="small", name="d")
    usual, faster = retime(scenario), retime(scenario, speed=0.8)
    assert usual.tasks.track.durations[1] == pytest.approx(1.5 * usual.tasks.track.durations[0])
    ratio = usual.tasks.horizon.duration / faster.tasks.horizon.duration
    assert ratio == pytest.approx(0.8 / 0.5, rel=0.01)
    assert retime(scenario, duration=77.0).tasks.track.durations == (77.0, 115.5)
