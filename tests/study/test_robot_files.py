"""Robots from files in scenarios, run folders and on the command line."""

from dataclasses import replace

import pytest

from omnidrive.errors import InvalidRobot, InvalidScenario
from omnidrive.robot import load_robot, named_robot, save_robot
from omnidrive.scenario import (
    RobotSection,
    load_scenario,
    paper_scenario,
    plan_scenario,
    save_scenario,
)
from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
from omnidrive.scenario.sections import robot_of
from omnidrive.study import run_study

BASE = replace(named_robot("small"), name="my base", mass=12.5, com=(0.01, 0.0))


def scenario(robot):
    """One run of 30 s on the kinematic plant."""
    data = scenario_data(paper_scenario())
    changes = {
        "robot": robot.model_dump(),
        "plant": "kinematic",
        "controllers": ["feedforward"],
        "tasks": {"track": {"durations": [30.0]}},
    }
    return parse_scenario(data | changes, "test")


@pytest.fixture
def base(tmp_path):
    path = tmp_path / "robots" / "my_base.yaml"
    path.parent.mkdir()
    save_robot(BASE, path)
    return path


def test_a_section_may_name_a_file_and_change_its_robot(base):
    assert robot_of(RobotSection(name=str(base))) == BASE
    assert robot_of(RobotSection(name=str(base), mass=13.0)) == replace(BASE, mass=13.0)


def test_the_path_in_a_scenario_file_is_relative_to_it(base, tmp_path, monkeypatch):
    folder = tmp_path / "scenarios"
    folder.mkdir()
    save_scenario(scenario(RobotSection(name="../robots/my_base.yaml")), folder / "s.yaml")
    monkeypatch.chdir(tmp_path)
    loaded = load_scenario(folder / "s.yaml")
    assert plan_scenario(loaded).robot == BASE


def test_a_run_folder_holds_the_robot_and_can_be_repeated(base, tmp_path):
    first = scenario(RobotSection(name=str(base), friction=0.7))
    run_study(first, tmp_path / "a")
    base.unlink()
    assert load_robot(tmp_path / "a" / "robot.yaml") == replace(BASE, friction=0.7)
    again = load_scenario(tmp_path / "a" / "scenario.yaml")
    run_study(again, tmp_path / "b")
    for series in (tmp_path / "a" / "series").iterdir():
        assert (tmp_path / "b" / "series" / series.name).exists()
    one, other = (plan_scenario(load_scenario(tmp_path / k / "scenario.yaml")) for k in "ab")
    assert one.robot == other.robot == replace(BASE, friction=0.7)


def test_a_robot_file_is_not_taken_for_a_scenario(base):
    with pytest.raises(InvalidScenario, match=r"my_base.yaml is a robot file; use --robot .*yaml$"):
        load_scenario(base)


def test_a_missing_robot_file_is_refused(tmp_path):
    with pytest.raises(InvalidRobot, match="cannot read the robot file"):
        plan_scenario(scenario(RobotSection(name=str(tmp_path / "none.yaml"))))


@pytest.mark.long
def test_a_run_folder_holds_the_robot_of_the_plant_too(base, tmp_path):
    first = scenario(RobotSection(name="small"))
    section = RobotSection(name=str(base), friction=0.5)
    run_study(first.model_copy(update={"plant_robot": section}), tmp_path / "a")
    assert load_robot(tmp_path / "a" / "plant_robot.yaml") == replace(BASE, friction=0.5)
    planned = plan_scenario(load_scenario(tmp_path / "a" / "scenario.yaml"))
    assert (planned.robot, planned.plant_robot) == (
        named_robot("small"),
        replace(BASE, friction=0.5),
    )
