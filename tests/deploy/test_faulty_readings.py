"""Drives with faulty readings on the simulated clock: no error, no wild command, no robot goes on.

Each drive has its faults, their times and its estimator from its seed.
"""

import random
from math import inf, nan

import numpy as np
import pytest

from omnidrive.control import Pipeline, WheelSpeeds
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.command_gate import RAMP_TIME
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_loop import MAX_AGE, MAX_WAIT
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.log import read_log
from omnidrive.estimation import EstimatorSettings, LatestFix, PoseEstimator, SensorSettings
from omnidrive.geometry import BodyTwist, Pose
from tests.deploy.simulated_drive import (
    DT,
    ROBOT,
    START,
    Link,
    circle,
    controller,
    driven,
    link,
)
from tests.deploy.test_drive_faults import armed_at, fixes_with, frozen

DRIVES, LONG_DRIVES = 8, 1000
DURATION = 5.0  # s
WILD = (nan, inf, -inf, 1e300, -1e300, 1e12, -1e12, 1e3)
BEYOND = MAX_AGE + RAMP_TIME + 4.0 * DT
"""Time after the begin of a fault from which the robot stands, s."""


def lost_fixes(rng):
    """Return a fault without usable poses."""
    axis, wild = rng.choice(("x", "y", "yaw")), rng.choice(WILD[:5])
    return rng.choice(
        (
            lambda _: None,
            lambda readings: readings._replace(fixes=()),
            frozen(["stamp", "wheel_angles", "fixes"]),
            frozen(["fixes"]),
            fixes_with(**{axis: wild}),
            fixes_with(stamp=rng.choice((-5.0, 5.0, -0.7, 0.7, nan, inf, -inf, -1e300, 1e300))),
            lambda readings: readings._replace(stamp=rng.choice((nan, inf, 1e300, 9e9))),
            unknown_sigmas,
        )
    )


def unknown_sigmas(readings):
    """The fault of fixes that state no standard deviations."""
    return readings._replace(
        fixes=tuple(fix._replace(position_sigma=nan, yaw_sigma=nan) for fix in readings.fixes)
    )


def other_fault(rng):
    """Return a fault of which no more is required than commands within the limits."""
    wheels = len(ROBOT.mounts)

    def spoilt(values):
        """Return numbers of which some are wild."""
        return tuple(rng.choice(WILD) if rng.random() < 0.3 else v for v in values)

    def jumping(readings):
        by = [rng.choice((0.0, 0.01, 0.6, -3.0, 1e6)) for _ in range(3)]
        return readings._replace(
            fixes=tuple(
                fix._replace(pose=Pose(*(a + b for a, b in zip(fix.pose, by, strict=True))))
                for fix in readings.fixes
            )
        )

    def sigmas(readings):
        each = rng.choice((0.0, -1.0, inf, 1e300, 1e-300))
        return readings._replace(
            fixes=tuple(f._replace(position_sigma=each, yaw_sigma=each) for f in readings.fixes)
        )

    number = rng.choice((0, 1, wheels - 1, wheels + 1, 1000))
    return rng.choice(
        (
            frozen(["wheel_angles"]),
            frozen(["stamp"]),
            jumping,
            sigmas,
            lambda readings: readings._replace(wheel_angles=spoilt(readings.wheel_angles)),
            lambda readings: readings._replace(
                wheel_angles=tuple(rng.randrange(-99, 99) for _ in range(wheels))
            ),
            lambda readings: readings._replace(wheel_angles=(0.5,) * number),
            lambda readings: readings._replace(wheel_torques=spoilt((0.0,) * number)),
            lambda readings: readings._replace(yaw_rate=rng.choice(WILD)),
            lambda readings: readings._replace(fixes=readings.fixes * 50),
            lambda readings: readings if rng.random() < 0.5 else None,
        )
    )


def estimator(rng):
    if rng.random() < 0.4:
        return LatestFix()
    return PoseEstimator(ROBOT, SensorSettings(), EstimatorSettings(), slips=rng.random() < 0.5)


def faulty_drive(seed):
    """Return the result of a drive, its link, and begin and end of the fault of its poses, s."""
    rng = random.Random(seed)
    begin = rng.uniform(0.2, 2.5)
    end = begin + rng.choice((0.1, 0.6, 1.5, 2.5, inf))
    faults = [(begin, end, lost_fixes(rng))]
    for _ in range(rng.choice((0, 0, 1, 2))):
        since = rng.uniform(0.1, 3.0)
        faults.append((since, since + rng.choice((DT, 0.3, 1.0)), other_fault(rng)))
    if rng.random() < 0.4:
        begin = end = inf
        faults[0] = (0.5, rng.choice((1.5, inf)), other_fault(rng))
    made, controls = link(), DriveControls(arm=True)

    def spoil(made, readings):
        now = made._clock.now()
        for since, until, fault in faults:
            if readings is not None and since <= now < until:
                readings = fault(readings)
        return readings

    made.on_read.append(spoil)
    if end < inf:
        made.on_read.append(armed_at(max(end, *(until for _, until, _ in faults)) + 0.5, controls))
    estimates = estimator(rng)
    if faults[0][2] is unknown_sigmas and isinstance(estimates, LatestFix):
        begin = end = inf  # it returns the pose, of which it states no covariance
    result = drive(
        made,
        Pipeline(controller(), estimates),
        circle(DURATION),
        rate=1.0 / DT,
        start=START,
        controls=controls,
        clock=SimulatedClock(),
    )
    return result, made, begin, end


