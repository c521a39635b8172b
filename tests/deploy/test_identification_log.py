"""Identification of a robot from the log of a drive."""

from dataclasses import dataclass, field, replace
from math import inf, nan, pi
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mcap")

from omnidrive import PlanarPlant, Pose, named_robot
from omnidrive.control import Command, Pipeline, WheelTorques
from omnidrive.deploy import SimulatedClock, SimulatedLink, SimulatedRobot, drive
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.identification_log import identification_log
from omnidrive.deploy.log import DriveLog, LoggedSample, read_log
from omnidrive.deploy.log.logged_drive import LoggedDrive
from omnidrive.errors import InvalidLog
from omnidrive.estimation import PoseFix, PoseFixSettings, SensorReadings, SensorSettings
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Hold
from omnidrive.simulation import SensorSuite
from omnidrive.simulation.identification import identification_commands, identify_robot
from omnidrive.simulation.planar.model import servo_lags

DT = 0.02
NOMINAL = named_robot("small")
TRUE = replace(
    NOMINAL,
    wheel=replace(NOMINAL.wheel, radius=0.048),
    drive_gain=(0.048 / 0.05,) * 3,  # wheel speeds are commanded with the nominal radius
)


@dataclass
class Sensors:
    """Exact poses and wheel angles."""

    angles: np.ndarray = field(default_factory=lambda: np.zeros(4))
    last: float = 0.0
    silent: tuple = (9e9, 9e9)

    def reset(self, pose):
        self.angles[:] = 0.0

    def read(self, t, state):
        self.angles += (t - self.last) * np.array(state.wheel_speeds)
        self.last = t
        fixes = (PoseFix(t, state.pose, 1e-3, 1e-3),)
        if self.silent[0] <= t < self.silent[1]:
            fixes = ()
        return SensorReadings(t, tuple(self.angles.tolist()), fixes=fixes)


class Commands:
    """Commands that determine the robot, whatever the reference is."""

    def __init__(self, rows):
        self.rows, self.dt = rows, DT

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        return Command(BodyTwist(*self.rows[round(t / DT)].tolist()))


def write_log(path, duration, silent=(9e9, 9e9), sensors=None):
    rows = identification_commands(TRUE, np.random.default_rng(5), DT, duration + 1.0)
    plant = PlanarPlant(TRUE, timestep=1e-4)  # so that its lags are those of the servos
    link = SimulatedLink(
        SimulatedRobot(TRUE, plant, sensors or Sensors(silent=silent)), Pose(0.0, 0.0, 0.0)
    )
    drive(
        link,
        Pipeline(Commands(rows)),
        Hold(Pose(0.0, 0.0, 0.0), duration),
        rate=1.0 / DT,
        clock=SimulatedClock(),
        log=DriveLog(path),
    )
    return link


def test_log_holds_poses_commands_and_wheel_speeds(tmp_path):
    link = write_log(tmp_path / "a.mcap", 6.0, silent=(1.0, 1.1))
    log = identification_log(read_log(tmp_path / "a.mcap"))
    assert len(log.t) == round(6.0 / DT) + 1
    np.testing.assert_allclose(log.t, DT * np.arange(len(log.t)), atol=1e-9)
    assert np.flatnonzero(~log.measured).tolist() == [50, 51, 52, 53, 54]
    poses = np.array([state.pose for state in link.states])
    np.testing.assert_allclose(log.poses[log.measured], poses[log.measured], atol=1e-12)
    speeds = np.array([state.wheel_speeds for state in link.states])
    np.testing.assert_allclose(log.wheel_speeds[1:], speeds[1:], atol=1e-6)
    assert log.mean_wheel_speeds


