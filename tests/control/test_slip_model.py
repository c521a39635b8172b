"""Commands to wheels that slip."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.control.nmpc.holonomic import Actuation, holonomic_nmpc
from omnidrive.control.nmpc.holonomic.slip_compensation import slip_compensation
from omnidrive.errors import InvalidInput
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.robot.drive_model import DriveModel
from omnidrive.robot.slip_response import slip_response
from omnidrive.simulation import MujocoPlant
from tests.examples import examples

DT = 0.1
ROBOTS = [named_robot("paper"), named_robot("small")]
SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_small_changes_are_followed_with_the_lag_of_the_robot(robot):
    """Distance lost: lag x change of velocity, for translation and for rotation."""
    model, commanded = DriveModel.of(robot), (2e-3, -1e-3, 3e-3)
    mean, final = slip_response(model, (0.0, 0.0, 0.0), commanded, 0.2)
    lost = (np.array(commanded) - mean) * 0.2 / np.array(commanded)
    assert lost == pytest.approx([robot.lag[0], robot.lag[0], robot.lag[1]], rel=0.02)
    np.testing.assert_allclose(final, commanded, rtol=2e-3)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_acceleration_stays_within_the_friction_limits(robot):
    rng = np.random.default_rng(1)
    model = DriveModel.of(robot)
    for _ in range(100):
        commanded = tuple((rng.normal(size=3) * [2.0, 2.0, 4.0]).tolist())
        _, final = slip_response(model, (0.0, 0.0, 0.0), commanded, 1e-3)
        assert np.abs(robot.acceleration_faces @ final).max() <= 1e-3 * (1 + 1e-9)
    _, final = slip_response(model, (0.0, 0.0, 0.0), (0.0, 0.0, 50.0), 1e-3)
    assert np.abs(robot.acceleration_faces @ final).max() == pytest.approx(0.95e-3, rel=1e-6)


@given(SEEDS)
@examples(30)
def test_command_reaches_the_desired_pose_within_the_friction_limits(seed):
    rng = np.random.default_rng(seed)
    robot = ROBOTS[seed % 2]
    initial = rng.normal(size=3) * [0.2, 0.2, 0.5]
    change = rng.normal(size=3) * [0.1, 0.1, 0.2]
    change *= min(1.0, 0.4 * DT / np.abs(robot.acceleration_faces @ change).max())
    desired = BodyTwist(*(initial + change).tolist())
    commanded, final = slip_compensation(
        DriveModel.of(robot), desired, BodyTwist(*initial.tolist()), DT
    )
    mean, end = slip_response(DriveModel.of(robot), tuple(initial.tolist()), tuple(commanded), DT)
    uncompensated, _ = slip_response(
        DriveModel.of(robot), tuple(initial.tolist()), tuple(desired), DT
    )
    errors_left = np.abs(np.subtract([mean, uncompensated], desired)).max(axis=1)
    assert errors_left[0] <= max(0.15 * errors_left[1], 1e-5)
    assert tuple(final) == end
    assert np.linalg.norm(np.subtract(commanded, desired)) < np.linalg.norm(change)


def test_command_keeps_the_wheel_speed_limit():
    robot = named_robot("small")
    commanded, _ = slip_compensation(
        DriveModel.of(robot), BodyTwist(3.0, 1.0, 9.0), BodyTwist(0.0, 0.0, 0.0), DT
    )
    speeds = np.abs(robot.chassis.wheel_speeds(commanded))
    assert speeds.max() == pytest.approx(robot.max_wheel_speed)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_may_spin_decides_whether_commands_exceed_the_friction_limit(robot):
    desired, rest = BodyTwist(1.0, 0.3, 3.0), BodyTwist(0.0, 0.0, 0.0)
    model = DriveModel.of(robot)
    for spins in (True, False):
        commanded, final = slip_compensation(model, desired, rest, DT, may_spin=spins)
        forces = model.rim_jacobian @ (model.stiffness * np.subtract(commanded, final))
        assert bool(np.abs(forces).max() > 1.1 * model.max_force) is spins
    gentle, initial = BodyTwist(0.51, 0.0, 0.2), BodyTwist(0.5, 0.0, 0.2)
    commands = [
        slip_compensation(model, gentle, initial, DT, may_spin=may) for may in (True, False)
    ]
    assert commands[0] == commands[1]


@given(SEEDS)
@examples(50)
def test_wheels_that_must_not_spin_are_below_the_friction_limit_at_the_end(seed):
    rng = np.random.default_rng(seed)
    robot = ROBOTS[seed % 2]
    model = DriveModel.of(robot)
    initial = BodyTwist(*(rng.normal(size=3) * [0.3, 0.3, 0.5]).tolist())
    desired = BodyTwist(*(rng.normal(size=3) * [0.8, 0.8, 1.5]).tolist())
    commanded, final = slip_compensation(model, desired, initial, DT, may_spin=False)
    forces = model.rim_jacobian @ (model.stiffness * np.subtract(commanded, final))
    assert np.abs(forces).max() < model.max_force * (1 + 1e-9)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_robot_that_turns_faster_than_friction_allows_is_braked(robot):
    """Its body twist needs too much centripetal force: wheels spin at every command near it."""
    model, twist = DriveModel.of(robot), BodyTwist(1.6, -0.9, 3.8)
    for _ in range(10):
        desired = BodyTwist(0.5 * twist.vx, 0.5 * twist.vy, 0.5 * twist.yaw_rate)
        _, twist = slip_compensation(model, desired, twist, DT, may_spin=False)
    assert np.abs(twist).max() < 0.1


@pytest.mark.parametrize("dt", [0.005, 0.02, 0.05, 0.1])
def test_commands_do_not_oscillate_at_any_sample_time(dt):
    """Under constant acceleration the commanded excess over the desired speed is smooth."""
    model, twist, excess = DriveModel.of(named_robot("small")), BodyTwist(0.0, 0.0, 0.0), []
    for k in range(1, 30):
        desired = BodyTwist(1.0 * dt * k, 0.0, 0.0)
        commanded, twist = slip_compensation(model, desired, twist, dt)
        excess.append(commanded.vx - desired.vx)
    assert min(excess) > 0.0
    assert np.abs(np.diff(excess[5:])).max() < 2e-3
    assert desired.vx - twist.vx < 0.02


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lag": (0.0, 0.01)}, "a slip model needs lags of at least 0.1 ms, got 0 s"),
        ({"friction": 0.0}, "a slip model needs a positive maximum wheel force, got 0"),
    ],
)
def test_robot_without_friction_or_lag_is_rejected(changes, message):
    with pytest.raises(InvalidInput, match=message):
        DriveModel.of(replace(named_robot("small"), **changes))


@pytest.mark.parametrize("traction", [0.0, -0.85, float("inf"), float("nan")])
def test_traction_that_is_not_positive_is_rejected(traction):
    with pytest.raises(InvalidInput, match="the traction must be positive"):
        Actuation.of(named_robot("small"), traction)


def test_speed_limit_of_the_chassis_overrides_that_of_the_robot():
    robot = named_robot("small")
    chassis = replace(robot, max_wheel_speed=10.0).chassis
    controller = holonomic_nmpc(chassis, DT, actuation=Actuation.of(robot))
    state = State(0.0, Pose(0.0, 0.0, 0.0))
    command = controller.step(0.0, state, Hold(Pose(9.0, 5.0, 2.0), 9.0))
    assert np.abs(chassis.wheel_speeds(command.twist)).max() <= 10.0 * (1 + 1e-9)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_prediction_on_physics_is_better_than_with_a_lag(robot):
    """With changes of the twist near the friction limits."""
    rng, plant, model = np.random.default_rng(4), MujocoPlant(robot), DriveModel.of(robot)
    pose = plant.reset(Pose(0.0, 0.0, 0.0)).pose
    command, twist, lagged, errors = np.zeros(3), (0.0, 0.0, 0.0), np.zeros(3), []
    ratios = DT / (np.array([robot.lag[0], *robot.lag]) + DT)
    for _ in range(60):
        change = rng.normal(size=3) * [1.0, 1.0, 2.0]
        change *= rng.uniform(0.3, 0.9) * DT / np.abs(robot.acceleration_faces @ change).max()
        command = 0.9 * command + change
        start, pose = pose, plant.step(BodyTwist(*command.tolist()), DT).pose
        truth = np.array(twist_between(start, pose, DT))
        mean, twist = slip_response(model, twist, tuple(command.tolist()), DT)
        lagged = lagged + ratios * (command - lagged)
        errors.append((np.abs(mean - truth), np.abs(lagged - truth)))
    slip_error, lag_error = np.mean(errors, axis=0)
    assert (slip_error[:2] < 0.5 * lag_error[:2]).all()
    assert slip_error[2] < 0.8 * lag_error[2]


def test_closed_loop_with_the_own_model_stays_on_a_circle():
    """The plant is the model itself; the robot enters the circle at speed."""
    robot = named_robot("paper")
    model = Actuation.of(robot).slip_model
    assert model is not None
    twist, pose = BodyTwist(0.5, 0.0, 1.0), Pose(0.0, 0.0, 0.0)
    for k in range(20):
        target = move(Pose(0.0, 0.0, 0.0), BodyTwist(0.5, 0.0, 1.0), DT * (k + 1))
        commanded, _ = slip_compensation(model, twist_between(pose, target, DT), twist, DT)
        mean, final = slip_response(model, tuple(twist), tuple(commanded), DT)
        pose, twist = move(pose, BodyTwist(*mean), DT), BodyTwist(*final)
        assert np.hypot(pose.x - target.x, pose.y - target.y) < 1e-5
    assert twist.vy == pytest.approx(0.0, abs=5e-3)
