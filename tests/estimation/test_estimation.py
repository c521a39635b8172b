"""The pose estimator: consistency with matched noise, sensor faults, delays and relocation."""

from dataclasses import replace
from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from omnidrive.estimation import (
    EstimatorSettings,
    PoseEstimator,
    PoseFix,
    PoseFixSettings,
    SensorReadings,
    SensorSettings,
)
from omnidrive.estimation.pose_filter.filter_state import CORNERING, GYRO_BIAS, POSE
from omnidrive.geometry import BodyTwist, Pose, twist_between, wrap
from omnidrive.robot import omni_ring
from omnidrive.simulation import MujocoPlant, SensorFaults, SensorSuite
from omnidrive.testing.laws import rotated
from tests.estimates import Perception
from tests.estimation.drive import (
    CREEP,
    DT,
    MATCHED,
    NOISE_ONLY,
    QUIET,
    REST,
    ROBOT,
    START,
    Drive,
)
from tests.examples import examples


def bounds(dimensions, runs):
    """Bounds of the mean squared normalised error; 1 in 10,000 correct results is outside."""
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], dimensions * runs) / runs
    return low, high


@pytest.fixture(scope="module", params=[16, pytest.param(80, marks=pytest.mark.long)])
def normalised_errors(request):
    """Normalised squared errors of the pose and of the whole state, at three times of some runs."""
    pose, whole = [], []
    for seed in range(request.param):
        drive, p, w = Drive(MATCHED, NOISE_ONLY, seed, CREEP), [], []
        for seconds in (2.0, 3.0, 5.0):
            drive.go(seconds)
            covariance, error = drive.estimator.filter_state.covariance, drive.filter_error
            p.append(error[:3] @ np.linalg.solve(covariance[:3, :3], error[:3]))
            known = covariance[:CORNERING, :CORNERING]
            w.append(error @ np.linalg.solve(known, error))
        pose.append(p)
        whole.append(w)
    return np.array(pose), np.array(whole)


def test_pose_error_matches_its_covariance(normalised_errors):
    low, high = bounds(3, len(normalised_errors[0]))
    mean = normalised_errors[0].mean(axis=0)
    assert ((low < mean) & (mean < high)).all()


def test_error_of_the_whole_state_matches_its_covariance(normalised_errors):
    low, high = bounds(10, len(normalised_errors[1]))
    mean = normalised_errors[1].mean(axis=0)
    assert ((low < mean) & (mean < high)).all()


@pytest.mark.parametrize("runs", [12, pytest.param(60, marks=pytest.mark.long)])
def test_pose_error_matches_its_covariance_with_late_and_lost_fixes(runs):
    late = replace(MATCHED.fixes, latency=0.25, jitter=0.3, dropout=0.3, rate=7.0)
    found = []
    for seed in range(runs):
        drive = Drive(replace(MATCHED, fixes=late), NOISE_ONLY, seed, CREEP).go(6.0)
        error, covariance = drive.filter_error[:3], drive.estimator.filter_state.covariance[:3, :3]
        found.append(error @ np.linalg.solve(covariance, error))
    low, high = bounds(3, runs)
    assert low < np.mean(found) < high


def test_innovations_match_their_covariance():
    found = []
    for seed in range(5):
        drive = Drive(MATCHED, NOISE_ONLY, seed, CREEP)
        for _ in range(50):
            drive.go(DT)
            found.append(drive.estimator.nis)
    low, high = bounds(3, len(found))
    assert low < np.mean(found) < high


def test_biases_are_estimated():
    """The variances of the biases decrease well below those of the data sheets."""
    drive = Drive(MATCHED, NOISE_ONLY, creep=1e-4)
    first = drive.estimator.filter_state.covariance
    drive.go(10.0)
    later = drive.estimator.filter_state.covariance
    assert later[3, 3] < 0.25 * first[3, 3]  # gyro bias, by the rotation of the wheels
    assert later[4, 4] < (0.5 * 0.05) ** 2  # fix bias, by odometry
    assert drive.error < 0.05


def test_error_is_small_with_nearly_perfect_sensors():
    drive = Drive().go(10.0)
    assert drive.error < 2e-4
    assert drive.state.yaw_sigma < 2e-4
    assert drive.state.fix_age == pytest.approx(0.0, abs=1e-9)


