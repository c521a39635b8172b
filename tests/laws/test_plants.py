"""Properties of every plant. A new plant only has to be added to PLANTS."""

import subprocess
import sys
from dataclasses import replace
from inspect import unwrap
from math import inf, nan

import numpy as np
import pytest

from omnidrive.control import WheelSpeeds, WheelTorques
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, move, to_body, to_world
from omnidrive.robot import ROBOTS, named_robot
from omnidrive.simulation import KinematicPlant, MujocoPlant, PlanarPlant, Saturation
from omnidrive.testing import check_plant
from omnidrive.testing.laws import rotated

PLANTS = {
    "kinematic": KinematicPlant,
    "ball": lambda robot: MujocoPlant(robot, "ball"),
    "rollers": lambda robot: MujocoPlant(robot, "rollers"),
    "planar": PlanarPlant,
}
every_plant = pytest.mark.parametrize("make", PLANTS.values(), ids=PLANTS)
every_robot = pytest.mark.parametrize("robot", ROBOTS)
TWISTS = [BodyTwist(0.5, 0.0, 0.0), BodyTwist(0.0, 0.5, 0.0), BodyTwist(0.0, 0.0, 1.0)]


def drive(plant, start, twist, steps, dt=0.1):
    plant.reset(start)
    return [plant.step(twist, dt) for _ in range(steps)]


@every_plant
def test_obeys_the_public_laws(make):
    """Protocol, determinism and reset; most of the other laws are stricter below."""
    check_plant(lambda context: make(context.robot))


@every_plant
@every_robot
def test_starts_at_rest_at_the_given_pose(make, robot):
    plant = make(named_robot(robot))
    start = Pose(1.0, -2.0, 4.0)
    state = plant.reset(start)
    assert np.array(state.pose) == pytest.approx(start, abs=1e-12)
    assert np.array(state.twist) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    later = plant.step(BodyTwist(0.0, 0.0, 0.0), 1.0)
    assert np.array(later.pose) == pytest.approx(start, abs=2e-5)


# m/s and rad/s; the change from roller to roller affects light robots more
BIAS = {
    ("small", "rollers"): 1e-3,
    ("kiwi", "rollers"): 1.5e-3,
    ("small", "planar"): 2e-3,
    ("kiwi", "planar"): 3e-3,
}


@pytest.mark.parametrize("plant", PLANTS)
@every_robot
@pytest.mark.parametrize("twist", TWISTS)
def test_mean_velocity_equals_the_command(plant, robot, twist):
    """Bias at 0.5 m/s and 1 rad/s over 10 s, after 1 s of acceleration.

    It is measured in the frame of the robot after that second: a start at once spins wheels and can
    turn the robot.
    """
    states = drive(PLANTS[plant](named_robot(robot)), Pose(0.0, 0.0, 0.0), twist, 110)
    before, after = states[9].pose, states[-1].pose
    moved = to_body(WorldTwist(*np.subtract(after, before) / 10.0), before.yaw)
    assert np.array(moved) == pytest.approx(np.array(twist), abs=BIAS.get((robot, plant), 5e-4))


@every_plant
@pytest.mark.parametrize("twist", [*TWISTS, BodyTwist(0.3, -0.2, 0.7)])
def test_rotation_of_the_world_rotates_the_motion(make, twist):
    start, angle = Pose(0.5, 0.2, 0.3), 2.0
    once = drive(make(named_robot("small")), start, twist, 10)[-1].pose
    other = drive(make(named_robot("small")), rotated(start, angle), twist, 10)[-1].pose
    assert np.array(rotated(once, angle)) == pytest.approx(np.array(other), abs=2e-4)


@every_plant
def test_saturated_command_keeps_its_direction(make):
    robot = named_robot("small")
    command = BodyTwist(30.0, 10.0, 0.0)
    saturated = robot.chassis.saturate(command)
    states = drive(make(robot), Pose(0.0, 0.0, 0.0), command, 40)
    realised = np.array(states[-1].twist)
    assert realised == pytest.approx(np.array(saturated), rel=0.05, abs=0.05)


