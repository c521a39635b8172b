"""Watchdog, wheel monitor, and the supervisor's reactions to failed wheels."""

from dataclasses import replace
from math import isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.control import Command, FeedforwardController
from omnidrive.control.reduced_drive import ReducedDrive, limit_acceleration
from omnidrive.control.supervision import (
    Finding,
    SafetySupervisor,
    Watchdog,
    WatchdogLimits,
    WheelDefect,
    WheelMonitor,
)
from omnidrive.errors import InvalidGeometry
from omnidrive.estimation import EncoderSettings, SensorReadings, State
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.robot import named_robot, omni_ring
from tests.examples import examples

ROBOT = named_robot("paper")
ORIGIN = Pose(0.0, 0.0, 0.0)
LIMITS = WatchdogLimits(error=1.0, position_sigma=0.5, age=1.5, patience=0.3)
DT = 0.1
FEW = examples(25)


def estimate(pose, sigma=0.0, age=0.0):
    covariance = None if isnan(sigma) else np.diag([sigma**2, 0.0, 0.0])
    return State(0.0, pose, None, covariance, age)


def check_errors(errors, sigma=0.0, age=0.0):
    """Return the watchdog's reasons, sample by sample, for a sequence of position errors (m)."""
    watchdog = Watchdog(LIMITS)
    watchdog.reset()
    return [
        watchdog.check(k * DT, estimate(Pose(e, 0.0, 0.0), sigma, age), ORIGIN)
        for k, e in enumerate(errors)
    ]


def test_error_above_the_limit_for_the_patience_stops_the_robot():
    reasons = check_errors([0.0, 1.1, 1.1, 1.1, 1.1])
    assert reasons[:4] == [None] * 4
    assert reasons[4] == "it is 1.10 m from the reference, more than 1.00 m"


def test_short_errors_do_not_stop_the_robot():
    assert check_errors([0.0, 5.0, 0.0, 5.0, 5.0, 5.0, 0.0]) == [None] * 7


def test_error_limit_is_relative_to_the_initial_error():
    assert check_errors([1.4] + [2.3] * 9) == [None] * 10
    assert check_errors([1.4] + [2.5] * 9)[4] is not None


@pytest.mark.parametrize(("sigma", "age"), [(0.6, 0.0), (0.0, 1.6)])
def test_lost_pose_stops_the_robot(sigma, age):
    reasons = check_errors([0.0] * 5, sigma, age)
    assert reasons[2] is None
    assert reasons[3].startswith("its pose is lost")


def test_unknown_covariance_is_accepted():
    assert check_errors([0.0] * 9, sigma=nan) == [None] * 9


def test_pose_that_is_not_finite_is_an_error_above_the_limit():
    """The pipeline keeps such poses away; a watchdog alone has the same patience with them."""
    assert check_errors([0.0, nan, nan, nan, 0.0]) == [None] * 5
    reasons = check_errors([0.0, nan, nan, nan, nan])
    assert reasons == [None] * 4 + ["it is nan m from the reference, more than 1.00 m"]


def test_limits_scale_with_the_robot():
    assert WatchdogLimits.of(ROBOT).error == 1.5
    assert WatchdogLimits.of(named_robot("small")).error == 1.0


FINE = EncoderSettings(2**24)
DEFAULT = EncoderSettings()


class Bench:
    """Wheels on a test bench, with a slip and a defect for each wheel."""

    def __init__(self, robot=ROBOT, encoders=FINE):
        self.robot, self.monitor = robot, WheelMonitor(robot, encoders)
        self.step = encoders.step
        self.angles = np.zeros(len(robot.mounts))

    def sample(self, twist, slip, **defects):
        """Return the findings of a sample in which wheels are ``slip`` (rad/s) too slow.

        Args:
            twist: Commanded body twist.
            slip: Commanded minus actual speed of each wheel, rad/s.
            defects: Defects by wheel, as in ``w2=self.dead``.
        """
        robot = self.robot
        speeds = robot.chassis.wheel_speeds(twist) - slip
        torques = np.clip(robot.servo_gain * slip, -robot.max_torque, robot.max_torque)
        for name, defect in defects.items():
            speeds, torques = defect(int(name[1:]), speeds, torques)
        self.angles = self.angles + speeds * DT
        counted = self.step * np.round(self.angles / self.step)
        return self.monitor.update(twist, DT, tuple(counted), tuple(torques))

    def dead(self, i, speeds, torques):
        torques[i] = 0.0
        return speeds, torques

    def locked(self, i, speeds, torques):
        torques[i] = self.robot.max_torque
        speeds[i] = 0.0
        return speeds, torques

    def dead_encoder(self, i, speeds, torques):
        speeds[i] = 0.0
        return speeds, torques


