"""Impossible readings are ignored; a lost estimate starts anew at the next fix and says so."""

from math import inf, nan

import numpy as np
import pytest

from omnidrive.control import FeedforwardController
from omnidrive.errors import InvalidInput
from omnidrive.estimation import (
    EstimatorSettings,
    GyroSettings,
    LatestFix,
    PoseEstimator,
    PoseFix,
    PoseFixSettings,
    SensorReadings,
    SensorSettings,
    State,
)
from omnidrive.estimation.state import state_fault
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.simulation import KinematicPlant, PerfectSensors, SensorFaults, simulate
from tests.estimation.drive import CREEP, DT, MATCHED, QUIET, ROBOT, START, Drive, is_definite

ALL_SILENT = SensorFaults((0, 1, 2, 3), fixes_silent=True, gyro_silent=True)
TRUE = Pose(7.0, 7.0, 7.0)
"""Stands for the true pose in a fix of a :class:`Spoiled`."""


class Spoiled(Drive):
    """A drive of which some readings are replaced."""

    def __init__(self, *args, **kwargs):
        self.changes = {}
        super().__init__(*args, **kwargs)

    def update(self, readings):
        readings = readings._replace(**self.changes)
        fixes = [
            fix._replace(pose=self.pose) if fix.pose is TRUE else fix for fix in readings.fixes
        ]
        return self.estimator.update(readings._replace(fixes=tuple(fixes)))

    def spoil(self, seconds=DT, **changes):
        """Go on with these readings."""
        self.changes = changes
        self.go(seconds)
        self.changes = {}
        return self


def drive(sensors=QUIET, **options):
    return Spoiled(sensors, **options).go(2.0)


def silent():
    """A drive on which fixes cannot hide an error of odometry."""
    log = drive()
    log.sensors.apply(SensorFaults(fixes_silent=True))
    return log


@pytest.mark.parametrize("stamp", [nan, inf, -inf, 1e300, -1e300, 1e6, 0.5, 5e-324])
def test_one_wrong_time_is_ignored(stamp):
    log = silent()
    before = log.state
    log.spoil(stamp=stamp)
    assert repr(log.state) == repr(before)
    assert log.estimator.ignored == 1
    log.go(2.0)
    assert log.error < 1e-3
    assert log.estimator.restarts == []


@pytest.mark.parametrize("jump", [1e6, 2.5, -0.35, -1e9])
def test_estimate_starts_anew_after_a_jump_of_the_clock(jump):
    log = drive()
    log.clock = jump
    pose = log.go(DT).state.pose
    assert log.state.notice == ""  # one time may be wrong
    log.sensors.apply(SensorFaults(fixes_silent=True))
    log.go(DT)
    assert log.state.notice.startswith("the estimate starts anew at the next pose fix: the clock")
    assert log.state.pose == pose
    assert log.state.position_sigma > 9.0
    assert log.state.fix_age >= 0.0
    log.sensors.apply(SensorFaults())
    log.go(0.5)
    assert log.error < 2e-3
    assert log.state.position_sigma < 2e-3
    assert log.state.stamp == pytest.approx(log.t + log.clock)
    assert len(log.estimator.restarts) == 1


@pytest.mark.parametrize("rate", [1000.0, -500.0, 20.0, inf, -inf, nan, 1e300])
def test_impossible_yaw_rates_are_ignored(rate):
    """The paper's robot turns with at most 8.5 rad/s; twice that is the limit."""
    log = silent().spoil(0.5, yaw_rate=rate)
    assert log.error < 1e-3
    assert log.estimator.ignored == (0 if np.isnan(rate) else 5)


@pytest.mark.parametrize("angle", [1e300, -1e308, inf, 1e10, 500.0, nan])
def test_impossible_wheel_angles_are_ignored(angle):
    log = silent()
    angles = log.angles.tolist()
    log.spoil(wheel_angles=(angles[0], angle, angles[2], angle))
    log.go(1.0)
    assert log.error < 1e-2
    assert np.isfinite(log.estimator.filter_state.covariance).all()
    assert (log.estimator.ignored > 0) != np.isnan(angle)


def test_an_encoder_that_starts_from_zero_again_is_used_at_once():
    log = silent()
    offset = log.angles.copy()
    for _ in range(10):
        angles = log.angles - offset * [0.0, 1.0, 0.0, 0.0] + [0.0, 300.0, 0.0, 0.0]
        log.spoil(wheel_angles=tuple(angles.tolist()))
    assert log.estimator.ignored <= 1
    log.go(1.0)
    assert log.error < 2e-2


FIXES = [
    PoseFix(2.1, Pose(1e300, 0.0, 0.0), 0.02, 0.01),
    PoseFix(2.1, Pose(0.0, -inf, 0.0), 0.02, 0.01),
    PoseFix(2.1, Pose(0.0, 0.0, nan), 0.02, 0.01),
    PoseFix(2.1, Pose(0.0, 0.0, 1e300), 0.02, 0.01),
    PoseFix(2.1, TRUE, -1.0, 0.01),
    PoseFix(2.1, TRUE, 0.02, -1.0),
    PoseFix(2.1, TRUE, inf, 0.01),
    PoseFix(2.1, TRUE, 1e300, 0.01),
    PoseFix(2.2, TRUE, 0.02, 0.01),
    PoseFix(inf, TRUE, 0.02, 0.01),
    PoseFix(nan, TRUE, 0.02, 0.01),
    PoseFix(-1e300, TRUE, 0.02, 0.01),
]