@pytest.mark.long
def test_changed_robot_is_identified_from_the_log_of_a_drive(tmp_path):
    write_log(tmp_path / "a.mcap", 60.0)
    found = identify_robot(identification_log(read_log(tmp_path / "a.mcap")), NOMINAL)
    assert found.robot.wheel.radius == pytest.approx(0.048, rel=2e-3)
    lag = found.estimates["lag in translation"]
    assert abs(lag.value - servo_lags(TRUE)[0]) < 3.0 * lag.sigma + 1e-3


@pytest.mark.long
@pytest.mark.parametrize("rate", [3.0, 10.0, 25.0])
def test_parameters_are_identified_from_fixes_rarer_than_samples(tmp_path, rate):
    """Noise, encoders and rate of the default sensors; 3 Hz as of localisation in a map."""
    fixes = PoseFixSettings(rate=rate)
    suite = SensorSuite(SensorSettings(fixes=fixes), TRUE.chassis, np.random.default_rng(6))
    write_log(tmp_path / "a.mcap", 60.0, sensors=suite)
    found = identify_robot(identification_log(read_log(tmp_path / "a.mcap")), NOMINAL).estimates
    lags = servo_lags(TRUE)
    truth = {
        "wheel radius": 0.048,
        "effective radius": TRUE.effective_radius,
        "lag in translation": lags[0],
        "lag in rotation": lags[1],
        "delay": 0.0,
    }
    for name, true in truth.items():
        estimate = found[name]
        assert abs(estimate.value - true) < 3.0 * estimate.sigma, (estimate, true)
    assert found["wheel radius"].sigma < 0.01 * 0.048
    assert found["effective radius"].sigma < 0.02 * TRUE.effective_radius
    friction = found["friction"]
    assert friction.reason or abs(friction.value - TRUE.friction) < 3.0 * friction.sigma


class Drive(LoggedDrive):
    """A log in memory: a robot that drives at 0.22 m/s and turns at 0.4 rad/s."""

    robot = NOMINAL

    def __init__(self, rate, samples):
        metadata = {"dt": str(1.0 / rate)}
        super().__init__((Path("a"),), metadata, {}, (), (), (), (), True, 0, len(samples))
        object.__setattr__(self, "kept", samples)

    def samples(self):
        return iter(self.kept)


FORWARDS = BodyTwist(0.2, 0.0, 0.4)


def sampled(rate, count, taken, origin=5.0, sent=FORWARDS):
    """Return a log in which each sample has the measurements that were ``taken`` before it (s)."""
    samples, begin, taken = [], origin + 0.004, np.asarray(taken).tolist()
    for k in range(count):
        now = k / rate + begin
        fixes = []
        while taken and origin + taken[0] <= now:
            t = taken.pop(0)
            yaw = (0.4 * t + pi) % (2.0 * pi) - pi
            fixes.append(PoseFix(origin + t, Pose(0.2 * t, -0.1 * t, yaw), 1e-3, 1e-3))
        read = None
        if fixes:
            angles = tuple(3.0 * (fixes[-1].stamp - origin) for _ in NOMINAL.mounts)
            read = SensorReadings(fixes[-1].stamp, angles, fixes=tuple(fixes))
        sample = LoggedSample(k, DriveState.RUNNING, 0.0, 0.0, read=read, sent=sent)
        samples.append(sample)
    return Drive(rate, samples)


def check_straight(log):
    """Check the poses and wheel speeds of :func:`sampled`, with the times of the rows."""
    t, poses = log.t[log.measured], log.poses[log.measured]
    moved = np.outer(np.diff(t), [0.2, -0.1, 0.4])
    poses[:, 2] = np.unwrap(poses[:, 2])
    np.testing.assert_allclose(np.diff(poses, axis=0), moved, atol=1e-6)
    read = ~np.isnan(log.wheel_speeds[:, 0])
    np.testing.assert_allclose(log.wheel_speeds[read], 3.0, rtol=1e-4)


