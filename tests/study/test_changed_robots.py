"""Scenarios that change the robot, and what stands or moves on its way, through whole studies."""

import pytest
import yaml

from omnidrive.errors import InvalidInput, InvalidScenario, NoPathFound
from omnidrive.planning import Waypoint
from omnidrive.robot import named_robot
from omnidrive.study import load_scenario, paper_scenario, run_study, save_scenario
from omnidrive.study.planned_scenario import plan_scenario
from omnidrive.study.scenario import (
    MapSection,
    MovingSection,
    RobotSection,
    TimingSection,
    robot_of,
)
from omnidrive.study.scenario_file import parse_scenario, scenario_data
from omnidrive.study.tasks import DurationsTask, NoiseTask, Tasks


def scenario(**changes):
    """The robot small on the plant ball, by feedforward."""
    usual = {
        "robot": RobotSection(name="small"),
        "plant": "mujoco-balls",
        "controllers": ("feedforward",),
        "timing": TimingSection(law="limits"),
        "tasks": Tasks(track=DurationsTask(durations=(20.0,))),
    }
    return paper_scenario().model_copy(update=usual | changes)


def test_a_section_without_changes_is_the_named_robot():
    for name in ("paper", "small", "kiwi", "mecanum"):
        assert robot_of(RobotSection(name=name)) == named_robot(name)


def test_every_change_reaches_the_robot():
    changes = {
        "assumed_effective_radius": 0.2, "mass": 12.0, "body_inertia": 0.3, "com": (0.02, -0.01),
        "friction": 0.3, "max_torque": 1.5, "servo_gain": 0.7, "motor_lag": 0.03,
        "lag": (0.05, 0.04),
    }  # fmt: skip
    robot = robot_of(RobotSection(name="small", **changes))
    assert {name: getattr(robot, name) for name in changes} == changes


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": 2.0}, "its wheels alone weigh"),
        ({"com": (0.4, 0.0)}, "would lift off"),
    ],
)
def test_an_impossible_robot_ends_the_study_before_it_begins(changes, message):
    with pytest.raises(InvalidInput, match=message):
        run_study(scenario(robot=RobotSection(name="small", **changes)))


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("mass", -1.0, "robot.mass is -1 kg, need 0.1"),
        ("friction", float("nan"), "robot.friction: input should be a finite number"),
        ("motor_lag", 5.0, "robot.motor_lag is 5 s, need 0 to 2 s"),
        ("com", [0.1], "robot.com"),
        ("masss", 1.0, "did you mean 'mass'"),
    ],
)
def test_a_wrong_change_is_named(key, value, message):
    data = scenario_data(scenario())
    data["robot"][key] = value
    with pytest.raises(InvalidScenario, match=message):
        parse_scenario(data, "here")


DISC = {"radius": 0.3, "path": [[0.0, 5.0, 3.0], [60.0, 5.0, 3.0]]}


@pytest.mark.parametrize(
    ("moving", "message"),
    [
        ([{"radius": -1.0, "path": [[0, 0, 0]]}], "map.moving.0.radius is -1 m"),
        ([{"radius": 0.3, "path": []}], "at least 1 item"),
        ([{"radius": 0.3, "path": [[2, 0, 0], [1, 0, 0]]}], "times must grow"),
        ([DISC] * 33, "at most 32 items"),
    ],
)
def test_a_wrong_mover_is_named(moving, message):
    data = scenario_data(scenario())
    data["map"]["moving"] = moving
    with pytest.raises(InvalidScenario, match=message):
        parse_scenario(data, "here")


def test_movers_need_a_plant_that_meets_them():
    data = scenario_data(scenario(plant="kinematic"))
    data["map"]["moving"] = [DISC]
    with pytest.raises(InvalidScenario, match="on the plant kinematic nothing is in the robot's"):
        parse_scenario(data, "here")


def test_changes_and_movers_are_saved_and_read_again(tmp_path):
    changed = scenario(
        robot=RobotSection(name="kiwi", com=(0.01, 0.0), lag=(0.02, 0.01), roller_phase=True),
        map=MapSection(source="paper", margin=0.0, moving=(MovingSection(**DISC),)),
    )
    save_scenario(changed, tmp_path / "s.yaml")
    assert load_scenario(tmp_path / "s.yaml") == changed


@pytest.mark.parametrize("name", ["kiwi", "mecanum"])
def test_the_new_robots_follow_the_papers_path(name):
    study = run_study(scenario(robot=RobotSection(name=name))).raise_if_failed()
    (result,) = study.results.tracks
    assert result.metrics.me < 2e-3
    assert result.collisions == 0
    assert not study.collisions


def test_a_disc_on_the_way_is_run_into_and_told(tmp_path):
    on_the_way = MapSection(source="paper", margin=0.0, moving=(MovingSection(**DISC),))
    study = run_study(scenario(map=on_the_way), tmp_path / "out")
    (result,) = study.results.tracks
    assert study.collisions == {result.name: result.collisions}
    assert result.collisions >= 1
    assert (result.run.collisions[1:] >= result.run.collisions[:-1]).all()
    assert result.run.collisions[0] == 0
    (table,) = study.tables
    assert table.rows[0][table.columns.index("collisions")] == str(result.collisions)
    written = yaml.safe_load((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert written["runs"][0]["collisions"] == result.collisions


def test_phases_are_drawn_from_the_seed_and_for_each_repeat():
    def ends(seed):
        demand = scenario(
            robot=RobotSection(name="small", roller_phase=True),
            plant="mujoco-rollers",
            seed=seed,
            tasks=Tasks(noise=NoiseTask(durations=(12.0,), repeats=2)),
        )
        return [tuple(r.run.work.tolist()) for r in run_study(demand).results.tracks]

    first = ends(1)
    assert first == ends(1)
    assert len({*first, *ends(2)}) == 4


def test_walls_around_the_start_end_the_run(tmp_path):
    rows = ["." * 40 for _ in range(40)]
    for k in (4, 15):
        rows[k] = rows[k][:4] + "@" * 12 + rows[k][16:]
    for k in range(5, 15):
        rows[k] = rows[k][:4] + "@" + rows[k][5:15] + "@" + rows[k][16:]
    text = "\n".join(["type octile", "height 40", "width 40", "map", *rows]) + "\n"
    (tmp_path / "closed.map").write_text(text, encoding="utf-8")
    closed = scenario(
        map=MapSection(source=str(tmp_path / "closed.map"), resolution=0.2),
        start=Waypoint(2.0, 6.0), goal=Waypoint(6.0, 2.0),
    )  # fmt: skip
    with pytest.raises(NoPathFound):
        plan_scenario(closed)
    with pytest.raises(NoPathFound):
        run_study(closed)
