"""References on the command line: `--reference`, and waypoint files as the argument."""

import json
from pathlib import Path as FilePath

import numpy as np
import pytest

from omnidrive.cli.main import load_verb
from omnidrive.cli.scenario_options import ScenarioOptions
from omnidrive.errors import InvalidInput, InvalidScenario
from omnidrive.maps import OccupancyGrid, save_nav2_map
from omnidrive.reference import Circle, ShapeReference, save_waypoints
from omnidrive.scenario import paper_scenario, plan_and_check, save_scenario


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Working directory with waypoint files, a map and a scenario."""
    monkeypatch.chdir(tmp_path)
    motion = ShapeReference(Circle(radius=0.7), 9.0)
    for ending in ("csv", "traj", "yaml", "path"):
        save_waypoints(f"w.{ending}", motion)
    save_nav2_map(OccupancyGrid(np.zeros((80, 80), bool), 0.1, (-4.0, -4.0)), tmp_path / "m.yaml")
    save_scenario(paper_scenario(), tmp_path / "s.yaml")
    return tmp_path


@pytest.mark.parametrize("ending", ["csv", "traj", "yaml", "path"])
@pytest.mark.parametrize("as_option", [True, False])
def test_waypoint_file_on_an_open_floor(here, ending, as_option):
    name = f"w.{ending}"
    options = ScenarioOptions(reference=name) if as_option else ScenarioOptions(scenario=name)
    scenario = options.resolve()
    assert scenario.reference.values == {"file": name, "heading": "tangent"}
    assert scenario.map.source == "none"
    assert scenario.name == "w"
    durations = scenario.tasks.path_durations
    if ending != "path":  # without times
        assert durations == (9.0, 13.5)
    planned = plan_and_check(scenario)
    assert planned.path.length == pytest.approx(2.0 * np.pi * 0.7, rel=0.01)


def test_shape_with_parameters_on_a_map_from_a_start(here):
    scenario = ScenarioOptions(
        scenario="m.yaml", reference="circle,radius=1.5,heading=fixed", start="-1,-2,0.5",
        robot="small", duration=20.0,
    ).resolve()  # fmt: skip
    assert scenario.reference.parameters == Circle(radius=1.5, heading="fixed")
    assert scenario.map.source == "m.yaml"
    assert scenario.start == (-1.0, -2.0, 0.5)
    assert scenario.robot.name == "small"
    assert scenario.tasks.path_durations == (20.0, 30.0)


def test_shape_replaces_the_path_of_a_scenario_file(here):
    scenario = ScenarioOptions(scenario="s.yaml", reference="eight", robot="small").resolve()
    assert scenario.map.source == "paper"
    assert scenario.start == (1.0, 1.0, 0.0)
    assert scenario.robot.name == "small"
    back = ScenarioOptions(scenario="s.yaml", reference="path").resolve()
    assert back == paper_scenario()
    save_scenario(scenario, "eight.yaml")
    again = ScenarioOptions(scenario="eight.yaml", reference="eight").resolve()
    assert again.tasks == scenario.tasks


def test_other_options_still_apply(here):
    scenario = ScenarioOptions(
        reference="slalom", speed=0.3, plant="planar", preset="recommended", seed=7, estimator=True
    ).resolve()
    assert (scenario.plant.type, scenario.preset, scenario.seed) == ("planar", "recommended", 7)
    assert scenario.sensors is not None
    planned = plan_and_check(scenario)
    (first, *_) = scenario.tasks.path_durations
    assert planned.path.length / first == pytest.approx(0.3, rel=0.01)


@pytest.mark.parametrize("name", ["v1.2", "small.csv", "x.map"])
def test_folder_with_a_dot_in_its_name_stands_for_its_scenario(here, name):
    folder = here / name
    folder.mkdir()
    save_scenario(paper_scenario(), folder / "scenario.yaml")
    assert ScenarioOptions(scenario=name).resolve() == paper_scenario()


@pytest.mark.parametrize("name", ["x" * 300, "x" * 300 + ".yaml"])
def test_scenario_name_that_is_too_long_is_reported(name):
    with pytest.raises(InvalidScenario, match="File name too long"):
        ScenarioOptions(scenario=name).resolve()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reference": "cirle"}, "did you mean 'circle'"),
        ({"reference": "circle,radius=0"}, "reference.radius is 0 m, need 0.01 to 1000 m"),
        ({"reference": "waypoints,file=3"}, "reference.file"),
        ({"reference": "circle,radius"}, "'radius' in 'circle,radius' is not KEY=VALUE"),
        ({"reference": "my=circle"}, "a reference has no label: write circle instead"),
        ({"reference": "circle", "goal": "1,2"}, "--goal: not for the reference circle"),
        ({"reference": "circle", "timing": "limits"}, "--timing: not for the reference circle"),
        ({"scenario": "w.csv", "start": "1,2"}, "--start: not for the reference waypoints"),
        ({"scenario": "w.csv", "reference": "circle"}, "exclude each other"),
        ({"scenario": "m.yaml", "reference": "path"}, "a map needs --start X,Y and --goal X,Y"),
        (
            {"scenario": "s.yaml", "map": FilePath("m.yaml"), "reference": "circle"},
            "exclude each other",
        ),
    ],
)
def test_invalid_options_are_reported(here, options, message):
    with pytest.raises((InvalidInput, InvalidScenario), match=message):
        ScenarioOptions(**options).resolve()


def test_plan_reports_and_writes_a_shape(here, capsys):
    args = ("--reference", "circle,radius=0.5", "--robot", "small", "--png", "c.png", "--out", "c")
    load_verb("plan")([*args, "--json"], standalone_mode=False)
    facts = json.loads(capsys.readouterr().out)
    assert facts["reference"] == "circle"
    assert facts["length_m"] == pytest.approx(np.pi, rel=1e-3)
    assert 90.0 < facts["wheel_force_used_percent"] <= 100.1
    assert "expansions" not in facts
    assert {p.name for p in (here / "c").iterdir()} == {
        "scenario.yaml",
        "reference.csv",
        "path.html",
        "path.png",
    }
    assert (here / "c.png").stat().st_size > 10_000
    load_verb("plan")(["c/reference.csv", "--robot", "small", "--json"], standalone_mode=False)
    again = json.loads(capsys.readouterr().out)
    assert again["duration_s"] == facts["duration_s"]
    assert again["wheel_force_used_percent"] <= 101.0
    load_verb("plan")(["c", "--json"], standalone_mode=False)
    assert json.loads(capsys.readouterr().out)["length_m"] == facts["length_m"]
