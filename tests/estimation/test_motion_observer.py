"""Motion observer: twist, disturbance and noise from poses and commands."""

from math import nan

import numpy as np
import pytest

from omnidrive.estimation.drive_estimate import DriveEstimate, DriveSettings
from omnidrive.estimation.motion.disturbance import disturbance_at, without_disturbance
from omnidrive.estimation.motion.motion_memory import motion_memory, remember
from omnidrive.estimation.motion.observation import Measurement, observe
from omnidrive.estimation.motion.robot_model import RobotModel
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.robot import named_robot
from omnidrive.robot.drive_model import DriveModel
from omnidrive.robot.slip_response import slip_response

DT = 0.05
SMALL = named_robot("small")
UNKNOWN = (nan, nan, nan)
FIRST = Measurement(nan, (0.0, 0.0, 0.0), UNKNOWN, (-1.0, -1.0, -1.0), True)


def plant(model):
    return RobotModel(
        model,
        SMALL.chassis.jacobian,
        np.empty((0, 3)),
        SMALL.max_wheel_speed,
        DriveEstimate().parameters,
        None,
        DriveSettings(),
    )


MODELS = [DriveModel.of(SMALL), DriveModel.without_slip(SMALL.chassis, (0.05, 0.02))]


class Robot:
    """A robot that moves as the model does, with the disturbance ``lacking`` in its twist."""

    def __init__(self, model, lacking=(0.0, 0.0, 0.0), sigma=0.0):
        self.model, self.lacking, self.sigma = model, np.array(lacking), sigma
        self.pose, self.twist = Pose(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        self.memory, self.rng = motion_memory(3), np.random.default_rng(3)
        self.state = self.memory.state.view(np.recarray)[0]
        observe(plant(model), self.memory, FIRST, DT, True)

    def step(self, command, *, steady=True, moved=0.0, twist=UNKNOWN, outlier=0.0, elapsed=DT):
        """Move with a command for DT, then observe the pose, which is wrong by an outlier along x.

        ``elapsed`` is the time by the clock.
        """
        remember(self.memory, tuple(command))
        total = tuple((np.array(command) + self.lacking).tolist())
        mean, self.twist = slip_response(self.model, self.twist, total, DT)
        self.pose = move(self.pose, BodyTwist(*mean), DT)
        self.pose = self.pose._replace(x=self.pose.x + moved)
        noise = self.sigma * self.rng.normal(size=3)
        measured = tuple((np.array(self.pose) + noise + (outlier, 0.0, 0.0)).tolist())
        variance = (-1.0, -1.0, -1.0) if self.sigma or steady else (0.0, 0.0, 0.0)
        now = Measurement(elapsed, measured, twist, variance, True)
        observe(plant(self.model), self.memory, now, DT, steady)


def gentle(k):
    return (0.3 * np.sin(0.1 * k), 0.2, 0.3 * np.cos(0.07 * k))


@pytest.mark.parametrize("model", MODELS)
def test_disturbance_is_found_and_the_twist_exact(model):
    lacking = (0.05, -0.03, 0.1)
    robot = Robot(model, lacking)
    for k in range(60):
        robot.step(gentle(k))
    assert np.allclose(robot.state.disturbance, lacking, atol=2e-3)
    assert np.allclose(robot.state.twist, robot.twist, atol=2e-3)
    assert np.allclose(robot.state.pose, robot.pose, atol=1e-5)


def test_disturbance_is_kept_in_transients_and_while_wheels_slip():
    robot = Robot(MODELS[0], (0.05, 0.0, 0.0))
    for k in range(20):
        robot.step(gentle(k), steady=False)
    assert not robot.state.disturbance.any()
    robot.step((2.0, 0.0, 0.0))  # far above the friction limit
    assert not robot.state.disturbance.any()
    robot.step(robot.twist)
    assert robot.state.disturbance.any()


@pytest.mark.parametrize("model", MODELS)
def test_twist_of_a_pushed_robot_is_found(model):
    robot = Robot(model)
    for k in range(10):
        robot.step(gentle(k))
    robot.twist = (robot.twist[0], robot.twist[1] + 0.5, robot.twist[2])
    robot.step(gentle(10), steady=False)
    assert np.allclose(robot.state.twist, robot.twist, atol=0.2)
    robot.step(gentle(11), steady=False)
    assert np.allclose(robot.state.twist, robot.twist, atol=0.05)


@pytest.mark.parametrize("moved", [0.2, 1.0])
def test_robot_that_is_moved_keeps_its_twist(moved):
    robot = Robot(MODELS[0])
    for k in range(10):
        robot.step(gentle(k))
    robot.step(gentle(10), moved=moved)
    assert np.allclose(robot.state.pose, robot.pose, atol=1e-9)
    assert np.allclose(robot.state.twist, robot.twist, atol=1e-3)
    assert np.abs(robot.state.disturbance).max() < 1e-3


@pytest.mark.parametrize("outlier", [0.5, -30.0, 1e9])
def test_outlier_of_the_pose_changes_neither_twist_nor_disturbance(outlier):
    robot = Robot(MODELS[0])
    for k in range(10):
        robot.step(gentle(k))
    robot.step(gentle(10), outlier=outlier)
    robot.step(gentle(11))
    assert np.allclose(robot.state.pose, robot.pose, atol=1e-6)
    assert np.allclose(robot.state.twist, robot.twist, atol=1e-3)
    assert np.abs(robot.state.disturbance).max() < 1e-3


def test_outliers_within_reach_of_the_robot_raise_the_noise_little():
    robot = Robot(MODELS[0])
    for k in range(20):
        robot.step(gentle(k))
    robot.state.covariance[:, 1, 1] = 4.0  # its twist is in doubt
    robot.step(gentle(20), outlier=0.1)
    robot.state.covariance[:, 1, 1] = 4.0
    robot.step(gentle(21))
    assert 0.0 < robot.state.noise.position_variance < 0.01**2


@pytest.mark.parametrize("outlier", [(3.0, -2.0, 4.0), (1e5, 0.0, 0.0), (0.0, 0.0, -1e5)])
def test_outlier_of_the_twist_is_ignored(outlier):
    robot = Robot(MODELS[0])
    for k in range(10):
        robot.step(gentle(k))
    robot.step(gentle(10), twist=outlier)
    assert np.allclose(robot.state.twist, robot.twist, atol=1e-3)


@pytest.mark.parametrize("model", MODELS)
def test_impossible_twist_at_the_start_is_ignored(model):
    memory = motion_memory(0)
    observe(plant(model), memory, FIRST._replace(twist=(1e3, 0.0, 0.0)), DT, True)
    assert not memory.state["twist"].any()


def test_wrong_twist_is_corrected_by_the_poses():
    robot = Robot(MODELS[0])
    for k in range(10):
        robot.step(gentle(k))
    robot.state.twist[:] = 4.0, -3.0, 5.0
    for k in range(10, 13):
        robot.step(gentle(k))
    assert np.allclose(robot.state.twist, robot.twist, atol=0.2)


def test_wrong_disturbance_with_which_wheels_would_slip_is_corrected():
    robot = Robot(MODELS[0])
    robot.state.disturbance[:2] = 0.25, -0.2
    for k in range(60):
        robot.step(gentle(k))
    assert np.abs(robot.state.disturbance).max() < 0.01


def test_wrong_disturbance_is_corrected_while_wheels_slip_for_long():
    robot = Robot(MODELS[0])
    robot.state.disturbance[2] = 1.4
    for k in range(60):
        robot.step((0.0, 0.0, 2.0 if k % 4 < 2 else -2.0))
    assert np.abs(robot.state.disturbance).max() < 0.7


@pytest.mark.parametrize("elapsed", [-1.0, 0.0, 0.2 * DT])
def test_clock_that_was_set_back_costs_nothing(elapsed):
    robot = Robot(MODELS[0])
    for k in range(10):
        robot.step(gentle(k))
    robot.step(gentle(10), elapsed=elapsed)
    assert np.allclose(robot.state.twist, robot.twist, atol=1e-3)
    assert np.abs(robot.state.disturbance).max() < 1e-3


def test_disturbance_is_bounded():
    robot = Robot(MODELS[0], (0.0, 0.0, 3.0))
    for k in range(50):
        robot.step(gentle(k))
    largest = 0.1 * MODELS[0].max_rim_speed * np.sqrt(SMALL.inertia[0] / SMALL.inertia[2])
    assert robot.state.disturbance[2] == pytest.approx(largest)


def test_twist_of_the_state_replaces_the_observed_one():
    robot = Robot(MODELS[0])
    robot.step(gentle(0), twist=(0.1, 0.2, 0.3))
    assert robot.state.twist.tolist() == [0.1, 0.2, 0.3]


@pytest.mark.parametrize(("sigma", "left"), [(0.003, 0.45), (0.03, 0.25)])
def test_noise_of_the_poses_is_estimated_and_reduced(sigma, left):
    estimates, errors = [], []
    robot = Robot(MODELS[0], sigma=sigma)
    for k in range(400):
        robot.step(gentle(k))
        estimates.append(np.sqrt(max(robot.state.noise.position_variance, 0.0)))
        errors.append(np.subtract(robot.state.pose[:2], robot.pose[:2]))
    assert np.median(estimates[50:]) == pytest.approx(sigma, rel=0.25)
    assert np.std(errors[50:]) < left * sigma
    assert abs(robot.state.disturbance).max() < 0.1


def test_errors_of_the_model_are_no_noise():
    robot = Robot(MODELS[0], (0.05, 0.0, 0.0))
    for k in range(100):
        robot.lacking = 0.1 * np.array(gentle(k))  # a wrong gain
        robot.step(gentle(k))
        assert robot.state.noise.position_variance < 1e-6


@pytest.mark.parametrize("model", MODELS)
def test_wrong_gains_are_found_in_noise(model):
    robot, errors = Robot(model, sigma=0.04), []
    for k in range(600):
        robot.lacking = np.array([-0.05, -0.05, -0.1]) * gentle(k)
        robot.step(gentle(k))
        errors.append(robot.state.pose[2] - robot.pose.yaw)
    command = (0.3, 0.2, 0.3)
    lacking = disturbance_at(model, robot.state, command)
    assert lacking[2] == pytest.approx(-0.1 * command[2], rel=0.5)
    assert np.abs(errors[300:]).mean() < 0.01


@pytest.mark.parametrize("sigma", [0.0, 0.02])
def test_command_without_disturbance_has_the_desired_effect(sigma):
    model, robot = MODELS[0], Robot(MODELS[0], (0.05, -0.03, 0.1), sigma)
    for k in range(60):
        robot.step(gentle(k))
    desired = (0.4, -0.2, 1.0)
    command = without_disturbance(model, robot.state, desired)
    effect = np.add(command, disturbance_at(model, robot.state, command))
    assert np.allclose(effect, desired, atol=1e-12)
    assert not np.allclose(command, desired, atol=1e-6)


def test_covariances_stay_positive_semidefinite():
    robot, rng = Robot(MODELS[0], sigma=0.01), np.random.default_rng(5)
    for k in range(300):
        robot.step(rng.normal(size=3).tolist(), steady=bool(k % 3))
        for covariance in robot.state.covariance:
            assert np.array_equal(covariance, covariance.T)
            assert np.linalg.eigvalsh(covariance).min() > -1e-12