def test_results_and_reset_are_reproducible_bit_for_bit():
    one, two = (Drive(MATCHED, None, 7, CREEP).go(5.0) for _ in range(2))
    assert repr(one.state) == repr(two.state)
    one.estimator.reset(START)
    fresh = PoseEstimator(ROBOT, MATCHED, slips=False)
    fresh.reset(START)
    assert repr(one.estimator.filter_state) == repr(fresh.filter_state)


def recorded(seconds, **changes):
    """Sensor settings and readings of one run."""
    sensors = replace(MATCHED, fixes=replace(MATCHED.fixes, **changes))
    return sensors, Drive(sensors, creep=CREEP).go(seconds).log


def test_result_does_not_depend_on_the_order_of_arrival():
    sensors, log = recorded(4.0, rate=23.0, latency=0.1, jitter=0.8)
    fixes = sorted(fix for readings in log for fix in readings.fixes)
    assert fixes != [fix for readings in log for fix in readings.fixes]
    finals = []
    for in_order in (False, True):
        estimator = PoseEstimator(ROBOT, sensors, slips=False)
        estimator.reset(START)
        before = -inf
        for readings in log:
            now = tuple(fix for fix in fixes if before < fix.stamp <= readings.stamp)
            estimator.update(readings._replace(fixes=now) if in_order else readings)
            before = readings.stamp
        last = log[-1]
        missing = tuple(set(fixes) - {f for r in log for f in r.fixes})
        assert not missing
        finals.append(estimator.update(last._replace(stamp=last.stamp + DT, fixes=())))
    late = [fix for fix in fixes if fix.stamp > log[-1].stamp - 0.9]
    assert late
    assert repr(finals[0]) == repr(finals[1])


def test_outlier_is_rejected():
    drive = Drive(MATCHED, None, creep=CREEP).go(3.0)
    before = drive.estimator.rejected
    fix = PoseFix(drive.t, drive.pose._replace(x=drive.pose.x + 1.0), 0.02, 0.01)
    angles = tuple(drive.angles.tolist())
    state = drive.estimator.update(
        SensorReadings(drive.t + 1e-3, angles, yaw_rate=0.0, fixes=(fix,))
    )
    assert drive.estimator.rejected == before + 1
    assert np.hypot(state.pose.x - drive.pose.x, state.pose.y - drive.pose.y) < 0.1


@pytest.mark.parametrize("seed", range(5))
def test_outliers_cause_no_relocation(seed):
    fixes = PoseFixSettings(outliers=0.3, outlier_size=1.0)
    drive = Drive(replace(MATCHED, fixes=fixes), None, seed, CREEP).go(20.0)
    assert drive.estimator.relocations == []
    assert drive.error < 0.05


@pytest.mark.parametrize("jump", [(0.5, 0.0, 0.0), (-3.0, 4.0, 2.5), (0.0, 0.0, pi)])
@pytest.mark.parametrize("latency", [0.0, 0.3])
def test_kidnapped_robot_is_relocated(jump, latency):
    sensors = replace(MATCHED, fixes=replace(MATCHED.fixes, latency=latency))
    drive = Drive(sensors, None, creep=CREEP).go(3.0)
    drive.pose = Pose(*(a + b for a, b in zip(drive.pose, jump, strict=True)))
    moved = drive.pose
    drive.sensors._previous = drive.t, moved.yaw  # the gyro does not measure the jump
    drive.go(2.0)
    (found,) = drive.estimator.relocations
    assert 0.3 < found - 3.0 - latency <= 1.0
    assert drive.error < 0.15
    assert abs(wrap(drive.state.pose.yaw - drive.pose.yaw)) < 0.15
    assert drive.state.position_sigma < 0.2


def test_uncertainty_grows_while_fixes_are_silent():
    drive = Drive(MATCHED, None, creep=CREEP).go(3.0)
    drive.sensors.apply(SensorFaults(fixes_silent=True))
    sigmas, ages = [], []
    for _ in range(10):
        drive.go(0.5)
        sigmas.append(drive.state.position_sigma)
        ages.append(drive.state.fix_age)
    assert max(sigmas) == sigmas[-1]
    assert ages == pytest.approx([0.5 * (k + 1) for k in range(10)])
    drive.sensors.apply(SensorFaults())
    drive.go(1.0)
    assert drive.state.fix_age == pytest.approx(0.0, abs=1e-9)


