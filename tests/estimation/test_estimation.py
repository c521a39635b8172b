"""The estimator: consistency against matched noise, and what sensors and people do to it."""

from dataclasses import replace
from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.stats import chi2

from omnidrive.estimation import (
    EncoderSettings,
    EstimatorSettings,
    GyroSettings,
    PoseEstimator,
    PoseFix,
    PoseFixSettings,
    SensorReadings,
    SensorSettings,
)
from omnidrive.estimation.filter_state import POSE
from omnidrive.estimation.motion_model import Odometry
from omnidrive.estimation.se2 import (
    exponential,
    inverse_adjoint,
    logarithm,
    relative_pose,
    right_jacobian,
)
from omnidrive.estimation.slip_prediction import predict_slip
from omnidrive.geometry import BodyTwist, Pose, move, twist_between, wrap
from omnidrive.robot import named_robot, omni_ring
from omnidrive.simulation import (
    MujocoPlant,
    PlantState,
    SensorFaults,
    SensorSuite,
)
from tests.estimates import Perception
from tests.laws.motions import turned

ROBOT = named_robot("paper")
RADIUS = ROBOT.wheel.radius
REST = BodyTwist(0.0, 0.0, 0.0)
START = Pose(1.0, -2.0, 0.5)
DT = 0.1
FINE = EncoderSettings(2**24)
QUIET = SensorSettings(
    FINE,
    GyroSettings(noise_density=1e-6, bias=0.0, bias_walk=0.0),
    PoseFixSettings(position_sigma=1e-4, yaw_sigma=1e-4),
)
MATCHED = SensorSettings(
    FINE,
    GyroSettings(noise_density=3e-3, bias=0.01, bias_walk=1e-3),
    PoseFixSettings(
        position_sigma=0.02, yaw_sigma=0.01, position_bias=0.05, yaw_bias=0.03, bias_damping=0.5
    ),
)
"""Sensors so bad that their noise is what counts."""
CREEP = 5e-3
NOTHING_BUT_NOISE = EstimatorSettings(creep=CREEP, slip_doubt=0.0, false_alarms=1e-8, floor=1e-6)


def swaying(t):
    """A twist that turns and goes to and fro."""
    return BodyTwist(0.5 * np.cos(0.4 * t), 0.3 * np.sin(0.7 * t), 0.4 * np.sin(0.3 * t))


class Drive:
    """A robot whose rims creep, its sensors and its estimator."""

    def __init__(self, sensors=QUIET, chosen=None, seed=0, creep=0.0, robot=ROBOT, start=START):
        rng = np.random.default_rng(seed)
        self.robot, self.creep, self.rng = robot, creep, rng.spawn(1)[0]
        self.sensors = SensorSuite(sensors, robot.chassis, rng)
        self.estimator = PoseEstimator(robot, sensors, chosen, slips=False)
        self.sensor = Perception(self.sensors, self.estimator)
        self.sensor.reset(start)
        self.pose, self.angles, self.k = start, np.zeros(len(robot.mounts)), 0
        self.fix_bias = np.zeros((2, 3))
        self.seen = self.sense()

    @property
    def t(self):
        return self.k * DT

    def sense(self):
        if self.sensors._fixes:
            self.fix_bias = self.sensors._fixes._bias.copy()  # of the fix that is taken now
        state = PlantState(self.pose, REST, 0.0, tuple(self.angles.tolist()))
        return self.sensor.update(self.t, state)

    def go(self, seconds, twist=swaying):
        for _ in range(round(seconds / DT)):
            now = twist(self.t)
            displacements = self.robot.rim_jacobian @ np.array(now) * DT
            displacements += (
                self.creep
                * np.sqrt(np.abs(displacements))
                * self.rng.standard_normal(len(displacements))
            )
            self.pose = move(self.pose, now, DT)
            self.angles = self.angles + displacements / self.robot.wheel.radius
            self.k += 1
            self.seen = self.sense()
        return self

    @property
    def error(self):
        return np.hypot(self.seen.pose.x - self.pose.x, self.seen.pose.y - self.pose.y)

    @property
    def state_error(self):
        """True state less believed, as the covariance means it."""
        filter_state = self.estimator.filter_state
        off = twist_between(Pose(*filter_state.mean[POSE].tolist()), self.pose, 1.0)
        truth = np.array([self.sensors._gyro.bias, *self.fix_bias.ravel()])
        return np.array([*off, *(truth - filter_state.mean[3:])])


