"""Studies with modified robots, obstacles and moving obstacles."""

import pytest
import yaml

from omnidrive.errors import InvalidInput, InvalidScenario, NoPathFound
from omnidrive.planning import Waypoint
from omnidrive.robot import named_robot
from omnidrive.scenario import load_scenario, paper_scenario, save_scenario
from omnidrive.scenario.planned_scenario import plan_scenario
from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
from omnidrive.scenario.sections import (
    MapSection,
    MovingSection,
    RobotSection,
    TimingSection,
    robot_of,
)
from omnidrive.scenario.tasks import DurationsTask, NoiseTask, Tasks
from omnidrive.study import run_study


def scenario(**changes):
    """Path following with the robot `small`, the plant `mujoco-balls` and feedforward control."""
    default = {
        "robot": RobotSection(name="small"),
        "plant": "mujoco-balls",
        "controllers": ("feedforward",),
        "timing": TimingSection(law="limits"),
        "tasks": Tasks(track=DurationsTask(durations=(20.0,))),
    }
    return paper_scenario().with_values(**default | changes)


def test_section_without_parameters_gives_the_named_robot():
    for name in ("paper", "small", "kiwi", "mecanum"):
        assert robot_of(RobotSection(name=name)) == named_robot(name)


def test_parameters_replace_those_of_the_named_robot():
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
def test_impossible_robot_is_rejected_before_planning(changes, message):
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
def test_invalid_robot_parameter_is_named(key, value, message):
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
        ([{"radius": 0.3, "path": [[2, 0, 0], [1, 0, 0]]}], "times must increase"),
        ([DISC] * 33, "at most 32 items"),
    ],
)
def test_invalid_moving_obstacle_is_named(moving, message):
    data = scenario_data(scenario())
    data["map"]["moving"] = moving
    with pytest.raises(InvalidScenario, match=message):
        parse_scenario(data, "here")


def test_moving_obstacles_need_a_plant_with_collisions():
    data = scenario_data(scenario(plant="kinematic"))
    data["map"]["moving"] = [DISC]
    with pytest.raises(InvalidScenario, match="the plant kinematic has no obstacles"):
        parse_scenario(data, "here")


def test_modified_robot_and_moving_obstacles_round_trip(tmp_path):
    changed = scenario(
        robot=RobotSection(name="kiwi", com=(0.01, 0.0), lag=(0.02, 0.01), roller_phase=True),
        map=MapSection(source="paper", margin=0.0, moving=(MovingSection(**DISC),)),
    )
    save_scenario(changed, tmp_path / "s.yaml")
    assert load_scenario(tmp_path / "s.yaml") == changed


@pytest.mark.parametrize("name", ["kiwi", "mecanum"])
def test_three_and_four_wheel_robots_follow_the_path_of_the_paper(name):
    study = run_study(scenario(robot=RobotSection(name=name))).raise_if_failed()
    (record,) = study.records
    assert record.metrics["me"] < 2e-3
    assert record.metrics["collisions"] == 0
    assert not study.collisions


def test_collision_with_a_disc_on_the_path_is_reported(tmp_path):
    disc_on_path = MapSection(source="paper", margin=0.0, moving=(MovingSection(**DISC),))
    study = run_study(scenario(map=disc_on_path), tmp_path / "out", figures=())
    ((record, log),) = study.logs.runs
    count = int(log.collisions[-1])
    assert study.collisions == {record.name: count}
    assert count == record.metrics["collisions"] >= 1
    assert (log.collisions[1:] >= log.collisions[:-1]).all()
    assert log.collisions[0] == 0
    table = next(each for each in study.tables if "collisions" in each.columns)
    assert table.rows[0][table.columns.index("collisions")] == str(count)
    saved = yaml.safe_load((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert saved["runs"][0]["collisions"] == count


@pytest.mark.long
def test_roller_phases_depend_on_seed_and_repeat():
    def work(seed):
        noisy = scenario(
            robot=RobotSection(name="small", roller_phase=True),
            plant="mujoco-rollers",
            seed=seed,
            tasks=Tasks(noise=NoiseTask(durations=(12.0,), repeats=2)),
        )
        return [tuple(r.run.work.tolist()) for r in run_study(noisy).results.tracks]

    first = work(1)
    assert first == work(1)
    assert len({*first, *work(2)}) == 4


def test_enclosed_start_has_no_path(tmp_path):
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
