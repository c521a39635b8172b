"""Watchdog, wheel monitor and what is done about lost wheels, each by itself."""

from dataclasses import replace
from math import isnan, nan

import numpy as np
import pytest
from hypothesis import given, settings
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

ROBOT = named_robot("paper")
HERE = Pose(0.0, 0.0, 0.0)
LIMITS = WatchdogLimits(error=1.0, position_sigma=0.5, age=1.5, patience=0.3)
DT = 0.1
few = settings(max_examples=25, deadline=None)


def estimate(pose, sigma=0.0, age=0.0):
    covariance = None if isnan(sigma) else np.diag([sigma**2, 0.0, 0.0])
    return State(0.0, pose, None, covariance, age)


def looks(errors, sigma=0.0, age=0.0):
    """What the watchdog says, sample by sample, of a robot that is so far off."""
    dog = Watchdog(LIMITS)
    dog.reset()
    return [
        dog.check(k * DT, estimate(Pose(e, 0.0, 0.0), sigma, age), HERE)
        for k, e in enumerate(errors)
    ]


def test_a_robot_that_is_off_for_long_enough_is_stopped():
    said = looks([0.0, 1.1, 1.1, 1.1, 1.1])
    assert said[:4] == [None] * 4
    assert said[4] == "it is 1.10 m from the reference, more than 1.00 m"


def test_one_bad_measurement_stops_nobody():
    assert looks([0.0, 5.0, 0.0, 5.0, 5.0, 5.0, 0.0]) == [None] * 7


def test_who_starts_far_off_may_be_so_far_off():
    assert looks([1.4] + [2.3] * 9) == [None] * 10
    assert looks([1.4] + [2.5] * 9)[4] is not None


@pytest.mark.parametrize(("sigma", "age"), [(0.6, 0.0), (0.0, 1.6)])
def test_a_lost_pose_stops_it(sigma, age):
    said = looks([0.0] * 5, sigma, age)
    assert said[2] is None
    assert said[3].startswith("its pose is lost")


def test_an_unknown_uncertainty_is_none():
    assert looks([0.0] * 9, sigma=nan) == [None] * 9


def test_what_is_not_finite_stops_it_at_once():
    assert looks([0.0, nan])[1] == "the measured pose is not finite"


def test_limits_grow_with_the_robot():
    assert WatchdogLimits.of(ROBOT).error == 1.5
    assert WatchdogLimits.of(named_robot("small")).error == 1.0


FINE = EncoderSettings(2**24)
USUAL = EncoderSettings()


class Bench:
    """Wheels on a test bench, each of which follows its servo in its own way."""

    def __init__(self, robot=ROBOT, encoders=FINE):
        self.robot, self.monitor = robot, WheelMonitor(robot, encoders)
        self.step = encoders.step
        self.angles = np.zeros(len(robot.mounts))

    def sample(self, twist, slip, **ways):
        """Wheels are ``slip`` (rad/s) slower than told; returns what is found."""
        robot = self.robot
        speeds = robot.chassis.wheel_speeds(twist) - slip
        torques = np.clip(robot.servo_gain * slip, -robot.max_torque, robot.max_torque)
        for name, way in ways.items():
            speeds, torques = way(int(name[1:]), speeds, torques)
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
def test_a_defect_is_found_after_three_samples(wheel, defect):
    bench = Bench()
    for _ in range(5):
        assert bench.sample(TWIST, SLIP) == []
    way = {f"w{wheel}": getattr(bench, defect.name.lower())}
    assert [bench.sample(TWIST, SLIP, **way) for _ in range(4)] == [
        [], [], [Finding(wheel, defect)], [],
    ]  # fmt: skip


@few
@given(st.integers(0, 2**32 - 1), st.sampled_from([FINE, USUAL, EncoderSettings(256)]))
def test_healthy_wheels_are_never_found_defective(seed, encoders):
    """Any commands, any slip that the motors' torque explains, also at its limit."""
    rng, bench = np.random.default_rng(seed), Bench(encoders=encoders)
    for _ in range(60):
        twist = BodyTwist(*(rng.normal(size=3) * rng.choice([0.01, 0.3, 2.0])).tolist())
        slip = rng.normal(size=4) * rng.choice([0.001, 0.1, 2.0])
        assert bench.sample(twist, slip) == []


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize("defect", WheelDefect)
def test_usual_encoders_resolve_a_defect(wheel, defect):
    """The torque that is missing has to exceed the error of the measured speed."""
    bench, slip = Bench(encoders=USUAL), np.full(4, 0.05)
    for _ in range(5):
        assert bench.sample(TWIST, slip) == []
    way = {f"w{wheel}": getattr(bench, defect.name.lower())}
    found = [finding for _ in range(8) for finding in bench.sample(TWIST, slip, **way)]
    assert found == [Finding(wheel, defect)]


def test_a_silent_encoder_counts_as_a_dead_one():
    monitor, angles, found = WheelMonitor(ROBOT), np.zeros(4), []
    for k in range(8):
        angles = angles + ROBOT.chassis.wheel_speeds(TWIST) * DT
        read = tuple(nan if i == 2 and k > 2 else angle for i, angle in enumerate(angles.tolist()))
        found += monitor.update(TWIST, DT, read, (0.01,) * 4)
    assert found == [Finding(2, WheelDefect.DEAD_ENCODER)]


def test_who_is_not_called_upon_is_not_judged():
    bench = Bench()
    assert [bench.sample(BodyTwist(0.0, 0.0, 0.0), 0.0 * SLIP, w0=bench.dead)] * 20 == [[]] * 20


def test_a_plant_that_does_not_tell_is_trusted():
    assert WheelMonitor(ROBOT).update(TWIST, DT, (), ()) == []


