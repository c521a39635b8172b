"""Identification of a robot's parameters from logs."""

import re
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest

from omnidrive.control import FeedforwardController
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, PlanarPlant, simulate
from omnidrive.simulation.identification import (
    RobotLog,
    identification_commands,
    identify_robot,
    read_log,
    simulated_log,
)
from omnidrive.simulation.identification.identify_robot import _Data
from omnidrive.simulation.identification.response import response
from omnidrive.simulation.planar.model import servo_lags

SMALL = named_robot("small")
DT = 0.01
COLUMNS = ("t", "command_vx", "command_vy", "command_yaw_rate", "x", "y", "yaw")


def drive(robot, seed=1, *, duration=60.0, dt=DT, noise=(0.003, 0.003, 0.1), delay=5, **changes):
    """Log of the planar plant, which integrates with a short step for its exact lags."""
    rng = np.random.default_rng(seed)
    commands = identification_commands(robot, rng, dt, duration)
    plant = PlanarPlant(replace(robot, **changes), timestep=1e-4)
    return simulated_log(
        plant, commands, dt, rng, pose_noise=noise[:2], wheel_noise=noise[2], delay=delay
    )


def true_parameters(robot, delay=0.025):
    lags = servo_lags(robot)
    return {
        "wheel radius": robot.wheel.radius,
        "effective radius": robot.effective_radius,
        "lag in translation": lags[0],
        "lag in rotation": lags[1],
        "delay": delay,
        "friction": robot.friction,
    }


@pytest.mark.parametrize("name", ["small", pytest.param("kiwi", marks=pytest.mark.long)])
def test_truth_lies_within_three_standard_errors(name):
    """Every robot, noise and seed: benchmarks/identify.py."""
    robot = named_robot(name)
    found = identify_robot(drive(robot), robot).estimates
    for key, true in true_parameters(robot).items():
        estimate = found[key]
        assert not estimate.reason, estimate
        assert abs(estimate.value - true) < 3.0 * estimate.sigma, (estimate, true)
    assert found["wheel radius"].sigma < 0.001 * robot.wheel.radius
    assert found["effective radius"].sigma < 0.005 * robot.effective_radius
    assert found["friction"].sigma < 0.05
    assert found["delay"].sigma < 0.002


def test_parameters_that_differ_from_the_nominal_ones_are_found():
    true = replace(SMALL, wheel=replace(SMALL.wheel, radius=0.052), friction=0.5)
    log = drive(SMALL, wheel=true.wheel, friction=0.5)
    # the wheel controller converts commands with the nominal radius, the plant with its own
    commands = log.commands * (0.05 / 0.052)
    nominal = RobotLog(log.t, commands, log.poses, log.wheel_speeds)
    found = identify_robot(nominal, SMALL)
    radius, friction = found.estimates["wheel radius"], found.estimates["friction"]
    assert abs(radius.value - 0.052) < 3.0 * radius.sigma
    assert abs(friction.value - 0.5) < 3.0 * friction.sigma
    assert found.robot.wheel.radius == radius.value
    assert found.robot.friction == friction.value
    assert found.robot.lag != SMALL.lag
    assert found.robot.mass == SMALL.mass


def test_exact_logs_of_the_model_give_exact_parameters():
    rng = np.random.default_rng(2)
    commands = identification_commands(SMALL, rng, DT, 40.0)
    t = DT * np.arange(len(commands))
    twists, moves = response(SMALL, t, commands, (0.015, 0.006), 0.03)
    poses, yaw = np.zeros((len(t), 3)), 0.0
    for k, (x, y, turn) in enumerate(moves[:-1]):
        c, s = np.cos(yaw), np.sin(yaw)
        yaw += turn
        poses[k + 1] = poses[k] + [c * x - s * y, s * x + c * y, turn]
    wheels = twists @ SMALL.chassis.jacobian.T
    found = identify_robot(RobotLog(t, commands, poses, wheels), SMALL).estimates
    assert found["lag in translation"].value == pytest.approx(0.015, abs=1e-5)
    assert found["lag in rotation"].value == pytest.approx(0.006, abs=1e-5)
    assert found["delay"].value == pytest.approx(0.03, abs=1e-5)
    assert found["wheel radius"].value == pytest.approx(0.05, rel=1e-3)