TWIST = BodyTwist(0.5, 0.1, 0.2)
SLIP = np.array([0.02, -0.03, 0.05, 0.1])


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize("defect", WheelDefect)
def test_defect_is_reported_after_three_samples(wheel, defect):
    bench = Bench()
    for _ in range(5):
        assert bench.sample(TWIST, SLIP) == []
    defects = {f"w{wheel}": getattr(bench, defect.name.lower())}
    assert [bench.sample(TWIST, SLIP, **defects) for _ in range(4)] == [
        [], [], [Finding(wheel, defect)], [],
    ]  # fmt: skip


@FEW
@given(st.integers(0, 2**32 - 1), st.sampled_from([FINE, DEFAULT, EncoderSettings(256)]))
def test_healthy_wheels_are_never_reported(seed, encoders):
    """Random commands and slip, with the torque of the servos, also at its limit."""
    rng, bench = np.random.default_rng(seed), Bench(encoders=encoders)
    for _ in range(60):
        twist = BodyTwist(*(rng.normal(size=3) * rng.choice([0.01, 0.3, 2.0])).tolist())
        slip = rng.normal(size=4) * rng.choice([0.001, 0.1, 2.0])
        assert bench.sample(twist, slip) == []


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize("defect", WheelDefect)
def test_default_encoders_resolve_a_defect(wheel, defect):
    """The missing torque must exceed the error of the measured speed."""
    bench, slip = Bench(encoders=DEFAULT), np.full(4, 0.05)
    for _ in range(5):
        assert bench.sample(TWIST, slip) == []
    defects = {f"w{wheel}": getattr(bench, defect.name.lower())}
    found = [finding for _ in range(8) for finding in bench.sample(TWIST, slip, **defects)]
    assert found == [Finding(wheel, defect)]


def test_encoder_without_readings_is_reported_as_dead():
    monitor, angles, found = WheelMonitor(ROBOT), np.zeros(4), []
    for k in range(8):
        angles = angles + ROBOT.chassis.wheel_speeds(TWIST) * DT
        read = tuple(nan if i == 2 and k > 2 else angle for i, angle in enumerate(angles.tolist()))
        found += monitor.update(TWIST, DT, read, (0.01,) * 4)
    assert found == [Finding(2, WheelDefect.DEAD_ENCODER)]


def test_idle_wheels_are_not_reported():
    bench = Bench()
    assert [bench.sample(BodyTwist(0.0, 0.0, 0.0), 0.0 * SLIP, w0=bench.dead)] * 20 == [[]] * 20


def test_nothing_is_reported_without_readings():
    assert WheelMonitor(ROBOT).update(TWIST, DT, (), ()) == []


def test_slow_motors_are_not_reported_as_dead():
    """The monitor models set points that follow the command with a lag."""
    slow = replace(ROBOT, motor_lag=0.2)
    monitor, set_points, angles = WheelMonitor(slow), np.zeros(4), np.zeros(4)
    for k in range(40):
        twist = BodyTwist(0.5 if k % 20 < 10 else -0.5, 0.0, 0.0)
        commanded, torques = slow.chassis.wheel_speeds(twist), np.zeros(4)
        for _ in range(100):  # wheels 0.1 rad/s slower than the set point
            set_points += (commanded - set_points) * (1.0 - np.exp(-DT / 100 / 0.2))
            angles += (set_points - 0.1) * DT / 100
            torques += slow.servo_gain * 0.1 / 100
        assert monitor.update(twist, DT, tuple(angles), tuple(torques)) == []


def test_reduced_drive_with_three_wheels():
    drive = ReducedDrive.of(ROBOT, {1})
    assert drive.wheels == (0, 2, 3)
    assert drive.chassis.twist(drive.chassis.wheel_speeds(TWIST)) == pytest.approx(TWIST)
    # the failed wheel still carries its load
    assert drive.force_limits == pytest.approx(ROBOT.force_limits[[0, 2, 3]])
    for axis in np.eye(3):  # weaker than four wheels in every direction
        assert (
            np.abs(drive.acceleration_faces @ axis).max()
            > 1.05 * np.abs(ROBOT.acceleration_faces @ axis).max()
        )


