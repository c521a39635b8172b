"""Robot files: the named robots, exact round trips, and bad input."""

import subprocess
import sys
from dataclasses import replace
from math import hypot, pi

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import CannotWrite, InvalidInput, InvalidRobot
from omnidrive.robot import (
    ROBOTS,
    Mount,
    OmniWheel,
    Robot,
    load_robot,
    mecanum_rectangle,
    named_robot,
    omni_ring,
    save_robot,
)
from omnidrive.robot.robot_file import parse_robot, robot_text

# numbers of the named robots, independent of their files
LITERALS = [
    Robot(
        name="paper",
        mounts=omni_ring([(2 * k + 1) * pi / 4 for k in range(4)], hypot(0.5, 0.5)),
        wheel=OmniWheel(0.05, 2.0, 0.005, 9, 0.0125, 0.012, 0.022, 2),
        mass=75.7, com_height=0.0975, body_radius=0.75, friction=1.0, lag=(0.0065, 0.0013),
        max_wheel_speed=120.0, max_torque=50.0, servo_gain=20.0,
    ),
    Robot(
        name="small",
        mounts=omni_ring([(2 * k + 1) * pi / 4 for k in range(4)], 0.25),
        wheel=OmniWheel(0.05, 0.35, 0.001, 9, 0.0125, 0.012, 0.022, 2),
        mass=10.0, com_height=0.06, body_radius=0.28, friction=0.8, lag=(0.018, 0.006),
        max_wheel_speed=50.0, max_torque=2.0, servo_gain=1.0,
    ),
    Robot(
        name="kiwi",
        mounts=omni_ring([pi / 3, pi, -pi / 3], 0.17),
        wheel=OmniWheel(0.04, 0.2, 0.0004, 9, 0.01, 0.007, 0.018, 2),
        mass=6.0, com_height=0.06, body_radius=0.21, friction=0.8, lag=(0.0088, 0.0038),
        max_wheel_speed=40.0, max_torque=1.5, servo_gain=1.2,
    ),
    Robot(
        name="mecanum",
        mounts=mecanum_rectangle(0.2, 0.22),
        wheel=OmniWheel(0.0762, 0.9, 0.004, 12, 0.011, 0.03, 0.05, 1),
        mass=20.0, com_height=0.1, body_radius=0.37, friction=0.8, lag=(0.0126, 0.0042),
        max_wheel_speed=25.0, max_torque=6.0, servo_gain=4.0,
    ),
]  # fmt: skip
SMALL = named_robot("small")


@pytest.mark.parametrize("robot", LITERALS, ids=lambda robot: robot.name)
def test_named_robots_are_files_with_these_numbers(robot):
    assert repr(named_robot(robot.name)) == repr(robot)
    assert repr(ROBOTS[robot.name]) == repr(robot)


def test_every_named_robot_is_compared_with_literals():
    assert [robot.name for robot in LITERALS] == list(ROBOTS)


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(InvalidInput, match="no robot 'smal'; did you mean 'small'"):
        named_robot("smal")


def test_importing_the_package_reads_no_robot_file():
    code = "import yaml; yaml.load = None; from omnidrive.robot import ROBOTS; print(*ROBOTS)"
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, timeout=60, capture_output=True, text=True
    )
    assert done.stdout.split() == ["paper", "small", "kiwi", "mecanum"], done.stderr


@pytest.mark.parametrize("robot", LITERALS, ids=lambda robot: robot.name)
def test_round_trip_is_exact(robot, tmp_path):
    changed = replace(
        robot,
        com=(1e-5, -1.0 / 3.0 * 1e-3),
        body_inertia=0.1 + 0.2,
        motor_lag=5e-324,
        assumed_effective_radius=1.0 / 3.0,
        drive_gain=(0.1 + 0.2, 1.0, 1.0 / 3.0),
        name="my base: 'ä' #1",
    )
    save_robot(changed, tmp_path / "robot.yaml", notes=["first\nsecond", "third"])
    assert repr(load_robot(tmp_path / "robot.yaml")) == repr(changed)
    assert load_robot(str(tmp_path / "robot.yaml")) == changed
    assert named_robot(str(tmp_path / "robot.yaml")) == changed


@given(
    st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 3, st.floats(-1.4, 1.4)), min_size=3, max_size=16),
    st.floats(1e-3, 1.0),
)
def test_round_trip_of_any_robot_is_exact(mounts, friction):
    try:
        robot = replace(SMALL, mounts=tuple(Mount(*each) for each in mounts), friction=friction)
    except InvalidInput:
        return
    assert repr(parse_robot(yaml.safe_load(robot_text(robot)), "robot")) == repr(robot)