@pytest.mark.parametrize("fix", FIXES)
def test_impossible_fixes_are_rejected(fix):
    log = drive()
    log.spoil(fixes=(fix,))
    assert log.estimator.rejected == 1
    assert log.error < 1e-3
    assert log.state.fix_age == pytest.approx(DT)


@pytest.mark.parametrize("fix", FIXES)
def test_latest_fix_ignores_impossible_fixes_and_grows_old(fix):
    estimator = LatestFix()
    estimator.reset(START)
    estimator.update(SensorReadings(2.0, fixes=(PoseFix(2.0, START, 0.02, 0.01),)))
    state = estimator.update(SensorReadings(2.1, fixes=(fix,)))
    assert state.pose == START
    assert state.fix_age == pytest.approx(0.1)
    good = PoseFix(2.2, START._replace(x=3.0), 0.02, 0.01)
    assert estimator.update(SensorReadings(2.2, fixes=(good,))).pose == good.pose


@pytest.mark.parametrize("yaw_sigma", [inf, 1e5])
def test_a_fix_of_the_position_needs_no_yaw(yaw_sigma):
    log = drive()
    fix = PoseFix(2.1, log.state.pose._replace(yaw=nan), 1e-3, yaw_sigma)
    log.spoil(fixes=(fix,), wheel_angles=(nan,) * 4)
    assert log.estimator.rejected == 0
    estimator = LatestFix()
    estimator.reset(START)
    assert estimator.update(SensorReadings(2.1, fixes=(fix,))).pose.yaw == START.yaw


@pytest.mark.parametrize("jump", [1e6, -1.5, -1e9])
def test_latest_fix_goes_on_after_a_jump_of_the_clock(jump):
    estimator = LatestFix()
    estimator.reset(START)
    for k in range(3):
        estimator.update(SensorReadings(0.1 * k, fixes=(PoseFix(0.1 * k, START, 0.02, 0.01),)))
    assert estimator.update(SensorReadings(nan)).stamp == 0.2
    notices = []
    for k in (3, 4, 5):
        t = 0.1 * k + jump
        state = estimator.update(SensorReadings(t, fixes=(PoseFix(t, START._replace(x=k), 1, 1),)))
        notices.append(state.notice)
    assert (state.stamp, state.pose.x, state.fix_age) == (t, 5.0, 0.0)
    assert any(notices) == (jump < 0.0)


def test_latest_fix_of_a_huge_standard_deviation_has_no_covariance():
    estimator = LatestFix()
    fix = PoseFix(0.0, START, 0.02, 1e300)
    assert estimator.update(SensorReadings(0.0, fixes=(fix,))).covariance is None


def test_fixes_that_contradict_the_estimate_for_long_start_it_anew():
    """The robot was carried 1 km: beyond the relocation, which adds 10 m of uncertainty."""
    log = drive(MATCHED, creep=CREEP)
    log.pose = log.pose._replace(x=log.pose.x + 1000.0)
    notices = []
    for _ in range(30):
        log.go(DT)
        notices.append(log.state.notice)
    (notice,) = filter(None, notices)
    assert notice.endswith("15 pose fixes in a row contradict the estimate")
    assert 1.4 < log.estimator.restarts[0] - 2.0 < 1.6
    assert log.estimator.relocations == []
    assert log.error < 0.15


def test_random_fixes_do_not_start_the_estimate_anew():
    log, rng = drive(), np.random.default_rng(0)
    for _ in range(40):
        x, y = rng.normal(0.0, 100.0, 2)
        log.spoil(fixes=(PoseFix(log.t + DT, Pose(x, y, 0.0), 0.02, 0.01),))
    assert log.estimator.restarts == []
    assert log.error < 0.01


def test_covariance_stays_definite_without_any_reading_for_days():
    log = drive(MATCHED)
    log.sensors.apply(ALL_SILENT)
    for k in range(1, 200):
        state = log.estimator.update(SensorReadings(log.t + 1.9 * k))
    log.estimator.update(SensorReadings(log.t + 1.9 * 200))
    assert is_definite(log.estimator.filter_state.covariance, 1e-12)
    assert 100.0 < state.position_sigma < 2000.0
    log.sensors.apply(SensorFaults())
    log.clock = 1.9 * 200
    assert log.go(1.0).error < 0.1
    assert log.state.position_sigma < 0.1


