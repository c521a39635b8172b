"""What to ask of wheels that slip."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.control.nmpc.holonomic import Actuation, SlipModel, holonomic_nmpc
from omnidrive.control.nmpc.holonomic.slip_model import slip_response
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import MujocoPlant

DT = 0.1
ROBOTS = [named_robot("paper"), named_robot("small")]
SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_gentle_changes_are_followed_with_the_robots_lag(robot):
    """Distance lost: lag x change of velocity, for translation and for rotation."""
    grip, asked = SlipModel.of(robot), (2e-3, -1e-3, 3e-3)
    done, after = slip_response(grip, (0.0, 0.0, 0.0), asked, 0.2)
    lost = (np.array(asked) - done) * 0.2 / np.array(asked)
    assert lost == pytest.approx([robot.lag[0], robot.lag[0], robot.lag[1]], rel=0.02)
    np.testing.assert_allclose(after, asked, rtol=2e-3)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_no_robot_accelerates_by_more_than_its_traction(robot):
    rng = np.random.default_rng(1)
    grip = SlipModel.of(robot)
    for _ in range(100):
        asked = tuple((rng.normal(size=3) * [2.0, 2.0, 4.0]).tolist())
        _, after = slip_response(grip, (0.0, 0.0, 0.0), asked, 1e-3)
        assert np.abs(robot.acceleration_faces @ after).max() <= 1e-3 * (1 + 1e-9)
    _, after = slip_response(grip, (0.0, 0.0, 0.0), (0.0, 0.0, 50.0), 1e-3)
    assert np.abs(robot.acceleration_faces @ after).max() == pytest.approx(0.95e-3, rel=1e-6)


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_what_is_asked_for_leads_where_it_should_if_the_wheels_can(seed):
    rng = np.random.default_rng(seed)
    robot = ROBOTS[seed % 2]
    before = rng.normal(size=3) * [0.2, 0.2, 0.5]
    change = rng.normal(size=3) * [0.1, 0.1, 0.2]
    change *= min(1.0, 0.4 * DT / np.abs(robot.acceleration_faces @ change).max())
    wanted = BodyTwist(*(before + change).tolist())
    asked, after = SlipModel.of(robot).command(wanted, BodyTwist(*before.tolist()), DT)
    done, ended = slip_response(SlipModel.of(robot), tuple(before.tolist()), tuple(asked), DT)
    plain, _ = slip_response(SlipModel.of(robot), tuple(before.tolist()), tuple(wanted), DT)
    missing = np.abs(np.subtract([done, plain], wanted)).max(axis=1)
    assert missing[0] <= max(0.15 * missing[1], 1e-5)
    assert tuple(after) == ended
    assert np.linalg.norm(np.subtract(asked, wanted)) < np.linalg.norm(change)


def test_no_wheel_is_asked_for_more_than_it_reaches():
    robot = named_robot("small")
    asked, _ = SlipModel.of(robot).command(BodyTwist(3.0, 1.0, 9.0), BodyTwist(0.0, 0.0, 0.0), DT)
    speeds = np.abs(robot.chassis.wheel_speeds(asked))
    assert speeds.max() == pytest.approx(robot.max_wheel_speed)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_wheels_that_must_not_spin_are_asked_for_what_they_reach(robot):
    wanted, rest = BodyTwist(1.0, 0.3, 3.0), BodyTwist(0.0, 0.0, 0.0)
    held = SlipModel.of(robot, may_spin=False)
    for grip, spins in ((SlipModel.of(robot), True), (held, False)):
        asked, after = grip.command(wanted, rest, DT)
        pushes = grip.rim_jacobian @ (grip.stiffness * np.subtract(asked, after))
        assert bool(np.abs(pushes).max() > 1.1 * grip.max_force) is spins
    gentle, before = BodyTwist(0.51, 0.0, 0.2), BodyTwist(0.5, 0.0, 0.2)
    assert held.command(gentle, before, DT) == SlipModel.of(robot).command(gentle, before, DT)


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_wheels_that_must_not_spin_do_not_in_the_end(seed):
    rng = np.random.default_rng(seed)
    robot = ROBOTS[seed % 2]
    grip = SlipModel.of(robot, may_spin=False)
    before = BodyTwist(*(rng.normal(size=3) * [0.3, 0.3, 0.5]).tolist())
    wanted = BodyTwist(*(rng.normal(size=3) * [0.8, 0.8, 1.5]).tolist())
    asked, after = grip.command(wanted, before, DT)
    pushes = grip.rim_jacobian @ (grip.stiffness * np.subtract(asked, after))
    assert np.abs(pushes).max() < grip.max_force * (1 + 1e-9)


@pytest.mark.parametrize("dt", [0.005, 0.02, 0.05, 0.1])
def test_at_any_sample_time_a_robot_of_the_model_speeds_up_smoothly(dt):
    """It is asked to be ever a little faster; what is asked for must not swing to and fro."""
    grip, moving, asks = SlipModel.of(named_robot("small")), BodyTwist(0.0, 0.0, 0.0), []
    for k in range(1, 30):
        wanted = BodyTwist(1.0 * dt * k, 0.0, 0.0)
        asked, moving = grip.command(wanted, moving, dt)
        asks.append(asked.vx - wanted.vx)
    assert min(asks) > 0.0
    assert np.abs(np.diff(asks[5:])).max() < 2e-3
    assert wanted.vx - moving.vx < 0.02


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lag": (0.0, 0.01)}, "a slip model needs lags of at least 0.1 ms, got 0 s"),
        ({"friction": 0.0}, "a slip model needs a positive maximum wheel force, got 0"),
    ],
)
def test_robots_without_grip_are_refused(changes, message):
    with pytest.raises(InvalidInput, match=message):
        SlipModel.of(replace(named_robot("small"), **changes))


@pytest.mark.parametrize("traction", [0.0, -0.85, float("inf"), float("nan")])
def test_a_traction_that_is_not_positive_is_refused(traction):
    with pytest.raises(InvalidInput, match="the traction must be positive"):
        Actuation.of(named_robot("small"), traction)


def test_a_slower_chassis_than_the_robots_is_respected():
    robot = named_robot("small")
    chassis = replace(robot, max_wheel_speed=10.0).chassis
    controller = holonomic_nmpc(chassis, DT, actuation=Actuation.of(robot))
    command = controller.step(0.0, Pose(0.0, 0.0, 0.0), Hold(Pose(9.0, 5.0, 2.0), 9.0))
    assert np.abs(chassis.wheel_speeds(command.twist)).max() <= 10.0 * (1 + 1e-9)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_it_foretells_rollers_better_than_a_lag(robot):
    """Changes that need about what the wheels can push, on physics."""
    rng, plant, grip = np.random.default_rng(4), MujocoPlant(robot), SlipModel.of(robot)
    pose = plant.reset(Pose(0.0, 0.0, 0.0)).pose
    command, moving, lagging, errors = np.zeros(3), (0.0, 0.0, 0.0), np.zeros(3), []
    parts = DT / (np.array([robot.lag[0], *robot.lag]) + DT)
    for _ in range(60):
        change = rng.normal(size=3) * [1.0, 1.0, 2.0]
        change *= rng.uniform(0.3, 0.9) * DT / np.abs(robot.acceleration_faces @ change).max()
        command = 0.9 * command + change
        start, pose = pose, plant.step(BodyTwist(*command.tolist()), DT).pose
        truth = np.array(twist_between(start, pose, DT))
        done, moving = slip_response(grip, moving, tuple(command.tolist()), DT)
        lagging = lagging + parts * (command - lagging)
        errors.append((np.abs(done - truth), np.abs(lagging - truth)))
    by_grip, by_lag = np.mean(errors, axis=0)
    assert (by_grip[:2] < 0.5 * by_lag[:2]).all()
    assert by_grip[2] < 0.8 * by_lag[2]


def test_a_robot_drives_as_its_grip_says_through_bends():
    """The controller's own model, closed: it stays on a circle that it joins at speed."""
    robot = named_robot("paper")
    grip = Actuation.of(robot).slip_model
    assert grip is not None
    moving, pose = BodyTwist(0.5, 0.0, 1.0), Pose(0.0, 0.0, 0.0)
    for k in range(20):
        there = move(Pose(0.0, 0.0, 0.0), BodyTwist(0.5, 0.0, 1.0), DT * (k + 1))
        asked, _ = grip.command(twist_between(pose, there, DT), moving, DT)
        done, after = slip_response(grip, tuple(moving), tuple(asked), DT)
        pose, moving = move(pose, BodyTwist(*done), DT), BodyTwist(*after)
        assert np.hypot(pose.x - there.x, pose.y - there.y) < 1e-5
    assert moving.vy == pytest.approx(0.0, abs=5e-3)