def edited(**changes):
    """Content of the file of robot small with changes; a value of ... removes the key."""
    data = yaml.safe_load(robot_text(SMALL))
    for key, value in changes.items():
        *groups, name = key.split("__")
        owner = data
        for group in groups:
            owner = owner[int(group) if group.isdigit() else group]
        if value is ...:
            del owner[name]
        else:
            owner[name] = value
    return data


def test_numbers_may_have_exponents_without_a_point_and_defaults_may_be_omitted():
    data = edited(wheel__rotor_inertia="4e-4", com=..., motor_lag=..., body_inertia=None, mass=11)
    robot = parse_robot(data, "robot")
    assert (robot.wheel.rotor_inertia, robot.mass, robot.com) == (4e-4, 11.0, (0.0, 0.0))


PARALLEL = [
    {"x": x, "y": y, "axle_angle": -0.5 * pi, "roller_angle": 0.785}
    for x in (0.2, -0.2)
    for y in (0.2, -0.2)
]
TOO_FEW = [{"x": 0.2, "y": 0.0, "axle_angle": 0.0}, {"x": -0.2, "y": 0.0, "axle_angle": pi}]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": ...}, "needs 'format: omnidrive-robot-1', got None"),
        ({"format": "omnidrive-robot-9"}, "got 'omnidrive-robot-9'"),
        ({"wheel_radius": 0.1}, "unknown key 'wheel_radius'; there are|did you mean"),
        ({"frictoin": 0.1}, "unknown key 'frictoin'; did you mean 'friction'"),
        ({"wheel__diameter": 0.1}, "unknown key 'diameter' in wheel; "),
        ({"mounts__1__angle": 0.1}, r"unknown key 'angle' in mounts\[1\]; did you mean"),
        ({"mounts__1__radius": 0.1}, r"mounts\[1\]; all wheels .* equal: .* as wheel.radius"),
        ({"mass": ...}, r"'mass' is missing \(kg, with wheels\)"),
        ({"wheel__radius": ...}, r"'radius' is missing in wheel \(m, from the axle"),
        ({"mounts__0__y": ...}, r"'y' is missing in mounts\[0\]"),
        ({"mounts": ...}, "'mounts' is missing"),
        ({"mass": -10.0}, "the robot's mass must be positive, got -10 kg"),
        ({"wheel__mass": -0.1}, "the wheels' mass must be positive, got -0.1 kg"),
        ({"mass": float("nan")}, "mass is nan, need a finite number"),
        ({"mounts__0__x": float("inf")}, r"mounts\[0\].x is inf, need a finite number"),
        ({"mass": 1e300}, "mass is 1e[+]300, need a finite number of at most 1e[+]09"),
        ({"mass": "10 kg"}, "mass must be a number without a unit .*, got '10 kg'"),
        ({"mass": True}, "mass must be a number"),
        ({"mass": None}, "mass must be a number"),
        ({"mass": "1_0"}, "mass must be a number"),
        ({"mass": [1.0]}, "mass must be a number"),
        ({"lag": 0.01}, "lag must be two numbers"),
        ({"lag": [0.01, "a"]}, "lag must be a number"),
        ({"wheel__rows": 1.5}, "wheel.rows must be an integer, got 1.5"),
        ({"wheel": 3}, "wheel must hold the keys radius, .*, got 3"),
        ({"mounts": 3}, "mounts must be a list of at most 16 wheels"),
        ({"mounts": [3]}, r"mounts\[0\] must hold the keys x, y, axle_angle, roller_angle, got 3"),
        ({"mounts": []}, "rank 0, need 3: not omnidirectional; turn a wheel or add one"),
        ({"mounts": TOO_FEW}, "rank 2, need 3: not omnidirectional"),
        ({"mounts": PARALLEL}, "rank 2, need 3: all wheels push in the same .* alternating signs$"),
        ({"mounts__0__axle_angle": -90}, r"mounts\[0\].axle_angle is -90, need .* rad \(degrees"),
        ({"mounts__1__roller_angle": 45}, r"mounts\[1\].roller_angle is 45, need .*\(degrees"),
        ({"wheel__radius": 76}, r"wheel.radius is 76, need at most 2 m \(mm\?\)"),
        ({"mounts__0__roller_angle": 0.5 * pi}, "wheel 0 has a roller angle .* cannot drive"),
        ({"com": [0.4, 0.0]}, "wheel . would lift off"),
        ({"name": ""}, "name must be text of 1 to 64 characters, got ''"),
        ({"name": "a\nb"}, "name must be text"),
        ({"name": 3}, "name must be text"),
    ],
)
def test_bad_files_are_refused_with_one_sentence(changes, message):
    with pytest.raises(InvalidRobot, match=message) as caught:
        parse_robot(edited(**changes), "my.yaml")
    assert str(caught.value).startswith("my.yaml")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_all_faults_of_a_file_are_named_at_once():
    data = edited(
        mass=-10.0, max_torque=..., max_torqe=2.0, wheel__mass="350 g", wheel__rows=0,
        mounts__1__axle_angle=135, lag=[0.01, -0.1],
    )  # fmt: skip
    with pytest.raises(InvalidRobot) as caught:
        parse_robot(data, "my.yaml")
    assert str(caught.value).removeprefix("my.yaml: ").split("; ") == [
        "unknown key 'max_torqe'",
        "did you mean 'max_torque'?",
        "'max_torque' is missing (N m, of a motor, at the wheel)",
        "mounts[1].axle_angle is 135, need -6.3 to 6.3 rad (degrees?)",
        "wheel.mass must be a number without a unit (kg, hub and rim without rollers), got '350 g'",
        "a wheel has 0 rows of 9 rollers, need 1 to 4 rows of 3 to 100",
        "the robot's mass must be positive, got -10 kg",
        "a lag of the robot must not be negative, got -0.1 s",
    ]