def test_slip_limits_the_acceleration_of_the_response():
    t = DT * np.arange(40)
    commands = np.tile([1.0, 0.0, 0.0], (40, 1))
    twists, _ = response(SMALL, t, commands, (0.01, 0.01), 0.0, friction=0.4)
    accelerations = np.diff(twists[:20, 0]) / DT
    most = 0.4 * 9.81 / np.sqrt(2.0)
    assert accelerations[2:10] == pytest.approx(most, rel=0.02)


def test_poses_may_be_rarer_than_samples():
    """Poses every 0.4 s, in segments of 2 s."""
    log = drive(SMALL, duration=60.0, dt=0.02, delay=0)
    measured = np.zeros(len(log.t), dtype=bool)
    measured[:: round(0.4 / 0.02)] = True
    poses = np.where(measured[:, None], log.poses, np.nan)
    poses[:, 2] = (poses[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    found = identify_robot(RobotLog(log.t, log.commands, poses, log.wheel_speeds), SMALL).estimates
    for name, true in true_parameters(SMALL, 0.0).items():
        if name not in {"friction", "delay"}:
            assert abs(found[name].value - true) < 3.0 * found[name].sigma, (found[name], true)
    assert found["wheel radius"].sigma < 0.005 * SMALL.wheel.radius


def test_mean_wheel_speeds_give_exact_times():
    rng = np.random.default_rng(2)
    commands = identification_commands(SMALL, rng, 0.02, 40.0)
    t = 0.02 * np.arange(len(commands))
    fine = 0.001 * np.arange(20 * (len(t) - 1) + 1)
    held = commands[np.minimum(np.arange(len(fine)) // 20, len(t) - 1)]
    twists, moves = response(SMALL, fine, held, (0.015, 0.006), 0.008)
    yaw = np.concatenate([[0.0], np.cumsum(moves[:-1, 2])])
    c, s = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    x, y = moves[:-1, 0], moves[:-1, 1]
    steps = np.column_stack([c * x - s * y, s * x + c * y])
    path = np.column_stack([np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)]), yaw])
    turned = (
        np.cumsum(0.0005 * (twists[1:] + twists[:-1]), axis=0)[19::20] @ SMALL.chassis.jacobian.T
    )
    speeds = np.diff(turned, axis=0, prepend=0.0) / 0.02
    speeds = np.vstack([speeds[:1], speeds])
    log = RobotLog(t, commands, path[::20], speeds, mean_wheel_speeds=True)
    found = identify_robot(log, SMALL).estimates
    assert found["lag in translation"].value == pytest.approx(0.015, abs=1e-4)
    assert found["lag in rotation"].value == pytest.approx(0.006, abs=1e-4)
    assert found["delay"].value == pytest.approx(0.008, abs=1e-4)
    assert found["wheel radius"].value == pytest.approx(0.05, rel=1e-3)


@pytest.mark.parametrize(
    ("begin", "end", "means"),
    [
        (0.3, 0.75, False),
        (0.0, 0.3, True),
        pytest.param(0.8, 1.0, False, marks=pytest.mark.long),
        pytest.param(0.3, 0.75, True, marks=pytest.mark.long),
        pytest.param(0.0, 0.3, False, marks=pytest.mark.long),
        pytest.param(0.8, 1.0, True, marks=pytest.mark.long),
    ],
)
def test_segments_without_wheel_speeds_are_left_out(begin, end, means):
    whole = drive(SMALL, duration=40.0, dt=0.02, delay=0)
    speeds = whole.wheel_speeds.copy()
    speeds[round(begin * len(speeds)) : round(end * len(speeds))] = np.nan
    log = replace(whole, wheel_speeds=speeds, mean_wheel_speeds=means)
    found = identify_robot(log, SMALL)
    assert found.robot.wheel.radius == pytest.approx(SMALL.wheel.radius, rel=0.01)
    assert found.robot.effective_radius == pytest.approx(SMALL.effective_radius, rel=0.02)
    friction = found.estimates["friction"]
    assert friction.reason or friction.value == pytest.approx(SMALL.friction, rel=0.1)


def radii(log):
    """Return wheel radius and effective radius of a log, which need no fit of the response."""
    return {each.name: each for each in _Data(log, SMALL).geometry()}


def test_too_little_motion_is_that_with_wheel_speeds():
    log = drive(SMALL, duration=40.0, dt=0.02, delay=0)
    speeds = log.wheel_speeds.copy()
    speeds[400:1500] = np.nan
    found = radii(replace(log, wheel_speeds=speeds))
    reason = found["wheel radius"].reason
    assert re.fullmatch(r"the log holds too little motion in the 1\d s with wheel speeds", reason)


def test_too_few_wheel_speeds_are_the_reason():
    log = drive(SMALL, duration=20.0, dt=0.02, delay=0)
    speeds = log.wheel_speeds.copy()
    speeds[25::50] = speeds[26::50] = np.nan
    some = replace(log, wheel_speeds=speeds)
    assert not radii(some)["wheel radius"].reason
    speeds[100:-50] = np.nan
    found = radii(replace(log, wheel_speeds=speeds))
    for name in ("wheel radius", "effective radius"):
        assert "poses and wheel speeds without a gap of more than 0.1 s in" in str(found[name])


def test_logs_without_wheel_speeds_give_no_radii():
    log = drive(SMALL, duration=40.0)
    found = radii(RobotLog(log.t, log.commands, log.poses))
    for name in ("wheel radius", "effective radius"):
        assert str(found[name]).startswith("not identifiable: the log has no wheel speeds")
        assert np.isnan(found[name].value)


def test_motion_without_rotation_does_not_determine_the_effective_radius():
    rng = np.random.default_rng(1)
    commands = identification_commands(SMALL, rng, DT, 40.0) * [1.0, 1.0, 0.0]
    log = simulated_log(PlanarPlant(SMALL), commands, DT, rng, pose_noise=(0.003, 0.003),
                        wheel_noise=0.1)  # fmt: skip
    found = radii(log)
    assert not found["wheel radius"].reason
    assert "not identifiable: the log holds too little rotation" in str(found["effective radius"])


def test_gentle_motion_does_not_determine_the_friction():
    log = drive(SMALL, duration=40.0)
    gentle = slice(0, 2900)
    part = RobotLog(
        log.t[gentle], log.commands[gentle], log.poses[gentle], log.wheel_speeds[gentle]
    )
    found = identify_robot(part, SMALL)
    text = str(found.estimates["friction"])
    assert text.startswith("not identifiable: the wheels do not slip: friction is at least about")
    assert found.robot.friction == SMALL.friction


def test_errors_that_slip_does_not_explain_determine_no_friction():
    """Of exact poses of gentle motion, the largest errors are those of the model."""
    log = drive(SMALL, duration=40.0, dt=0.02, noise=(1e-6, 1e-6, 1e-4))
    gentle = log.t < 29.0
    rows = (log.t, log.commands, log.poses, log.wheel_speeds)
    data = _Data(RobotLog(*(each[gentle] for each in rows)), SMALL)
    data.geometry()
    times = data.response()
    data.slipping[:] = np.arange(len(data.slipping)) % 2 == 0
    assert data.friction(*times).reason.startswith("the wheels do not slip: friction is at least")


def test_a_short_log_determines_nothing():
    log = drive(SMALL, duration=5.0)
    found = identify_robot(log, SMALL)
    assert all(each.reason for each in found.estimates.values())
    assert found.robot == SMALL


def write(path, log):
    names = [*COLUMNS, *(f"wheel_speed_{i}" for i in range(log.wheel_speeds.shape[1]))]
    block = np.column_stack([log.t, log.commands, log.poses, log.wheel_speeds])
    table = pa.table(dict(zip(names, block.T, strict=True)))
    if path.suffix == ".csv":
        pa.csv.write_csv(table, path)
    else:
        pa.parquet.write_table(table, path)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_logs_are_read_exactly(tmp_path, suffix):
    log = drive(SMALL, duration=2.0)
    write(tmp_path / f"log{suffix}", log)
    read = read_log(tmp_path / f"log{suffix}")
    for name in ("t", "commands", "poses", "wheel_speeds"):
        assert np.array_equal(getattr(read, name), getattr(log, name))


def test_saved_runs_are_logs(tmp_path):
    run = simulate(PlanarPlant(SMALL), FeedforwardController(0.1), Hold(Pose(0.3, 0.1, 0.2), 1.0),
                   start=Pose(0.0, 0.0, 0.0), dt=0.1)  # fmt: skip
    run.save(tmp_path / "run.parquet")
    log = read_log(tmp_path / "run.parquet")
    assert log.wheel_speeds is not None
    assert log.wheel_speeds.shape[1] == 4
    assert np.array_equal(log.poses, run.pose)


HEAD = "t,command_vx,command_vy,command_yaw_rate,x,y,yaw,wheel_speed_0\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", b"", "the suffix of a log is .csv or .parquet"),
        ("none.csv", None, "cannot read the log"),
        ("a.csv", b"", "there are no columns 't', 'command_vx'"),
        ("a.csv", b"stamp,x,y,yaw,vx\n", "no columns 't', 'command_vx', .*contents: stamp, x, y"),
        ("a.csv", HEAD.replace("yaw,wheel", "yow,wheel").encode(), "no column 'yaw'; did you mean"),
        ("a.csv", HEAD.replace("speed_0", "speed_1").encode(), "must be numbered from 0, got 1"),
        ("a.csv", HEAD.encode() + b"0,0,0,0,0,0,0,0\n", "has 1 samples, need at least 2"),
        ("a.csv", HEAD.encode() + b"0,0,0,0,0,0,0,a\n", "is not a log: "),
        ("a.csv", HEAD.encode() + b"0,0,0,0,0,0,0\n", "is not a log: "),
        ("a.csv", HEAD.encode() + b"0,0,0,0,0,0,0,0\n0,0,0,0,0,0,0,0\n", "times must increase"),
        ("a.csv", HEAD.encode() + b"0,0,0,0,0,0,0,0\n1,0,0,0,nan,0,0,0\n", "poses in sample 1"),
        (
            "a.csv",
            HEAD.encode() + b"0,0,0,0,0,0,0,0\n1,1e155,0,0,0,0,0,0\n",
            "commands in sample 1",
        ),
        ("a.csv", HEAD.encode() + b"0,0,0,0,,,,0\n1,0,0,0,0,0,0,0\n", "has 1 measured poses"),
        ("a.csv", HEAD.encode() + b"0,0,0,0,0,0,0,\n1,0,0,0,0,0,0,0\n", "has 1 rows of wheel"),
        ("a.csv", HEAD.encode() + b"0,0,0,0,0,0,0,0\n9999,0,0,0,0,0,0,0\n", "at most 3600 s"),
        ("a.parquet", b"PAR1 nonsense", "is not a log: "),
        ("a.csv", b"\xff\xfe", "there are no columns 't'"),
    ],
)
def test_bad_logs_are_refused_with_one_sentence(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInput, match=message) as caught:
        read_log(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_log_of_another_robot_is_refused():
    with pytest.raises(InvalidInput, match="log has 4 wheels, the robot 'kiwi' 3"):
        identify_robot(drive(SMALL, duration=2.0), named_robot("kiwi"))


def test_a_nominal_robot_without_friction_is_refused():
    with pytest.raises(InvalidInput, match="friction of the robot 'small' is zero"):
        identify_robot(drive(SMALL, duration=2.0), replace(SMALL, friction=0.0))


def test_a_log_at_rest_determines_nothing():
    t = DT * np.arange(2000)
    log = RobotLog(t, np.zeros((2000, 3)), np.zeros((2000, 3)), np.zeros((2000, 4)))
    found = identify_robot(log, SMALL)
    assert all(each.reason for each in found.estimates.values())
    assert found.robot == SMALL


class WithoutWheelSpeeds(KinematicPlant):
    """A plant that reports no wheel speeds."""

    def reset(self, pose):
        return super().reset(pose)._replace(wheel_speeds=())

    def step(self, command, dt):
        return super().step(command, dt)._replace(wheel_speeds=())


@pytest.mark.parametrize(
    ("plant", "shape"), [(KinematicPlant, (200, 4)), (WithoutWheelSpeeds, None)]
)
def test_log_holds_the_wheel_speeds_that_the_plant_reports(plant, shape):
    rng = np.random.default_rng(1)
    commands = identification_commands(SMALL, rng, 0.05, 10.0)
    log = simulated_log(plant(SMALL), commands, 0.05, rng)
    assert getattr(log.wheel_speeds, "shape", None) == shape


@pytest.mark.parametrize(
    ("separator", "decimal", "start"),
    [(";", ",", ""), ("\t", ".", "# drive\n# "), (" ", ".", ""), (",", ".", "# "), ("  ", ",", "")],
)
def test_log_in_another_table_format(tmp_path, separator, decimal, start):
    titles = ["t", "command_vx", "command_vy", "command_yaw_rate", "x", "y", "yaw", "note"]
    rows = [[k / 10, 0.25, -0.5, 1.5, 0.5 * k, 2.0, 0.125, 7.0] for k in range(4)]
    lines = [separator.join(str(value).replace(".", decimal) for value in row) for row in rows]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([start + separator.join(titles), *lines, ""]))
    log = read_log(path)
    assert log.t.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert log.commands[0].tolist() == [0.25, -0.5, 1.5]
    assert log.poses[3].tolist() == [1.5, 2.0, 0.125]
