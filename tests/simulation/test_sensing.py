"""Simulated sensors: noise, delay and faults according to their settings; readings and states."""

from dataclasses import replace
from itertools import pairwise
from math import inf, isnan, pi

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from omnidrive.errors import InvalidInput
from omnidrive.estimation import (
    EncoderSettings,
    GyroSettings,
    LatestFix,
    PoseEstimator,
    PoseFixSettings,
    SensorSettings,
    State,
    StateEstimator,
)
from omnidrive.geometry import BodyTwist, move
from omnidrive.simulation import (
    KinematicPlant,
    MujocoPlant,
    PaperNoise,
    PerfectSensors,
    PlantState,
    SensorFaults,
    Sensors,
    SensorSuite,
)
from omnidrive.simulation.sensors import Encoders, Gyro, PoseFixes
from tests.estimates import Perception
from tests.estimation.drive import REST, ROBOT, START


def standing(pose=START, angles=()):
    return PlantState(pose, REST, 0.0, angles)


def fixes(settings, seed=0):
    rng = np.random.default_rng(seed)
    sensor = PoseFixes(settings, rng, rng.spawn(1)[0])
    sensor.reset(START)
    return sensor


def errors(settings, seconds, seed=0):
    """Return the errors of all fixes of a robot at rest, one row each."""
    found = fixes(settings, seed).read(seconds, START)
    return np.array([np.subtract(fix.pose, START) for fix in found])


def test_encoders_report_whole_counts():
    encoders = Encoders(EncoderSettings(counts_per_turn=100), ROBOT.chassis)
    turned = (0.1, -7.3, 40.0, 1e-3)
    read = np.array(encoders.read(standing(angles=turned)))
    counts = read * 100 / (2 * pi)
    assert counts == pytest.approx(np.round(counts), abs=1e-9)
    assert np.abs(read - turned).max() <= pi / 100


def test_dead_encoder_reports_nothing():
    read = Encoders(EncoderSettings(), ROBOT.chassis).read(standing(angles=(1.0,) * 4), {2})
    assert [isnan(angle) for angle in read] == [False, False, True, False]


def test_encoders_of_a_plant_without_wheels_measure_rolling_without_slip():
    plant, twist = KinematicPlant(ROBOT), BodyTwist(0.4, -0.2, 0.3)
    encoders = Encoders(EncoderSettings(counts_per_turn=2**20), ROBOT.chassis)
    plant.reset(START)
    encoders.reset(START)
    for _ in range(10):
        read = encoders.read(plant.step(twist, 0.1))
    assert np.array(read) == pytest.approx(ROBOT.chassis.wheel_speeds(twist), abs=1e-5)


@pytest.mark.parametrize("wheels", ["rollers", "ball"])
def test_encoders_of_a_physical_plant_match_the_chassis(wheels):
    plant, twist = MujocoPlant(ROBOT, wheels), BodyTwist(0.3, 0.2, 0.2)
    plant.reset(START)
    before = plant.step(twist, 1.0).wheel_angles
    after = plant.step(twist, 1.0).wheel_angles
    turned = np.subtract(after, before)
    assert turned == pytest.approx(ROBOT.chassis.wheel_speeds(twist), abs=0.02)


def test_gyro_noise_and_bias():
    settings = GyroSettings(noise_density=0.01, bias=0.1, bias_walk=0.0)
    gyro = Gyro(settings, np.random.default_rng(1))
    biases = []
    for _ in range(2000):
        gyro.reset()
        biases.append(gyro.bias)
    assert np.std(biases) == pytest.approx(0.1, rel=0.06)
    read = np.array([gyro.read(0.05, 0.1) for _ in range(4000)])
    assert read.mean() == pytest.approx(0.5 + gyro.bias, abs=0.002)
    assert read.std() == pytest.approx(0.01 / 0.1**0.5, rel=0.05)


def test_gyro_bias_is_a_random_walk():
    settings = GyroSettings(noise_density=0.0, bias=0.0, bias_walk=0.02)
    ends = []
    for seed in range(400):
        gyro = Gyro(settings, np.random.default_rng(seed))
        gyro.reset()
        for _ in range(25):
            gyro.read(0.0, 1.0)
        ends.append(gyro.bias)
    assert np.std(ends) == pytest.approx(0.02 * 25**0.5, rel=0.12)


def test_white_noise_of_fixes():
    settings = PoseFixSettings(rate=100.0, position_sigma=0.03, yaw_sigma=0.02)
    error = errors(settings, 60.0)
    assert len(error) == 6001
    assert error.std(axis=0) == pytest.approx([0.03, 0.03, 0.02], rel=0.05)
    assert np.abs(error.mean(axis=0)).max() < 0.002


