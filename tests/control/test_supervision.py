"""Watchdog, wheel monitor, and the supervisor's reactions to failed wheels."""

from dataclasses import replace
from math import isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.control import Command, FeedforwardController, WheelSpeeds
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


def fast_findings(dead=None):
    """Return findings at 500 Hz, with angles that are up to two counts wrong.

    So are those of a loop that extrapolates readings to its samples. The torques change sign.
    """
    robot, dt, rng = named_robot("small"), 0.002, np.random.default_rng(1)
    monitor, angles, found = WheelMonitor(robot), np.zeros(4), []
    for k in range(1500):
        slip = 0.2 * robot.max_torque / robot.servo_gain * np.sin(dt * k + np.arange(4))
        torques = robot.servo_gain * slip
        if dead is not None:
            torques[dead] = 0.0
        angles = angles + (robot.chassis.wheel_speeds(TWIST) - slip) * dt
        read = angles + DEFAULT.step * rng.uniform(-2.0, 2.0, 4)
        found += monitor.update(TWIST, dt, tuple(read.tolist()), tuple(torques.tolist()))
    return found


def test_readings_that_do_not_arrive_with_the_samples_are_no_defect():
    assert fast_findings() == []
    assert fast_findings(dead=2) == [Finding(2, WheelDefect.DEAD)]


def test_idle_wheels_are_not_reported():
    bench = Bench()
    assert [bench.sample(BodyTwist(0.0, 0.0, 0.0), 0.0 * SLIP, w0=bench.dead)] * 20 == [[]] * 20


def test_nothing_is_reported_without_readings():
    assert WheelMonitor(ROBOT).update(TWIST, DT, (), ()) == []


class Servos:
    """Velocity servos with a lag, a gain and a delay that the monitor may not know."""

    def __init__(self, robot, *, lag=0.0, gain=1.0, delay=0):
        self.robot, self.monitor = robot, WheelMonitor(robot, FINE)
        self.decay = np.exp(-DT / 100 / lag) if lag > 0.0 else 0.0
        self.gain, self.late = gain, [BodyTwist(0.0, 0.0, 0.0)] * delay
        self.set_points, self.angles = np.zeros(4), np.zeros(4)

    def sample(self, twist, load=0.1, dead=None):
        """Return the findings of a sample with the same load on all wheels.

        Args:
            twist: Commanded body twist.
            load: Speed by which the wheels are slower than their set points, rad/s.
            dead: Index of a wheel without torque; None: all are healthy.
        """
        self.late.append(twist)
        target = self.gain * self.robot.chassis.wheel_speeds(self.late.pop(0))
        torques = np.full(4, self.robot.servo_gain * load)
        if dead is not None:
            torques[dead] = 0.0
        for _ in range(100):
            self.set_points = target + self.decay * (self.set_points - target)
            self.angles += (self.set_points - load) * DT / 100
        return self.monitor.update(twist, DT, tuple(self.angles), tuple(torques))


def curve(k):
    """Return the twist of sample k of a drive along a wavy line."""
    phase = 0.15 * k
    return BodyTwist(0.5 * np.sin(phase), 0.4 * np.cos(phase), 0.3 * np.sin(0.5 * phase))


@pytest.mark.parametrize("known", [0.0, 0.05])
@pytest.mark.parametrize("lag", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("load", [0.0, 1e-4])
def test_slow_motors_are_not_reported_as_dead(known, lag, load):
    """All wheels lag alike: the monitor identifies the lag."""
    servos = Servos(replace(ROBOT, motor_lag=known), lag=lag)
    for k in range(80):
        assert servos.sample(curve(k), load) == []
    assert servos.monitor.lag == pytest.approx(lag, abs=0.03)


@pytest.mark.parametrize("wrong", [{"gain": 0.9}, {"gain": 1.1}, {"delay": 1}, {"delay": 3}])
def test_wrong_models_of_all_wheels_are_no_defects(wrong):
    servos = Servos(ROBOT, **wrong)
    for k in range(80):
        assert servos.sample(curve(k), 1e-4) == []


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.2])
def test_dead_motor_of_a_slow_drive_is_reported(lag):
    """A wheel unlike the others has a defect; that the monitor does not know the lag costs time."""
    servos, found = Servos(ROBOT, lag=lag), []
    for k in range(40):
        assert servos.sample(curve(k)) == []
    for k in range(40, 43 if lag == 0.0 else 60):
        found += servos.sample(curve(k), dead=2)
    assert found == [Finding(2, WheelDefect.DEAD)]


def drive_with_standing_wheel(speeds, torques):
    """Return the findings of samples whose wheel 0 stands; the others follow their set points.

    Args:
        speeds: Commanded speed of wheel 0 in each sample, rad/s.
        torques: Torque of its motor, N m.
    """
    monitor, angles, found = WheelMonitor(ROBOT), np.zeros(4), []
    for speed, torque in zip(speeds, torques, strict=True):
        commanded = np.array([speed, 8.0, -8.0, 8.0])
        angles = angles + commanded * DT * [0.0, 1.0, 1.0, 1.0]
        measured = (torque, 0.0, 0.0, 0.0)
        found += monitor.update(WheelSpeeds(commanded), DT, tuple(angles), measured)
    return found


def test_wheel_that_stands_on_a_slope_is_not_locked():
    """The load equals the torque of the servo, which friction transmits."""
    speed = 0.6 * ROBOT.force_limits[0] * ROBOT.wheel.radius / ROBOT.servo_gain
    speeds = speed + 0.01 * np.sin(np.arange(60))
    assert drive_with_standing_wheel(speeds, [ROBOT.servo_gain * speed] * 60) == []


def test_wheel_that_stands_while_its_set_point_changes_is_locked():
    """Its torque changes with the set point, and is below that which friction transmits."""
    speeds = np.linspace(0.0, 0.6, 20) * ROBOT.force_limits[0] * ROBOT.wheel.radius
    speeds /= ROBOT.servo_gain
    found = drive_with_standing_wheel(speeds, ROBOT.servo_gain * speeds)
    assert found == [Finding(0, WheelDefect.LOCKED)]


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