def test_wheel_motion_is_not_lost_when_readings_repeat_a_time():
    """Encoder messages with one stamp, or nearly, whose wheels turn on meanwhile."""
    log = silent()
    for _ in range(20):
        readings = log.go(DT).log[-1]
        for shift in (0.0, 1e-7):
            turned = tuple((readings.wheel_angles + 0.1 * ROBOT.rim_jacobian[:, 0]).tolist())
            log.estimator.update(
                SensorReadings(readings.stamp + shift, turned, yaw_rate=readings.yaw_rate)
            )
    assert log.error < 1e-3


def test_number_of_processed_fixes_is_bounded():
    """A million of them in one update would take minutes."""
    estimator = PoseEstimator(ROBOT)
    estimator.update(SensorReadings(0.0, (0.0,) * 4))
    flood = (PoseFix(0.05, START, 5.0, 5.0),) * 1_000_000
    estimator.update(SensorReadings(0.1, (0.0,) * 4, fixes=flood))
    assert len(list(estimator._buffer.latest_fixes)) == 20
    assert estimator.rejected == 1_000_000 - 20
    assert LatestFix().update(SensorReadings(0.1, fixes=flood)).pose == START


def test_number_of_stored_readings_is_bounded():
    estimator = PoseEstimator(ROBOT)
    for k in range(500):
        fixes = tuple(PoseFix(1e-4 * k, START, 5.0, 5.0) for _ in range(100 * (k % 50 == 0)))
        estimator.update(SensorReadings(1e-4 * k, (0.0,) * 4, fixes=fixes))
    intervals = estimator._buffer.intervals
    assert 100 < sum(1 + len(each.fixes) for each in intervals) <= 200
    assert intervals[-1].end - intervals[0].begin < 0.02


@pytest.mark.parametrize("angles", [(1.0,), (1.0, 2.0, 3.0), (0.0,) * 5])
def test_another_number_of_wheels_is_refused(angles):
    with pytest.raises(InvalidInput, match=rf"hold {len(angles)} wheel angles, the robot has 4"):
        PoseEstimator(ROBOT).update(SensorReadings(0.0, angles))


@pytest.mark.parametrize("estimator", [LatestFix(), PoseEstimator(ROBOT)])
@pytest.mark.parametrize("number", [nan, inf, 1e300, 10**400, "1"])
def test_an_unknown_start_is_refused(estimator, number):
    with pytest.raises(InvalidInput, match="the pose at the start must be finite"):
        estimator.reset(Pose(0.0, number, 0.0))


def test_a_run_with_a_huge_start_is_refused():
    with pytest.raises(InvalidInput, match="the pose at the start must be finite and at most 1e"):
        simulate(
            KinematicPlant(ROBOT), FeedforwardController(0.1), Hold(START, 1.0),
            start=Pose(1e300, 0.0, 0.0), dt=0.1,
        )  # fmt: skip


@pytest.mark.parametrize("damping", [0.1, 0.9])
def test_a_bias_that_changes_in_weeks_keeps_the_covariance_definite(damping):
    """The noise of its process is far smaller than the rounding of its stationary variance."""
    fixes = PoseFixSettings(position_bias=100.0, bias_time=1e6, bias_damping=damping)
    log = Spoiled(SensorSettings(fixes=fixes), dt=1e-3).go(0.02)
    covariance = log.estimator.filter_state.covariance[4:, 4:]
    assert (np.diag(covariance) >= 0.0).all()
    assert is_definite(covariance, 1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"settings": EstimatorSettings(memory=nan)}, "memory is nan s, need 0 to 60 s"),
        ({"settings": EstimatorSettings(time_jump=0.0)}, "time_jump is 0 s, need 0.01 to 5 s"),
        ({"sensors": SensorSettings(gyro=GyroSettings(bias=-1.0))}, "bias is -1 rad/s"),
    ],
)
def test_settings_are_checked(changes, message):
    with pytest.raises(InvalidInput, match=message):
        PoseEstimator(ROBOT, **changes)


def test_a_changed_covariance_does_not_change_the_filter():
    log = drive()
    log.state.covariance[:] = nan
    assert np.isfinite(log.estimator.filter_state.covariance).all()


def test_a_notice_is_text():
    state = State(0.0, START, notice=["lost"])
    assert state_fault(state) == "notice of its State is ['lost'], need text"


class JumpingClock(PerfectSensors):
    """Sensors whose clock goes back by 1000 s after 0.5 s."""

    def read(self, t, state):
        readings = super().read(t, state)
        if t < 0.45:
            return readings
        fixes = tuple(fix._replace(stamp=fix.stamp - 1000.0) for fix in readings.fixes)
        return readings._replace(stamp=t - 1000.0, fixes=fixes)


def test_events_of_a_run_hold_the_notices_of_the_estimator():
    run = simulate(
        KinematicPlant(ROBOT), FeedforwardController(0.1), Hold(START._replace(x=1.2), 1.0),
        start=START, dt=0.1, sensors=JumpingClock(), estimator=PoseEstimator(ROBOT, slips=False),
    )  # fmt: skip
    ((t, what),) = run.events
    assert t == pytest.approx(0.6)
    assert what == "the estimate starts anew at the next pose fix: the clock jumped by -999.8 s"
    assert np.abs(run.measured[-1] - run.pose[-1]).max() < 1e-3