def test_two_wheels_are_not_sufficient():
    kiwi = replace(ROBOT, mounts=omni_ring((0.0, 2.1, 4.2), 0.5))
    with pytest.raises(InvalidGeometry):
        ReducedDrive.of(kiwi, {0})
    supervisor = make_supervisor(kiwi)
    supervisor._compensate(1.0, Finding(0, WheelDefect.DEAD))
    assert (
        supervisor.stopped == "at 1.00 s wheel 0 is dead, and the others cannot compensate for it"
    )


TWISTS = st.builds(BodyTwist, *[st.floats(-2.0, 2.0)] * 3)


@FEW
@given(TWISTS, TWISTS)
def test_limited_twist_is_between_old_and_desired_and_within_the_friction_limits(before, desired):
    limited = limit_acceleration(ROBOT.acceleration_faces, before, desired, DT)
    step, whole = np.subtract(limited, before), np.subtract(desired, before)
    assert np.abs(ROBOT.acceleration_faces @ step).max() <= DT * (1.0 + 1e-9)
    assert np.linalg.norm(np.cross(step, whole)) == pytest.approx(0.0, abs=1e-9)
    assert np.dot(step, whole) >= 0.0


def make_supervisor(robot=ROBOT):
    supervisor = SafetySupervisor(robot, Watchdog(WatchdogLimits.of(robot)), WheelMonitor(robot))
    supervisor.reset(FeedforwardController(DT))
    return supervisor


NO_READINGS = SensorReadings(0.0)


def test_state_and_command_of_a_healthy_robot_are_unchanged():
    supervisor, command = make_supervisor(), Command(BodyTwist(9.0, 9.0, 9.0))
    state = estimate(ORIGIN)
    assert supervisor.check(0.0, NO_READINGS, state, ORIGIN) is state
    assert supervisor.limit(command, DT) is command


@FEW
@given(
    st.integers(0, 3),
    st.builds(Pose, *[st.floats(-3.0, 3.0)] * 3),
    st.builds(BodyTwist, *[st.floats(-0.3, 0.3)] * 3),
)
def test_position_is_controlled_with_a_locked_wheel(wheel, pose, twist):
    supervisor = make_supervisor()
    supervisor._compensate(0.0, Finding(wheel, WheelDefect.LOCKED))
    target = Pose(pose.x, pose.y, 1.0)
    received = supervisor.check(0.0, NO_READINGS, estimate(pose), target).pose
    assert received == target  # no heading error
    for _ in range(20):  # until the acceleration limit is inactive
        sent = supervisor.limit(Command(twist), DT).twist
        assert ROBOT.rim_jacobian[wheel] @ np.array(sent) == pytest.approx(0.0, abs=1e-12)
    reached, commanded = move(pose, sent, DT), move(received, twist, DT)
    assert reached[:2] == pytest.approx(commanded[:2], abs=1e-9)


def test_second_locked_wheel_stops_the_robot():
    supervisor = make_supervisor()
    supervisor._compensate(1.0, Finding(0, WheelDefect.LOCKED))
    supervisor._compensate(2.0, Finding(1, WheelDefect.LOCKED))
    assert supervisor.stopped.startswith("at 2.00 s wheel 1 is locked")


def test_stop_brakes_within_the_force_limits():
    supervisor, before = make_supervisor(), BodyTwist(1.5, -0.5, 1.0)
    supervisor.check(0.0, NO_READINGS, estimate(ORIGIN), ORIGIN)
    supervisor.limit(Command(before), DT)
    for k in range(1, 6):
        supervisor.check(k * DT, NO_READINGS, estimate(Pose(9.0, 0.0, 0.0)), ORIGIN)
    assert "9.00 m from the reference" in supervisor.stopped
    twists = [before]
    while not supervisor.at_rest:
        twists.append(supervisor.limit(Command(BodyTwist(5.0, 5.0, 5.0)), DT).twist)
        assert len(twists) < 30
    assert len(twists) > 3
    assert np.abs(np.diff(twists, axis=0) @ ROBOT.acceleration_faces.T).max() <= DT
    assert [event.what.split(":")[0] for event in supervisor.events] == [
        "the watchdog stops the robot"
    ]


def test_reset_clears_all_findings():
    supervisor = make_supervisor()
    supervisor._compensate(0.0, Finding(0, WheelDefect.DEAD))
    supervisor._compensate(0.0, Finding(1, WheelDefect.LOCKED))
    supervisor.reset(FeedforwardController(DT))
    command = Command(TWIST)
    assert supervisor.limit(command, DT) is command
    assert supervisor.events == []