def bounds(dimensions, runs):
    """Of the mean of that many squares, which one test in 10,000 leaves."""
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], dimensions * runs) / runs
    return low, high


@pytest.fixture(scope="module")
def squares():
    """Squared errors in standard deviations of runs with matched noise, at three times."""
    pose, whole = [], []
    for seed in range(80):
        drive, p, w = Drive(MATCHED, NOTHING_BUT_NOISE, seed, CREEP), [], []
        for seconds in (2.0, 3.0, 5.0):
            drive.go(seconds)
            covariance, error = drive.estimator.filter_state.covariance, drive.state_error
            p.append(error[:3] @ np.linalg.solve(covariance[:3, :3], error[:3]))
            w.append(error @ np.linalg.solve(covariance, error))
        pose.append(p)
        whole.append(w)
    return np.array(pose), np.array(whole)


def test_the_pose_is_as_uncertain_as_it_says(squares):
    low, high = bounds(3, 80)
    assert ((low < squares[0].mean(axis=0)) & (squares[0].mean(axis=0) < high)).all()


def test_so_are_the_biases(squares):
    low, high = bounds(10, 80)
    assert ((low < squares[1].mean(axis=0)) & (squares[1].mean(axis=0) < high)).all()


def test_late_and_lost_fixes_change_nothing_about_that():
    late = replace(MATCHED.fixes, latency=0.25, jitter=0.3, dropout=0.3, rate=7.0)
    found = []
    for seed in range(60):
        drive = Drive(replace(MATCHED, fixes=late), NOTHING_BUT_NOISE, seed, CREEP).go(6.0)
        error, covariance = drive.state_error[:3], drive.estimator.filter_state.covariance[:3, :3]
        found.append(error @ np.linalg.solve(covariance, error))
    low, high = bounds(3, 60)
    assert low < np.mean(found) < high


def test_innovations_are_as_large_as_they_should_be():
    found = []
    for seed in range(20):
        drive = Drive(MATCHED, NOTHING_BUT_NOISE, seed, CREEP)
        for _ in range(50):
            drive.go(DT)
            found.append(drive.estimator.nis)
    low, high = bounds(3, len(found))
    assert low < np.mean(found) < high


def test_the_biases_become_known():
    """At first the rates are as uncertain as data sheets say; later, far less."""
    drive = Drive(MATCHED, NOTHING_BUT_NOISE, creep=1e-4)
    first = drive.estimator.filter_state.covariance
    drive.go(10.0)
    later = drive.estimator.filter_state.covariance
    assert later[3, 3] < 0.25 * first[3, 3]  # the gyro's, against the wheels' turn
    assert later[4, 4] < (0.5 * 0.05) ** 2  # the fixes', against odometry
    assert drive.error < 0.05


def test_with_sensors_that_hardly_err_it_hardly_errs():
    drive = Drive().go(10.0)
    assert drive.error < 2e-4
    assert drive.seen.yaw_sigma < 2e-4
    assert drive.seen.fix_age == pytest.approx(0.0, abs=1e-9)


def test_it_is_reproducible_to_the_last_bit():
    one, two = (Drive(MATCHED, None, 7, CREEP).go(5.0) for _ in range(2))
    assert repr(one.seen) == repr(two.seen)
    one.sensor.reset(START)
    fresh = PoseEstimator(ROBOT, MATCHED, slips=False)
    fresh.reset(START)
    assert repr(one.estimator.filter_state) == repr(fresh.filter_state)