def test_slow_motors_are_no_dead_ones():
    """Set points that follow with a lag explain what a servo gives."""
    slow = replace(ROBOT, motor_lag=0.2)
    monitor, set_points, angles = WheelMonitor(slow), np.zeros(4), np.zeros(4)
    for k in range(40):
        twist = BodyTwist(0.5 if k % 20 < 10 else -0.5, 0.0, 0.0)
        told, torques = slow.chassis.wheel_speeds(twist), np.zeros(4)
        for _ in range(100):  # wheels that follow the set point but for 0.1 rad/s
            set_points += (told - set_points) * (1.0 - np.exp(-DT / 100 / 0.2))
            angles += (set_points - 0.1) * DT / 100
            torques += slow.servo_gain * 0.1 / 100
        assert monitor.update(twist, DT, tuple(angles), tuple(torques)) == []


def test_three_wheels_carry_on():
    left = ReducedDrive.of(ROBOT, {1})
    assert left.wheels == (0, 2, 3)
    assert left.chassis.twist(left.chassis.wheel_speeds(TWIST)) == pytest.approx(TWIST)
    assert left.force_limits == pytest.approx(
        ROBOT.force_limits[[0, 2, 3]]
    )  # it still carries its load
    for axis in np.eye(3):  # less than four, but something in every direction
        assert (
            np.abs(left.acceleration_faces @ axis).max()
            > 1.05 * np.abs(ROBOT.acceleration_faces @ axis).max()
        )


def test_two_wheels_do_not():
    kiwi = replace(ROBOT, mounts=omni_ring((0.0, 2.1, 4.2), 0.5))
    with pytest.raises(InvalidGeometry):
        ReducedDrive.of(kiwi, {0})
    guard = supervisor(kiwi)
    guard._compensate(1.0, Finding(0, WheelDefect.DEAD))
    assert guard.stopped == "at 1.00 s wheel 0 is dead, and the others cannot compensate for it"


twists = st.builds(BodyTwist, *[st.floats(-2.0, 2.0)] * 3)


@few
@given(twists, twists)
def test_an_eased_twist_is_on_the_way_and_within_traction(before, wanted):
    got = limit_acceleration(ROBOT.acceleration_faces, before, wanted, DT)
    assert np.abs(ROBOT.acceleration_faces @ np.subtract(got, before)).max() <= DT * (1.0 + 1e-9)
    along, whole = np.subtract(got, before), np.subtract(wanted, before)
    assert np.linalg.norm(np.cross(along, whole)) == pytest.approx(0.0, abs=1e-9)
    assert np.dot(along, whole) >= 0.0


def supervisor(robot=ROBOT):
    guard = SafetySupervisor(robot, Watchdog(WatchdogLimits.of(robot)), WheelMonitor(robot))
    guard.reset(FeedforwardController(DT))
    return guard


NO_READINGS = SensorReadings(0.0)


def test_nothing_is_changed_while_nothing_is_wrong():
    guard, command = supervisor(), Command(BodyTwist(9.0, 9.0, 9.0))
    state = estimate(HERE)
    assert guard.check(0.0, NO_READINGS, state, HERE) is state
    assert guard.limit(command, DT) is command


@few
@given(
    st.integers(0, 3),
    st.builds(Pose, *[st.floats(-3.0, 3.0)] * 3),
    st.builds(BodyTwist, *[st.floats(-0.3, 0.3)] * 3),
)
def test_a_locked_wheel_costs_the_heading_and_not_the_position(wheel, pose, twist):
    guard = supervisor()
    guard._compensate(0.0, Finding(wheel, WheelDefect.LOCKED))
    target = Pose(pose.x, pose.y, 1.0)
    shown = guard.check(0.0, NO_READINGS, estimate(pose), target).pose
    assert shown == target  # no error of heading to correct
    for _ in range(20):  # until it is as fast as it shall be
        got = guard.limit(Command(twist), DT).twist
        assert ROBOT.rim_jacobian[wheel] @ np.array(got) == pytest.approx(0.0, abs=1e-12)
    there, asked = move(pose, got, DT), move(shown, twist, DT)
    assert there[:2] == pytest.approx(asked[:2], abs=1e-9)


def test_a_second_locked_wheel_stops_it():
    guard = supervisor()
    guard._compensate(1.0, Finding(0, WheelDefect.LOCKED))
    guard._compensate(2.0, Finding(1, WheelDefect.LOCKED))
    assert guard.stopped.startswith("at 2.00 s wheel 1 is locked")


def test_who_is_stopped_brakes_within_what_the_wheels_can_push():
    guard, before = supervisor(), BodyTwist(1.5, -0.5, 1.0)
    guard.check(0.0, NO_READINGS, estimate(HERE), HERE)
    guard.limit(Command(before), DT)
    for k in range(1, 6):
        guard.check(k * DT, NO_READINGS, estimate(Pose(9.0, 0.0, 0.0)), HERE)
    assert "9.00 m from the reference" in guard.stopped
    asked = [before]
    while not guard.at_rest:
        asked.append(guard.limit(Command(BodyTwist(5.0, 5.0, 5.0)), DT).twist)
        assert len(asked) < 30
    assert len(asked) > 3
    assert np.abs(np.diff(asked, axis=0) @ ROBOT.acceleration_faces.T).max() <= DT
    assert [event.what.split(":")[0] for event in guard.events] == ["the watchdog stops the robot"]


def test_reset_forgets():
    guard = supervisor()
    guard._compensate(0.0, Finding(0, WheelDefect.DEAD))
    guard._compensate(0.0, Finding(1, WheelDefect.LOCKED))
    guard.reset(FeedforwardController(DT))
    command = Command(TWIST)
    assert guard.limit(command, DT) is command
    assert guard.events == []
