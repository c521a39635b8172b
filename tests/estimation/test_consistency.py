"""The pose filter on wheels with rollers: consistency of the error, no false relocations."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.stats import chi2

from omnidrive.estimation import PoseEstimator, PoseFixSettings, SensorReadings, SensorSettings
from omnidrive.geometry import BodyTwist, Pose, twist_between
from omnidrive.robot import named_robot
from omnidrive.robot.wheel import contact_drift, contact_wave
from omnidrive.simulation import PlanarPlant, SensorSuite

DT, STEPS, RUNS = 0.05, 160, 12
TURNING = BodyTwist(0.6, 0.0, 0.6)  # on a circle of 1 m, on which two wheels of `paper` hardly turn


def circle(robot, seed):
    """States of a robot with random wheel angles that accelerates for 1 s on a circle of 1 m."""
    plant = PlanarPlant(robot, np.random.default_rng(seed))
    states = [plant.reset(Pose(0.0, 0.0, 0.0))]
    for k in range(STEPS):
        share = min(DT * (k + 1), 1.0)
        states.append(plant.step(BodyTwist(*(share * each for each in TURNING)), DT))
    return states


def filtered(robot, states, fixes, seed, scale=1.0):
    """Return the NEES at the end and the estimator; ``scale`` times the stated deviations."""
    settings = SensorSettings(fixes=fixes)
    suite = SensorSuite(settings, robot.chassis, np.random.default_rng([seed, 1]))
    estimator = PoseEstimator(robot, settings)
    suite.reset(states[0].pose)
    estimator.reset(states[0].pose)
    for k, state in enumerate(states):
        readings = suite.read(DT * k, state)
        stated = tuple(
            fix._replace(position_sigma=scale * fix.position_sigma, yaw_sigma=scale * fix.yaw_sigma)
            for fix in readings.fixes
        )
        found = estimator.update(readings._replace(fixes=stated))
    error = np.array(twist_between(found.pose, states[-1].pose, 1.0))
    return error @ np.linalg.solve(found.covariance, error), estimator


@pytest.mark.parametrize("name", ["paper", "mecanum"])
@pytest.mark.parametrize(
    "fixes",
    [None, PoseFixSettings(), PoseFixSettings(outliers=0.05), PoseFixSettings(law="paper")],
    ids=["none", "white", "outlying", "paper"],
)
def test_error_on_rollers_matches_its_covariance(name, fixes):
    """The upper bound is twice the 99.99 % quantile: harmonics of the offset are not modelled."""
    robot, squares = named_robot(name), []
    for seed in range(RUNS):
        square, estimator = filtered(robot, circle(robot, seed), fixes, seed)
        squares.append(square)
        assert not estimator.relocations
        assert not estimator.restarts
    assert np.mean(squares) < 2.0 * chi2.ppf(0.9999, 3 * RUNS) / RUNS


def test_dead_reckoning_on_rollers_has_no_mean_error_of_the_yaw():
    """Contacts at their mean offset would be 1 mrad, roundings without their noise 0.7 mrad."""
    robot, errors = named_robot("small"), []
    for seed in range(RUNS):
        states = circle(robot, seed)
        sensors = SensorSettings(fixes=None)
        suite = SensorSuite(sensors, robot.chassis, np.random.default_rng([seed, 1]))
        estimator = PoseEstimator(robot, sensors)
        suite.reset(states[0].pose)
        estimator.reset(states[0].pose)
        for k, state in enumerate(states):
            found = estimator.update(suite.read(DT * k, state))
        errors.append(twist_between(found.pose, states[-1].pose, 1.0).yaw_rate)
    deviation = np.std(errors, ddof=1) / np.sqrt(RUNS)
    assert abs(np.mean(errors)) < 4.0 * deviation


@pytest.mark.parametrize("ratio", [1.0 / 3.0, 3.0])
def test_wrong_covariance_of_the_fixes_is_estimated(ratio):
    robot = named_robot("paper")
    scales = [
        filtered(robot, circle(robot, seed), PoseFixSettings(), seed, scale=ratio**0.5)[1]
        .filter_state.fix_scale
        for seed in range(4)
    ]  # fmt: skip
    assert np.mean(scales) == pytest.approx(1.0 / ratio, rel=0.2)


def test_estimated_scale_of_the_covariance_is_bounded():
    robot = named_robot("paper")
    for seed, sigma in enumerate((1e-3, 1.0)):
        stated = PoseFixSettings(position_sigma=0.05, yaw_sigma=0.05)
        _, estimator = filtered(robot, circle(robot, 0), stated, seed, scale=sigma / 0.05)
        assert 0.1 <= estimator.filter_state.fix_scale <= 10.0


def test_rounding_does_not_accumulate_at_rest():
    robot = named_robot("paper")
    estimator = PoseEstimator(robot, SensorSettings(gyro=None, fixes=None))
    for k in range(2000):
        state = estimator.update(SensorReadings(DT * k, (0.0,) * 4))
    assert state.position_sigma < 2.0 * robot.wheel.radius * 2.0 * pi / 4096


def test_wave_of_the_contacts_has_the_mean_squares_of_the_offset():
    """Of a trapezoid wave with ramps of a tenth of the period, and of a saw tooth."""
    phase = np.linspace(0.0, 2.0 * pi, 100_000, endpoint=False)
    two_rows, tilted = named_robot("paper").wheel, named_robot("mecanum").wheel
    ramps = np.clip(np.arcsin(np.sin(phase)) / (0.1 * pi), -1.0, 1.0)
    for wheel, angle, offset, order in (
        (two_rows, 0.0, 0.5 * two_rows.row_gap * ramps, 3),
        (tilted, 0.5, contact_drift(tilted, 0.5) * (phase / pi - 1.0), 2),
    ):
        squares = 2.0 * np.abs(np.fft.rfft(offset) / len(phase)) ** 2
        wave = contact_wave(wheel, angle)
        assert wave.order == order
        assert wave.fundamental**2 == pytest.approx(squares[1], 1e-3)
        assert wave.harmonic**2 == pytest.approx(squares[order], 1e-3)
        total = wave.fundamental**2 + wave.harmonic**2 + wave.rest**2
        assert total == pytest.approx(np.mean(offset**2), 1e-3)
        assert wave.period == pytest.approx(2.0 * pi / wheel.rollers_per_row)
    assert contact_wave(replace(two_rows, rows=1), 0.0).fundamental == pytest.approx(0.0)