def recorded(seconds, **changes):
    """Readings of a drive, and its fixes."""
    sensors = replace(MATCHED, fixes=replace(MATCHED.fixes, **changes))
    drive, log = Drive(sensors, creep=CREEP), []
    read = drive.sensors.read

    def reading(t, state):
        log.append(read(t, state))
        return log[-1]

    object.__setattr__(drive.sensor, "sensors", _Stand(reading))
    drive.go(seconds)
    return sensors, log


class _Stand:
    def __init__(self, read):
        self.read = read


def test_fixes_out_of_order_lead_where_fixes_in_order_lead():
    sensors, log = recorded(4.0, rate=23.0, latency=0.1, jitter=0.8)
    fixes = sorted(fix for readings in log for fix in readings.fixes)
    assert fixes != [fix for readings in log for fix in readings.fixes]
    ends = []
    for in_order in (False, True):
        estimator = PoseEstimator(ROBOT, sensors, slips=False)
        estimator.reset(START)
        before = -inf
        for readings in log:
            now = tuple(fix for fix in fixes if before < fix.stamp <= readings.stamp)
            estimator.update(readings._replace(fixes=now) if in_order else readings)
            before = readings.stamp
            if in_order:
                continue
        last = log[-1]
        missing = tuple(set(fixes) - {f for r in log for f in r.fixes})
        assert not missing
        ends.append(estimator.update(last._replace(stamp=last.stamp + DT, fixes=())))
    late = [fix for fix in fixes if fix.stamp > log[-1].stamp - 0.9]
    assert late
    assert repr(ends[0]) == repr(ends[1])


def test_a_fix_far_off_is_not_believed():
    drive = Drive(MATCHED, None, creep=CREEP).go(3.0)
    before = drive.estimator.rejected
    fix = PoseFix(drive.t, drive.pose._replace(x=drive.pose.x + 1.0), 0.02, 0.01)
    angles = tuple(drive.angles.tolist())
    seen = drive.estimator.update(
        SensorReadings(drive.t + 1e-3, angles, yaw_rate=0.0, fixes=(fix,))
    )
    assert drive.estimator.rejected == before + 1
    assert np.hypot(seen.pose.x - drive.pose.x, seen.pose.y - drive.pose.y) < 0.1


@pytest.mark.parametrize("seed", range(5))
def test_outliers_do_not_carry_it_away(seed):
    fixes = PoseFixSettings(outliers=0.3, outlier_size=1.0)
    drive = Drive(replace(MATCHED, fixes=fixes), None, seed, CREEP).go(20.0)
    assert drive.estimator.relocations == []
    assert drive.error < 0.05


@pytest.mark.parametrize("jump", [(0.5, 0.0, 0.0), (-3.0, 4.0, 2.5), (0.0, 0.0, pi)])
@pytest.mark.parametrize("latency", [0.0, 0.3])
def test_a_robot_that_was_carried_away_is_found_again(jump, latency):
    sensors = replace(MATCHED, fixes=replace(MATCHED.fixes, latency=latency))
    drive = Drive(sensors, None, creep=CREEP).go(3.0)
    drive.pose = Pose(*(a + b for a, b in zip(drive.pose, jump, strict=True)))
    moved = drive.pose
    drive.sensors._before = drive.t, moved.yaw  # nobody's gyro turned: it was switched off
    drive.go(2.0)
    (found,) = drive.estimator.relocations
    assert 0.3 < found - 3.0 - latency <= 1.0
    assert drive.error < 0.15
    assert abs(wrap(drive.seen.pose.yaw - drive.pose.yaw)) < 0.15
    assert drive.seen.position_sigma < 0.2