@every_plant
@every_robot
@pytest.mark.parametrize("twist", [BodyTwist(0.5, -0.2, 0.7), BodyTwist(30.0, 10.0, 5.0)])
def test_wheel_speeds_of_a_twist_give_the_motion_of_the_twist(make, robot, twist):
    """Also when they are scaled down to the largest wheel speed."""
    plant, start = make(named_robot(robot)), Pose(0.2, 0.1, 0.3)
    by_twist = drive(plant, start, twist, 5)
    by_wheels = drive(plant, start, WheelSpeeds(plant.robot.drive.wheel_speeds(twist)), 5)
    for a, b in zip(by_twist, by_wheels, strict=True):
        assert np.array(a.pose) == pytest.approx(b.pose, abs=1e-9)
        assert np.array(a.twist) == pytest.approx(b.twist, abs=1e-8)
        assert a.saturated == b.saturated


@every_plant
def test_reported_wheel_speeds_are_those_of_the_motion(make):
    """Without slip; rollers cause a ripple."""
    plant = make(named_robot("mecanum"))
    assert plant.reset(Pose(0.0, 0.0, 0.0)).wheel_speeds == (0.0,) * 4
    for k in range(21):
        state = plant.step(BodyTwist(0.02 * k, 0.01 * k, 0.01 * k), 0.1)
    expected = plant.robot.chassis.wheel_speeds(state.twist)
    assert state.wheel_speeds == pytest.approx(expected, rel=0.02, abs=0.05)
    assert state.saturated == Saturation.NONE


@every_plant
def test_excessive_wheel_speeds_are_reported(make):
    plant = make(named_robot("small"))
    assert plant.reset(Pose(0.0, 0.0, 0.0)).saturated == Saturation.NONE
    for command in (BodyTwist(9.0, 0.0, 0.0), WheelSpeeds([80.0, 0.0, 0.0, 0.0])):
        assert plant.step(command, 0.1).saturated & Saturation.WHEEL_SPEED


@every_plant
@pytest.mark.parametrize(
    ("command", "message"),
    [
        (WheelSpeeds([1.0, 2.0, 3.0]), "holds 3 wheel speeds, but the robot has 4 wheels"),
        ((0.1, 0.0, 0.0), "got a tuple"),
        (WorldTwist(0.1, 0.0, 0.0), "got a WorldTwist"),
        (BodyTwist(nan, 0.0, 0.0), r"numbers within \+-1e\+09, got BodyTwist\(vx=nan"),
        (BodyTwist(0.0, -inf, 0.0), "numbers within"),
        (BodyTwist(0.0, 0.0, 1e308), "numbers within"),
        (BodyTwist("a", 0.0, 0.0), "numbers within"),
        (BodyTwist(10**5000, 0.0, 0.0), "numbers within .* got a BodyTwist"),  # without a repr
        (WheelSpeeds([nan, 0.0, 0.0, 0.0]), "numbers within"),
    ],
)
def test_malformed_command_is_refused(make, command, message):
    plant = make(named_robot("small"))
    plant.reset(Pose(0.0, 0.0, 0.0))
    with pytest.raises(InvalidInput, match=message):
        unwrap(type(plant).step)(plant, command, 0.1)  # without type checks


@every_plant
@pytest.mark.parametrize("dt", [0.0, -0.1, nan, inf, 1e6, 1e-300, "0.1", None])
def test_invalid_duration_is_refused_and_changes_nothing(make, dt):
    plant, twist = make(named_robot("small")), BodyTwist(0.3, 0.1, 0.2)
    start = plant.reset(Pose(0.0, 0.0, 0.0))
    with pytest.raises(InvalidInput, match=r"the sample time (is .* s, need|must be a number)"):
        unwrap(type(plant).step)(plant, twist, dt)  # without type checks
    after = plant.step(twist, 0.1)
    plant.reset(start.pose)
    assert repr(plant.step(twist, 0.1)) == repr(after)


LONG_STEP = """
import signal, threading, time
import omnidrive as od
robot = od.named_robot("small")
for plant in (od.PlanarPlant(robot, timestep=1e-6), od.MujocoPlant(robot, "ball")):
    plant.reset(od.Pose(0.0, 0.0, 0.0))
    threading.Timer(0.1, signal.raise_signal, [signal.SIGINT]).start()
    began = time.monotonic()
    try:
        plant.step(od.BodyTwist(0.1, 0.0, 0.0), 3600.0)  # minutes
    except KeyboardInterrupt:
        print(time.monotonic() - began)
"""


def test_long_step_is_interrupted_at_once():
    done = subprocess.run(
        [sys.executable, "-c", LONG_STEP],
        capture_output=True, text=True, timeout=100, check=True,
    )  # fmt: skip
    waits = [float(line) for line in done.stdout.split()]
    assert len(waits) == 2
    assert max(waits) < 3.0