@pytest.mark.parametrize(
    ("damping", "count"),
    [
        (0.9, 60),
        (0.1, 60),
        *(pytest.param(d, 200, marks=pytest.mark.long) for d in (0.9, 0.3, 0.1)),
    ],
)
def test_fix_bias_starts_at_zero_and_becomes_stationary(damping, count):
    settings = PoseFixSettings(
        rate=2.0, position_sigma=0.0, yaw_sigma=0.0, position_bias=0.1, yaw_bias=0.05,
        bias_time=3.0, bias_damping=damping,
    )  # fmt: skip
    runs = np.array([errors(settings, 60.0, seed) for seed in range(count)])
    assert not runs[:, 0].any()
    assert (np.abs(runs[:, 1]) < 0.1).all()  # after 0.5 s: a few standard deviations of its rate
    late = runs[:, 20:].std(axis=(0, 1))
    assert late == pytest.approx([0.1, 0.1, 0.05], rel=0.15)


def test_law_paper_equals_the_paper_noise():
    settings = SensorSettings(fixes=PoseFixSettings(law="paper"))
    sensors = SensorSuite(settings, ROBOT.chassis, np.random.default_rng(3))
    paper = PaperNoise(np.random.default_rng(3))
    sensors.reset(START)
    for k in range(300):
        (fix,) = sensors.read(k * 0.1, standing()).fixes
        (noisy,) = paper.read(k * 0.1, standing()).fixes
        assert np.array(fix.pose) == pytest.approx(noisy.pose, abs=1e-12)


def test_law_paper_states_its_standard_deviation():
    settings = PoseFixSettings(law="paper", rate=200.0)
    found = [fix for fix in fixes(settings).read(7.9, START) if fix.stamp > 7.7]
    error = np.array([np.subtract(fix.pose, START) for fix in found])
    assert error.std(axis=0) == pytest.approx([found[0].position_sigma] * 3, rel=0.3)
    assert error.mean() == pytest.approx(1 / 12, rel=0.1)
    assert settings.bias_sigma[0] == pytest.approx(np.max(np.sin(np.arange(0, 100)) / 12), rel=0.01)


def test_late_fixes_have_the_stamp_of_their_measurement():
    settings = PoseFixSettings(rate=10.0, latency=0.25)
    sensor = fixes(settings)
    arrived = {k: [f.stamp for f in sensor.read(0.1 * k, START)] for k in range(6)}
    assert arrived[2] == []
    assert arrived[3] == [0.0]
    assert arrived[4] == pytest.approx([0.1])


def test_jitter_changes_the_order_of_arrival():
    sensor = fixes(PoseFixSettings(rate=20.0, jitter=0.5))
    stamps = [fix.stamp for k in range(60) for fix in sensor.read(0.1 * k, START)]
    assert any(a > b for a, b in pairwise(stamps))
    assert len(set(stamps)) == len(stamps) > 100


def test_rates_of_dropouts_and_outliers():
    settings = PoseFixSettings(
        rate=100.0, position_sigma=1e-3, dropout=0.2, outliers=0.1, outlier_size=2.0
    )
    error = errors(settings, 100.0)
    far = np.hypot(error[:, 0], error[:, 1]) > 1.0
    assert len(error) == pytest.approx(0.8 * 10_001, rel=0.02)
    assert far.mean() == pytest.approx(0.1, rel=0.1)
    assert np.hypot(*error[far, :2].T) == pytest.approx(2.0, abs=0.01)


def test_fixes_between_samples_interpolate_the_pose():
    settings = PoseFixSettings(rate=40.0, position_sigma=0.0, yaw_sigma=0.0)
    sensor, twist = fixes(settings), BodyTwist(1.0, 0.5, 2.0)
    sensor.read(0.0, START)
    found = sensor.read(0.1, move(START, twist, 0.1))
    assert [fix.stamp for fix in found] == pytest.approx([0.025, 0.05, 0.075, 0.1])
    for fix in found:
        assert np.array(fix.pose) == pytest.approx(move(START, twist, fix.stamp), abs=1e-12)


def test_silence_does_not_drop_fixes_in_transit():
    sensor = fixes(PoseFixSettings(rate=10.0, latency=0.1))
    sensor.read(0.0, START)
    assert [fix.stamp for fix in sensor.read(0.1, START, silent=True)] == [0.0]
    assert sensor.read(0.2, START, silent=True) == ()
    assert sensor.read(0.3, START) == ()
    assert [f.stamp for f in sensor.read(0.4, START)] == pytest.approx([0.3])


def test_faults_act_until_the_next_reset():
    sensors = SensorSuite(SensorSettings(), ROBOT.chassis, np.random.default_rng(0))
    sensors.reset(START)
    sensors.read(0.0, standing())
    sensors.apply(SensorFaults(dead_encoders=(1,), fixes_silent=True, gyro_silent=True))
    read = sensors.read(0.1, standing())
    assert [isnan(angle) for angle in read.wheel_angles] == [False, True, False, False]
    assert read.yaw_rate is None
    assert read.fixes == ()
    sensors.reset(START)
    sensors.read(0.0, standing())
    read = sensors.read(0.1, standing())
    assert not any(map(isnan, read.wheel_angles))
    assert read.yaw_rate is not None
    assert len(read.fixes) == 1