def test_a_message_names_ten_faults_at_most():
    keys = {f"z{i}": 1.0 for i in range(3000)}
    with pytest.raises(InvalidRobot, match=r"unknown key 'z9'; .*; and more$") as caught:
        parse_robot(edited(**keys), "my.yaml")
    assert "'z10'" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not a robot file: it contains no keys"),
        (b"[1, 2]", "is not a robot file: it contains no keys"),
        (b"a: [", "is not a YAML robot file"),
        (b"\xff\xfe\x00", "is not a YAML robot file"),
        (b"a: &a 1\nb: *a\n", r"aliases \(\*name\) are not allowed"),
        (b"a: !!python/object/apply:os.system [ls]\n", r"tags \(!name\) are not allowed"),
        (b"a: 1\na: 2\n", "the key 'a' twice"),
        (b"x" * 100_001, "is too large for a YAML robot file"),
        (b"[" * 5000, "nested more than 30 deep"),
    ],
)
def test_hostile_files_are_refused(tmp_path, content, message):
    path = tmp_path / "robot.yaml"
    path.write_bytes(content)
    with pytest.raises(InvalidRobot, match=message):
        load_robot(path)


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(InvalidRobot, match=r"cannot read the robot file .*: No such file"):
        named_robot(str(tmp_path / "none.yaml"))


@pytest.mark.parametrize("name", ["base.ymal", "robots/base", "small.YAML.old"])
def test_a_path_that_is_no_robot_file_is_not_taken_for_a_name(name):
    with pytest.raises(InvalidInput, match=f"the robot file {name} does not exist; .* .yaml$"):
        named_robot(name)


def test_an_existing_file_of_another_suffix_is_refused(tmp_path):
    (tmp_path / "base.txt").touch()
    with pytest.raises(InvalidInput, match=r"base.txt is not a robot file: .* end with .yaml$"):
        named_robot(str(tmp_path / "base.txt"))


def test_angles_beyond_a_full_turn_are_written_within_one(tmp_path):
    mounts = tuple(m._replace(axle_angle=m.axle_angle + 4.0 * pi) for m in SMALL.mounts)
    save_robot(replace(SMALL, mounts=mounts), tmp_path / "robot.yaml")
    directions = [m.drive_direction for m in load_robot(tmp_path / "robot.yaml").mounts]
    assert np.allclose(directions, [m.drive_direction for m in SMALL.mounts], atol=1e-12)


def test_robots_that_a_file_cannot_hold_are_not_written(tmp_path):
    with pytest.raises(InvalidRobot, match="name must be text"):
        save_robot(replace(SMALL, name=""), tmp_path / "robot.yaml")
    with pytest.raises(CannotWrite, match="cannot write"):
        save_robot(SMALL, tmp_path / "none" / "robot.yaml")
    assert not list(tmp_path.iterdir())


def test_mounts_of_omni_ring_are_restored(tmp_path):
    robot = replace(SMALL, mounts=omni_ring([2.0 * pi * k / 7 for k in range(7)], 0.3))
    save_robot(robot, tmp_path / "robot.yaml")
    assert load_robot(tmp_path / "robot.yaml").mounts == robot.mounts