def test_while_fixes_are_silent_it_knows_less_and_less():
    drive = Drive(MATCHED, None, creep=CREEP).go(3.0)
    drive.sensor.apply(SensorFaults(fixes_silent=True))
    sigmas, ages = [], []
    for _ in range(10):
        drive.go(0.5)
        sigmas.append(drive.seen.position_sigma)
        ages.append(drive.seen.fix_age)
    assert max(sigmas) == sigmas[-1]
    assert ages == pytest.approx([0.5 * (k + 1) for k in range(10)])
    drive.sensor.apply(SensorFaults())
    drive.go(1.0)
    assert drive.seen.fix_age == pytest.approx(0.0, abs=1e-9)


def test_without_gyro_the_wheels_tell_the_turn():
    drive = Drive().go(2.0)
    drive.sensor.apply(SensorFaults(gyro_silent=True, fixes_silent=True))
    drive.go(5.0)
    assert drive.error < 1e-3
    assert abs(drive.seen.pose.yaw - drive.pose.yaw) < 1e-3


@pytest.mark.parametrize("dead", [(0,), (3,), (0, 1)])
def test_dead_encoders_are_left_out(dead):
    drive = Drive().go(2.0)
    drive.sensor.apply(SensorFaults(dead_encoders=dead, fixes_silent=True))
    drive.go(5.0)
    assert drive.error < 2e-3
    drive.sensor.apply(SensorFaults(fixes_silent=True))  # encoders that live again
    assert drive.go(2.0).error < 2e-3


def test_three_wheels_of_which_one_is_dead_and_a_gyro_suffice():
    kiwi = replace(ROBOT, mounts=omni_ring((0.5, 2.6, 4.7), 0.5))
    drive = Drive(robot=kiwi).go(2.0)
    drive.sensor.apply(SensorFaults(dead_encoders=(1,), fixes_silent=True))
    assert drive.go(5.0).error < 2e-3


def test_without_odometry_it_soon_knows_nothing():
    drive = Drive().go(2.0)
    drive.sensor.apply(SensorFaults((0, 1, 2, 3), fixes_silent=True, gyro_silent=True))
    half = drive.go(0.5).seen.position_sigma
    whole = drive.go(0.5).seen.position_sigma
    assert 0.3 < half < 0.3 * whole * 1.2  # as the square of the time
    assert drive.error < 3.0 * whole
    drive.sensor.apply(SensorFaults((0, 1, 2, 3)))
    assert drive.go(1.0).error < 0.05  # by fixes alone


def test_wheels_that_disagree_are_suspected_of_slip():
    """One wheel spins on ice, for 1 s at 1 m/s."""
    drive = Drive(replace(QUIET, fixes=None)).go(2.0)
    sure = drive.seen.position_sigma
    for _ in range(10):
        drive.angles = drive.angles + np.array([DT / RADIUS, 0.0, 0.0, 0.0])
        drive.go(DT)
    assert drive.estimator.filter_state.excess_slip > 0.3
    assert drive.seen.position_sigma > 10.0 * sure
    assert drive.error < 4.0 * drive.seen.position_sigma


def test_turning_the_world_turns_the_estimate():
    angle, (sensors, log) = 2.0, recorded(3.0)
    ends = []
    for turn in (0.0, angle):
        estimator = PoseEstimator(ROBOT, sensors, slips=False)
        estimator.reset(turned(START, turn))
        for readings in log:
            fixes = tuple(fix._replace(pose=turned(fix.pose, turn)) for fix in readings.fixes)
            seen = estimator.update(readings._replace(fixes=fixes))
        ends.append(seen)
    assert np.array(ends[1].pose) == pytest.approx(turned(ends[0].pose, angle), abs=1e-8)
    assert ends[1].position_sigma == pytest.approx(ends[0].position_sigma, rel=1e-6)