def test_sensors_and_estimators_satisfy_their_protocols():
    rng = np.random.default_rng(0)
    for sensors in (SensorSuite(SensorSettings(), ROBOT.chassis, rng), PaperNoise(rng)):
        assert isinstance(sensors, Sensors)
    for estimator in (LatestFix(), PoseEstimator(ROBOT)):
        assert isinstance(estimator, StateEstimator)


def test_perfect_sensors_quantize_wheel_angles_and_report_torques():
    state = PlantState(START, REST, 0.0, (0.1, -7.3, 40.0, 1e-3), (1.0, 2.0, 3.0, 4.0))
    sensors = PerfectSensors(EncoderSettings(counts_per_turn=100))
    read = sensors.read(0.0, state)
    assert read.wheel_torques == state.wheel_torques
    assert np.abs(np.subtract(read.wheel_angles, state.wheel_angles)).max() <= pi / 100
    counts = np.array(read.wheel_angles) * 100 / (2 * pi)
    assert counts == pytest.approx(np.round(counts), abs=1e-9)
    sensors.apply(SensorFaults(dead_encoders=(2,), fixes_silent=True))
    read = sensors.read(0.1, state)
    assert [isnan(angle) for angle in read.wheel_angles] == [False, False, True, False]
    assert read.fixes == ()


def test_standard_deviations_of_a_state_follow_from_its_covariance():
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    state = State(0.0, START, None, turn @ np.diag([0.04, 0.01, 0.09]) @ turn.T)
    assert state.position_sigma == pytest.approx(0.2)
    assert state.yaw_sigma == pytest.approx(0.3)
    assert isnan(State(0.0, START).position_sigma)
    assert isnan(State(0.0, START).yaw_sigma)


def test_faults_of_unknown_wheels_are_rejected():
    sensors = SensorSuite(SensorSettings(), ROBOT.chassis, np.random.default_rng(0))
    with pytest.raises(InvalidInput, match=r"there is no wheel 4; .* wheels 0 to 3"):
        sensors.apply(SensorFaults(dead_encoders=(4,)))


def read_all(settings, seed):
    sensors = SensorSuite(settings, ROBOT.chassis, np.random.default_rng(seed))
    sensors.reset(START)
    return [sensors.read(0.1 * k, standing(move(START, BodyTwist(1, 0, 1), 0.1 * k)))
            for k in range(50)]  # fmt: skip


def test_readings_are_reproducible():
    settings = SensorSettings(fixes=PoseFixSettings(jitter=0.3, dropout=0.3, outliers=0.1))
    assert repr(read_all(settings, 5)) == repr(read_all(settings, 5))
    assert repr(read_all(settings, 5)) != repr(read_all(settings, 6))


def test_random_numbers_of_a_sensor_are_independent_of_other_settings():
    default = SensorSettings()
    other = replace(default, gyro=None, encoders=EncoderSettings(16))
    assert [r.fixes for r in read_all(default, 5)] == [r.fixes for r in read_all(other, 5)]
    lossy = replace(default, fixes=PoseFixSettings(dropout=0.5))
    assert [r.yaw_rate for r in read_all(default, 5)] == [r.yaw_rate for r in read_all(lossy, 5)]


def test_latest_fix_ignores_older_fixes_that_arrive_later():
    settings = SensorSettings(fixes=PoseFixSettings(rate=20.0, jitter=0.4, position_sigma=0.0,
                                                    yaw_sigma=0.0))  # fmt: skip
    suite = SensorSuite(settings, ROBOT.chassis, np.random.default_rng(2))
    perception = Perception(suite, LatestFix())
    perception.reset(START)
    stamps = []
    for k in range(100):
        pose = move(START, BodyTwist(0.5, 0.0, 1.0), 0.1 * k)
        state = perception.update(0.1 * k, standing(pose))
        stamps.append(0.1 * k - state.fix_age)
        true_pose = move(START, BodyTwist(0.5, 0.0, 1.0), stamps[-1])
        assert np.array(state.pose) == pytest.approx(true_pose, abs=1e-9)  # the yaw is not wrapped
    assert stamps == sorted(stamps)
    assert max(b - a for a, b in pairwise(stamps)) < 0.5


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (PoseFixSettings, {"dropout": 1.5}),
        (PoseFixSettings, {"position_sigma": -0.1}),
        (PoseFixSettings, {"rate": 0.0}),
        (PoseFixSettings, {"latency": inf}),
        (PoseFixSettings, {"law": "pink"}),
        (GyroSettings, {"bias": -1.0}),
        (EncoderSettings, {"counts_per_turn": 0}),
    ],
)
def test_settings_out_of_bounds_are_rejected(kind, wrong):
    with pytest.raises(ValidationError):
        TypeAdapter(kind).validate_python(wrong)