def test_measurements_keep_their_times():
    """Poses at 10 Hz arrive now before, now after the sample of a loop at 10 Hz."""
    rng = np.random.default_rng(3)
    taken = 0.1 * np.arange(300) + rng.uniform(-0.01, 0.01, 300)
    drive = sampled(10.0, 290, taken)
    without = [sample for sample in drive.samples() if sample.read is None]
    assert len(without) > 50
    log = identification_log(drive)
    assert log.measured.sum() > 280
    check_straight(log)


def test_single_missing_measurements_end_no_stretch_but_half_a_second_without_does():
    taken = [0.1 * k for k in range(100) if k % 7 != 3 and not 80 <= k < 85]
    log = identification_log(sampled(10.0, 100, taken))
    assert log.t[-1] == pytest.approx(7.9, abs=0.1)
    check_straight(log)


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
def test_samples_may_be_more_frequent_than_fixes(rate):
    log = identification_log(sampled(rate, round(10.0 * rate), 0.1 * np.arange(100)))
    assert log.measured.sum() > 95
    assert len(log.t) > 9.6 * rate
    check_straight(log)


def test_fixes_that_cannot_be_used_are_ignored():
    drive = sampled(10.0, 60, 0.1 * np.arange(60))
    wild = [
        PoseFix(5.31, Pose(nan, 0.0, 0.0), 1e-3, 1e-3),
        PoseFix(inf, Pose(9.0, 9.0, 0.0), 1e-3, 1e-3),
        PoseFix(5.42, Pose(9.0, 9.0, 0.0), 1e-3, inf),
    ]
    samples = [
        sample._replace(read=sample.read._replace(fixes=(*sample.read.fixes, *wild)))
        for sample in drive.samples()
    ]
    check_straight(identification_log(Drive(10.0, samples)))


@pytest.mark.parametrize("lacking", [range(7), range(20, 21), range(50, 60)])
def test_readings_without_wheel_angles_leave_those_of_the_others(lacking):
    """As of ROS 2 before the first JointState."""
    drive = sampled(10.0, 60, 0.1 * np.arange(60))
    samples = [
        sample._replace(read=sample.read._replace(wheel_angles=()))
        if sample.number in lacking
        else sample
        for sample in drive.samples()
    ]
    log = identification_log(Drive(10.0, samples))
    check_straight(log)
    assert log.measured.sum() >= 59
    assert (~np.isnan(log.wheel_speeds[:, 0])).sum() >= 59 - len(lacking)


@pytest.mark.parametrize("offset", [0.2e-6, 0.5e-6, 0.8e-6])
@pytest.mark.parametrize("apart", [0.3e-6, 0.6e-6, 0.9e-6])
def test_stamps_within_a_microsecond_give_finite_wheel_speeds(apart, offset):
    """Absolutely rounded they may differ, and relative to the first sample coincide."""
    drive = sampled(10.0, 60, 0.1 * np.arange(60), origin=5.0 + 0.4e-6)
    samples = list(drive.samples())
    read = samples[29].read
    stamp = round(read.stamp, 6) + offset
    samples[29] = samples[29]._replace(read=read._replace(stamp=stamp))
    samples[30] = samples[30]._replace(
        read=read._replace(stamp=stamp + apart, fixes=samples[30].read.fixes)
    )
    log = identification_log(Drive(10.0, samples))
    read = ~np.isnan(log.wheel_speeds[:, 0])
    assert np.isfinite(log.wheel_speeds[read]).all()
    assert (np.diff(log.t) > 0.0).all()


def test_log_without_fixes_or_with_torques_is_refused(tmp_path):
    write_log(tmp_path / "a.mcap", 0.5, silent=(0.01, 9e9))
    with pytest.raises(InvalidLog, match=r"fewer than two pose fixes in succession: .*as a table"):
        identification_log(read_log(tmp_path / "a.mcap"))
    drive = sampled(10.0, 60, 0.1 * np.arange(60), sent=WheelTorques([0.0] * 4))
    with pytest.raises(InvalidLog, match="commands wheel torques"):
        identification_log(drive)