def test_a_position_without_a_yaw_is_a_fix_too():
    """Of a robot that stands, and nothing else tells it so."""
    estimator = PoseEstimator(ROBOT, QUIET)
    estimator.reset(START)
    for k in range(11):
        fix = PoseFix(DT * k, START._replace(yaw=99.0), 0.01, inf)
        seen = estimator.update(SensorReadings(DT * k, (nan,) * 4, fixes=(fix,)))
    assert np.hypot(seen.pose.x - START.x, seen.pose.y - START.y) < 0.02
    assert seen.position_sigma < 0.05
    assert seen.yaw_sigma > 0.3
    assert estimator.rejected == 0


NUMBERS = st.floats(-1e3, 1e3) | st.just(nan)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(
        st.tuples(st.lists(NUMBERS, min_size=4, max_size=4), NUMBERS | st.none(), NUMBERS),
        min_size=1,
        max_size=8,
    ),
    slips=st.booleans(),
)
def test_whatever_is_read_the_covariance_is_one(rows, slips):
    estimator = PoseEstimator(ROBOT, MATCHED, slips=slips)
    estimator.reset(START)
    for k, (angles, rate, number) in enumerate(rows):
        fix = PoseFix(DT * k, Pose(number, 0.0, number), 0.02, 0.01)
        seen = estimator.update(SensorReadings(DT * k, tuple(angles), yaw_rate=rate, fixes=(fix,)))
        covariance = estimator.filter_state.covariance
        assert np.isfinite(covariance).all()
        assert (covariance == covariance.T).all()
        least = np.linalg.eigvalsh(covariance)[0]
        assert least >= -1e-6 * np.abs(covariance).max()
        assert np.isfinite(seen.pose).all()


@pytest.mark.parametrize("stamp", [nan, 1.0, -5.0])
def test_fixes_of_the_future_and_of_long_ago_are_not_used(stamp):
    estimator = PoseEstimator(ROBOT, MATCHED, slips=False)
    estimator.reset(START)
    fix = PoseFix(stamp, Pose(START.x + 0.01, START.y, START.yaw), 0.02, 0.01)
    seen = estimator.update(SensorReadings(0.0, (0.0,) * 4, fixes=(fix,)))
    assert seen.pose == START
    assert estimator.rejected == 1


MOTIONS = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3)).map(np.array)


def matrix(motion):
    """SE(2) exponential by the general one of matrices."""
    x, y, turn = motion
    return expm(np.array([[0.0, -turn, x], [turn, 0.0, y], [0.0, 0.0, 0.0]]))


@settings(max_examples=60, deadline=None)
@given(MOTIONS, MOTIONS)
def test_motions_are_those_of_the_group(a, b):
    group = matrix(a)
    pose = exponential(a)
    assert [*group[:2, 2], group[1, 0]] == pytest.approx([*pose[:2], np.sin(pose[2])], abs=1e-9)
    assert logarithm(pose) == pytest.approx(a, abs=1e-9)
    small = 1e-6 * b
    moved = relative_pose(exponential(a), np.zeros(3))  # inverse
    back = np.linalg.inv(group)
    assert [*back[:2, 2]] == pytest.approx(moved[:2].tolist(), abs=1e-9)
    end = np.linalg.inv(group) @ matrix(small) @ group  # Ad of the inverse
    expected = np.array([end[0, 2], end[1, 2], end[1, 0]])
    assert inverse_adjoint(a) @ small == pytest.approx(expected, abs=1e-10)


@settings(max_examples=40, deadline=None)
@given(MOTIONS.map(lambda m: 0.2 * m), MOTIONS)
def test_the_right_jacobian_is_the_derivative_of_the_exponential(a, b):
    step = 1e-6 * b
    change = np.linalg.inv(matrix(a)) @ matrix(a + step)
    expected = np.array([change[0, 2], change[1, 2], change[1, 0]])
    size = np.abs(a).max()
    assert right_jacobian(a) @ step == pytest.approx(expected, abs=1e-11 + 1e-6 * size**3)