def test_without_gyro_the_yaw_is_estimated_from_the_wheels():
    drive = Drive().go(2.0)
    drive.sensors.apply(SensorFaults(gyro_silent=True, fixes_silent=True))
    drive.go(5.0)
    assert drive.error < 1e-3
    assert abs(drive.state.pose.yaw - drive.pose.yaw) < 1e-3


@pytest.mark.parametrize("dead", [(0,), (3,), (0, 1)])
def test_dead_encoders_are_ignored(dead):
    drive = Drive().go(2.0)
    drive.sensors.apply(SensorFaults(dead_encoders=dead, fixes_silent=True))
    drive.go(5.0)
    assert drive.error < 2e-3
    drive.sensors.apply(SensorFaults(fixes_silent=True))  # the encoders work again
    assert drive.go(2.0).error < 2e-3


def test_two_encoders_and_a_gyro_suffice():
    kiwi = replace(ROBOT, mounts=omni_ring((0.5, 2.6, 4.7), 0.5))
    drive = Drive(robot=kiwi).go(2.0)
    drive.sensors.apply(SensorFaults(dead_encoders=(1,), fixes_silent=True))
    assert drive.go(5.0).error < 2e-3


def test_without_odometry_the_uncertainty_grows_quadratically():
    drive = Drive().go(2.0)
    drive.sensors.apply(SensorFaults((0, 1, 2, 3), fixes_silent=True, gyro_silent=True))
    half = drive.go(0.5).state.position_sigma
    whole = drive.go(0.5).state.position_sigma
    assert 0.3 < half < 0.3 * whole * 1.2  # quadratic in time
    assert drive.error < 3.0 * whole
    drive.sensors.apply(SensorFaults((0, 1, 2, 3)))
    assert drive.go(1.0).error < 0.05  # from fixes only


def test_inconsistent_wheels_increase_the_excess_slip():
    """One wheel spins for 1 s at 1 m/s."""
    drive = Drive(replace(QUIET, fixes=None)).go(2.0)
    before = drive.state.position_sigma
    for _ in range(10):
        drive.angles = drive.angles + np.array([DT / ROBOT.wheel.radius, 0.0, 0.0, 0.0])
        drive.go(DT)
    assert drive.estimator.filter_state.excess_slip > 0.3
    assert drive.state.position_sigma > 10.0 * before
    assert drive.error < 4.0 * drive.state.position_sigma


def test_two_opposite_wheels_that_contradict_the_gyro_leave_its_bias():
    """They determine the rotation but not the motion: 1 rad/s against 0 by the gyro, for 0.5 s."""
    drive = Drive(SensorSettings(fixes=None)).go(2.0, lambda t: REST)
    drive.sensors.apply(SensorFaults((1, 3)))
    rims = ROBOT.rim_jacobian @ (0.0, 0.0, 1.0)
    for _ in range(5):
        drive.angles = drive.angles + rims * DT / ROBOT.wheel.radius
        drive.go(DT, lambda t: REST)
    state = drive.estimator.filter_state
    assert state.excess_slip > 0.1
    assert abs(state.mean[GYRO_BIAS]) < 1e-3
    assert abs(drive.state.pose.yaw - START.yaw) < 1e-2


def test_estimate_is_equivariant_to_rotation_of_the_world():
    angle, (sensors, log) = 2.0, recorded(3.0)
    finals = []
    for turn in (0.0, angle):
        estimator = PoseEstimator(ROBOT, sensors, slips=False)
        estimator.reset(rotated(START, turn))
        for readings in log:
            fixes = tuple(fix._replace(pose=rotated(fix.pose, turn)) for fix in readings.fixes)
            state = estimator.update(readings._replace(fixes=fixes))
        finals.append(state)
    assert np.array(finals[1].pose) == pytest.approx(rotated(finals[0].pose, angle), abs=1e-8)
    assert finals[1].position_sigma == pytest.approx(finals[0].position_sigma, rel=1e-6)


def test_fix_of_the_position_only():
    """A robot at rest without odometry; its fixes measure no yaw."""
    estimator = PoseEstimator(ROBOT, QUIET)
    estimator.reset(START)
    for k in range(11):
        fix = PoseFix(DT * k, START._replace(yaw=99.0), 0.01, inf)
        state = estimator.update(SensorReadings(DT * k, (nan,) * 4, fixes=(fix,)))
    assert np.hypot(state.pose.x - START.x, state.pose.y - START.y) < 0.02
    assert state.position_sigma < 0.05
    assert state.yaw_sigma > 0.3
    assert estimator.rejected == 0