def check_drives(seeds):
    """Check drives; return how many robots a fault of their poses held."""
    held = 0
    for seed in seeds:
        result, made, begin, end = faulty_drive(seed)
        assert result.changes[-1].state is DriveState.STOPPED, seed
        for _, value in made.sent:
            assert np.isfinite(value).all(), (seed, value)
            speeds = value if isinstance(value, WheelSpeeds) else speeds_of(value)
            assert np.abs(speeds).max() <= ROBOT.max_wheel_speed * (1.0 + 1e-6), (seed, value)
        going_on = {v for t, v in made.sent if begin + BEYOND <= t < end} - {STOP}
        assert not going_on, (seed, begin, end, result.changes)
        held += any(change.state is DriveState.HOLDING for change in result.changes)
    return held


def speeds_of(value):
    return ROBOT.chassis.wheel_speeds(BodyTwist(*value))


def test_no_robot_goes_on_with_faulty_readings():
    assert 0 < check_drives(range(DRIVES)) < DRIVES


@pytest.mark.long
def test_no_robot_of_many_goes_on_with_faulty_readings():
    assert check_drives(range(LONG_DRIVES)) > LONG_DRIVES // 3


def sparse_fixes(rate=1.5):
    """Return a change of readings that leaves pose fixes at ``rate``, in Hz."""
    last = [-inf]

    def sparse(made, readings):
        if made._clock.now() - last[0] < 1.0 / rate:
            return readings._replace(fixes=())
        last[0] = made._clock.now()
        return readings

    return sparse


@pytest.mark.parametrize("armed", [True, False])
def test_a_drive_on_a_simulated_clock_ends_although_nobody_arms_it(armed):
    """Pose fixes at 1.5 Hz hold the robot; the drive ends with this reason."""
    made = link()
    made.on_read.append(sparse_fixes())
    result = driven(made, controls=DriveControls(arm=armed))
    ended = result.changes[-1]
    assert ended.state is DriveState.STOPPED
    assert ended.reason.startswith(
        "holding since 0.55 s, and not armed within 60 s: the last usable pose fix is 0.55 s old"
        if armed
        else "idle since 0.00 s, and not armed within 60 s: no user armed the robot"
    )
    assert MAX_WAIT < ended.t < MAX_WAIT + 2.0
    assert not result.finished


class OtherClock:
    """A clock that passes as the simulated one, but is none: a drive on it waits for its user."""

    def __init__(self):
        self.simulated = SimulatedClock()
        self.now, self.sleep_until = self.simulated.now, self.simulated.sleep_until


class OnAnyClock(Link):
    """A simulated link on both clocks."""

    def open(self, clock):
        Link.open(self, getattr(clock, "simulated", clock))


@pytest.mark.parametrize("clock", [SimulatedClock, OtherClock])
def test_a_drive_without_controls_ends_with_the_ramp_of_a_hold(clock, tmp_path):
    """Nobody can arm the robot again; the log is written, with the reason and its time."""
    made = OnAnyClock(link().simulated, START)
    made.on_read.append(sparse_fixes())
    result = driven(made, clock=clock(), log=tmp_path / "a.mcap")
    assert not result.finished
    held, stopped = result.changes[-2:]
    assert (held.state, stopped.state) == (DriveState.HOLDING, DriveState.STOPPED)
    assert stopped.reason.startswith(f"holding since {held.t:.2f} s, and not armed within 0.5 s: ")
    assert stopped.reason.endswith(held.reason)
    assert stopped.t - held.t == pytest.approx(RAMP_TIME + DT)
    assert read_log(tmp_path / "a.mcap").changes[-1] == stopped


def test_a_drive_without_controls_ends_if_no_pose_arrives():
    made = OnAnyClock(link().simulated, START)
    made.on_read.append(lambda made, readings: None)
    result = driven(made, clock=OtherClock())
    assert result.ending == "armed since 0.00 s, but no usable pose arrived within 60 s"


def test_a_user_can_arm_a_held_robot_after_any_time():
    """With controls, on a clock that is not simulated, a hold ends when the user arms or stops."""
    made, controls = OnAnyClock(link().simulated, START), DriveControls(arm=True)

    acts = [(1.0, controls.hold), (100.0, controls.arm)]

    def act(made, readings):
        if acts and made._clock.now() >= acts[0][0]:
            acts.pop(0)[1]()
        return readings

    made.on_read.append(act)
    result = driven(made, controls=controls, clock=OtherClock())
    assert result.finished
    assert result.changes[-1].t > 100.0