def test_slip_is_that_of_the_differential_equation():
    """Against an adaptive integrator, from rest into wheels that turn at once."""
    estimator = PoseEstimator(ROBOT)
    model = estimator._model
    speeds = np.array([0.7, 0.2, 0.6, 1.1])
    odometry = Odometry(speeds * DT, nan, DT, 1.0)
    lost, mean, last = predict_slip(np.zeros(3), odometry, model)

    def law(_, state):
        body = state[:3]
        gaps = speeds - model.rim_jacobian @ body
        push = np.zeros(4)
        for _ in range(30):  # loads shift by what the wheels push
            most = np.clip(
                model.friction_limits + model.load_transfer @ (model.rim_jacobian.T @ push)[:2],
                0,
                model.motor_limit,
            )
            push = np.clip(model.stiffness * gaps, -most, most)
        x, y, turn = body
        ax, ay, turning = model.rim_jacobian.T @ push / model.inertia
        return [ax + turn * y, ay - turn * x, turning, *body, *gaps]

    exact = solve_ivp(law, (0.0, DT), np.zeros(10), rtol=1e-8, atol=1e-10).y[:, -1]
    assert lost == pytest.approx(exact[6:], abs=1e-3)
    assert mean == pytest.approx(exact[3:6] / DT, abs=0.01)
    assert last == pytest.approx(exact[:3], abs=0.01)
    assert np.abs(lost).max() > 0.01


def test_odometry_is_as_uncertain_as_it_says_at_hard_starts():
    """Rollers stand anywhere; the robot is asked for a speed at once, and later for half of it."""
    sensors, squares = SensorSettings(fixes=None), []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        sensor = Perception(SensorSuite(sensors, ROBOT.chassis, rng), PoseEstimator(ROBOT, sensors))
        plant = MujocoPlant(ROBOT, "rollers", rng)
        most, heading, turn = rng.uniform([0.3, -pi, -2.0], [1.0, pi, 2.0])
        state = plant.reset(START)
        sensor.reset(START)
        sensor.update(0.0, state)
        for k in range(1, 8):
            speed = most if k < 5 else 0.5 * most
            twist = BodyTwist(speed * np.cos(heading), speed * np.sin(heading), speed * turn)
            state = plant.step(twist, DT)
            seen = sensor.update(DT * k, state)
        error = np.array(twist_between(seen.pose, state.pose, 1.0))
        covariance = sensor.estimator.filter_state.covariance[POSE, POSE]
        squares.append(error @ np.linalg.solve(covariance, error))
    assert 1.0 < np.mean(squares) < 4.5  # 3, if the law of slip were exact and its doubt known


@pytest.mark.parametrize("wheels", ["rollers", "ball"])
def test_odometry_that_knows_of_grip_is_better_at_a_hard_start(wheels):
    """From rest into 0.9 m/s with a turn, at once: the wheels slip for half a second."""
    sensors = SensorSettings(fixes=None)
    off = {}
    for slips in (True, False):
        plant = MujocoPlant(ROBOT, wheels)
        chosen = EstimatorSettings() if slips else EstimatorSettings(slip_doubt=0.0)
        estimator = PoseEstimator(ROBOT, sensors, chosen, slips=slips)
        sensor = Perception(
            SensorSuite(sensors, ROBOT.chassis, np.random.default_rng(0)), estimator
        )
        state = plant.reset(START)
        sensor.reset(START)
        sensor.update(0.0, state)
        for k in range(1, 11):
            state = plant.step(BodyTwist(0.8, 0.4, 1.0), DT)
            seen = sensor.update(DT * k, state)
        off[slips] = np.hypot(seen.pose.x - state.pose.x, seen.pose.y - state.pose.y)
        if slips:
            assert off[slips] < 3.0 * seen.position_sigma
    assert off[True] < 0.4 * off[False]