NUMBERS = st.floats(-1e3, 1e3) | st.just(nan)


@examples(60)
@given(
    rows=st.lists(
        st.tuples(st.lists(NUMBERS, min_size=4, max_size=4), NUMBERS | st.none(), NUMBERS),
        min_size=1,
        max_size=8,
    ),
    slips=st.booleans(),
)
def test_covariance_is_valid_for_any_readings(rows, slips):
    estimator = PoseEstimator(ROBOT, MATCHED, slips=slips)
    estimator.reset(START)
    for k, (angles, rate, number) in enumerate(rows):
        fix = PoseFix(DT * k, Pose(number, 0.0, number), 0.02, 0.01)
        state = estimator.update(SensorReadings(DT * k, tuple(angles), yaw_rate=rate, fixes=(fix,)))
        covariance = estimator.filter_state.covariance
        assert np.isfinite(covariance).all()
        assert (covariance == covariance.T).all()
        smallest = np.linalg.eigvalsh(covariance)[0]
        assert smallest >= -1e-6 * np.abs(covariance).max()
        assert np.isfinite(state.pose).all()


@pytest.mark.parametrize("stamp", [nan, 1.0, -5.0])
def test_fixes_from_the_future_and_too_old_fixes_are_rejected(stamp):
    estimator = PoseEstimator(ROBOT, MATCHED, slips=False)
    estimator.reset(START)
    fix = PoseFix(stamp, Pose(START.x + 0.01, START.y, START.yaw), 0.02, 0.01)
    state = estimator.update(SensorReadings(0.0, (0.0,) * 4, fixes=(fix,)))
    assert state.pose == START
    assert estimator.rejected == 1


def test_odometry_error_matches_its_covariance_at_hard_starts():
    """Random roller angles; a commanded step to full speed, and later to half of it."""
    sensors, squares = SensorSettings(fixes=None), []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        perception = Perception(
            SensorSuite(sensors, ROBOT.chassis, rng), PoseEstimator(ROBOT, sensors)
        )
        plant = MujocoPlant(ROBOT, "rollers", rng)
        max_speed, heading, turn = rng.uniform([0.3, -pi, -2.0], [1.0, pi, 2.0])
        truth = plant.reset(START)
        perception.reset(START)
        perception.update(0.0, truth)
        for k in range(1, 8):
            speed = max_speed if k < 5 else 0.5 * max_speed
            twist = BodyTwist(speed * np.cos(heading), speed * np.sin(heading), speed * turn)
            truth = plant.step(twist, DT)
            state = perception.update(DT * k, truth)
        error = np.array(twist_between(state.pose, truth.pose, 1.0))
        covariance = perception.estimator.filter_state.covariance[POSE, POSE]
        squares.append(error @ np.linalg.solve(covariance, error))
    # 3 with exact models of slip and of its error; slip_error covers 20 % of error of the friction
    assert 0.5 < np.mean(squares) < 4.5


@pytest.mark.parametrize("wheels", ["rollers", "ball"])
def test_slip_prediction_improves_odometry_at_a_hard_start(wheels):
    """A commanded step to 0.9 m/s and 1 rad/s: the wheels slip for half a second."""
    sensors = SensorSettings(fixes=None)
    errors = {}
    for slips in (True, False):
        plant = MujocoPlant(ROBOT, wheels)
        filter_settings = EstimatorSettings() if slips else EstimatorSettings(slip_doubt=0.0)
        estimator = PoseEstimator(ROBOT, sensors, filter_settings, slips=slips)
        perception = Perception(
            SensorSuite(sensors, ROBOT.chassis, np.random.default_rng(0)), estimator
        )
        truth = plant.reset(START)
        perception.reset(START)
        perception.update(0.0, truth)
        for k in range(1, 11):
            truth = plant.step(BodyTwist(0.8, 0.4, 1.0), DT)
            state = perception.update(DT * k, truth)
        errors[slips] = np.hypot(state.pose.x - truth.pose.x, state.pose.y - truth.pose.y)
        if slips:
            assert errors[slips] < 3.0 * state.position_sigma
    assert errors[True] < 0.4 * errors[False]