@pytest.mark.parametrize("plant", PLANTS)
def test_torques_are_executed_or_refused(plant):
    plant = PLANTS[plant](named_robot("small"))
    plant.reset(Pose(0.0, 0.0, 0.0))
    torques = WheelTorques([0.1, 0.1, 0.1, 0.1])
    if plant.capabilities.wheel_torques:
        state = plant.step(torques, 0.05)
        assert state.wheel_torques == pytest.approx(torques)
        assert state.twist.yaw_rate > 0.05
    else:
        with pytest.raises(InvalidInput, match="does not execute wheel torques: command a BodyTw"):
            plant.step(torques, 0.05)


@every_plant
def test_wrong_effective_radius_scales_the_yaw_rate(make):
    """The error of the published code: 0.5 m instead of 0.7071 m gives 0.707 of the yaw rate."""
    plant = make(named_robot("paper", assumed_effective_radius=0.5))
    states = drive(plant, Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 1.0), 30)
    rate = (states[-1].pose.yaw - states[9].pose.yaw) / 2.0
    assert rate == pytest.approx(0.5 / np.hypot(0.5, 0.5), abs=2e-3)


@every_plant
def test_drive_gain_scales_the_twist(make):
    robot = replace(named_robot("small"), drive_gain=(0.9, 1.1, 0.8))
    for k, gain in enumerate(robot.drive_gain):
        twist = BodyTwist(*(0.3 * np.eye(3)[k]).tolist())
        state = drive(make(robot), Pose(0.0, 0.0, 0.0), twist, 20)[-1]
        assert state.twist[k] == pytest.approx(gain * 0.3, rel=0.06)


@every_plant
def test_yaw_is_continuous_over_whole_turns(make):
    states = drive(make(named_robot("small")), Pose(0.0, 0.0, 3.0), BodyTwist(0.0, 0.0, 3.0), 30)
    yaw = np.array([s.pose.yaw for s in states])
    assert (np.diff(yaw) > 0.0).all()
    assert yaw[-1] == pytest.approx(3.0 + 9.0, abs=0.3)


@every_plant
def test_reported_velocity_is_the_derivative_of_the_pose(make):
    plant, twist = make(named_robot("small")), BodyTwist(0.4, 0.2, 0.5)
    drive(plant, Pose(0.0, 0.0, 0.0), twist, 10)
    a = plant.step(twist, 0.01)
    b = plant.step(twist, 0.01)
    world: WorldTwist = to_world(a.twist, a.pose.yaw)
    moved = np.subtract(b.pose, a.pose) / 0.01
    assert moved == pytest.approx(np.array(world), abs=0.04)  # rollers cause a ripple of 4 %


@pytest.mark.parametrize("plant", [name for name in PLANTS if name != "kinematic"])
def test_motors_do_work(plant):
    plant = PLANTS[plant](named_robot("small"))
    states = drive(plant, Pose(0.0, 0.0, 0.0), BodyTwist(1.0, 0.0, 0.0), 10)
    work = [s.work for s in states]
    assert work == sorted(work)
    assert work[-1] > 0.5 * 10.0 * 1.0**2  # at least the kinetic energy of 10 kg at 1 m/s


@pytest.mark.parametrize("wheels", ["ball", "rollers"])
def test_model_has_the_mass_of_the_robot(wheels):
    robot = named_robot("paper")
    plant = MujocoPlant(robot, wheels)
    assert plant._model.body_mass.sum() == pytest.approx(robot.mass, rel=1e-9)


def test_kinematic_plant_moves_along_the_arc():
    twist = BodyTwist(0.3, -0.1, 0.8)
    start = Pose(0.1, 0.2, 0.3)
    end = drive(KinematicPlant(named_robot("small")), start, twist, 7)[-1].pose
    assert np.array(end) == pytest.approx(move(start, twist, 0.7), abs=1e-12)


@pytest.mark.parametrize("wheels", ["ball", "rollers"])
def test_diverged_state_is_reported_as_nan(wheels, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plant = MujocoPlant(named_robot("small"), wheels)
    plant.reset(Pose(0.0, 0.0, 0.0))
    plant._data.qvel[0] = nan
    assert np.isnan(plant.step(BodyTwist(0.0, 0.0, 0.0), 0.1).pose).all()
    assert not list(tmp_path.iterdir())  # no log file of MuJoCo
