"""Faults of a simulated robot on simulated time: it is held, says why, and waits until armed."""

import logging
from dataclasses import dataclass
from math import inf, nan, pi

import numpy as np
import pytest

from omnidrive import Pose
from omnidrive.control import Pipeline
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.command_gate import RAMP_TIME
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_loop import MAX_AGE
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.latest_readings import MAX_AHEAD
from omnidrive.estimation import LatestFix
from tests.deploy.simulated_drive import DT, START, circle, controller, driven, link

BEGIN, END, ARMED, DURATION = 1.0, 2.0, 2.6, 3.0  # s


def fixes_with(**change):
    """Return a fault: fixes whose pose or stamp is changed; numbers are added."""

    def spoil(readings):
        def spoilt(fix):
            stamp = fix.stamp + change.get("stamp", 0.0)
            moved = [a + change.get(n, 0.0) for n, a in fix.pose._asdict().items()]
            return fix._replace(stamp=stamp, pose=Pose(*moved))

        return readings._replace(fixes=tuple(map(spoilt, readings.fixes)))

    return spoil


def frozen(keep):
    """Return a fault: the first readings with it come again and again, with the stamps of then."""
    first = []

    def repeat(readings):
        first.append(readings)
        return readings._replace(**{name: getattr(first[0], name) for name in keep})

    return repeat


OLD = "the last usable pose fix is"
FAULTS = {
    "silent": (lambda: lambda _: None, "no readings for"),
    "frozen": (lambda: frozen(["stamp", "wheel_angles", "fixes"]), "no readings for"),
    "without fixes": (lambda: lambda readings: readings._replace(fixes=()), OLD),
    "repeated fixes": (lambda: frozen(["fixes"]), OLD),
    "NaN": (lambda: fixes_with(x=nan), OLD),
    "infinite": (lambda: fixes_with(yaw=inf), OLD),
    "huge": (lambda: fixes_with(y=1e300), OLD),
    "old stamps": (lambda: fixes_with(stamp=-5.0), OLD),
    "future stamps": (lambda: fixes_with(stamp=5.0), OLD),
    "NaN stamps": (lambda: fixes_with(stamp=nan), OLD),
    "jump": (lambda: fixes_with(x=2.0), "the pose jumps by"),
    "turn": (lambda: fixes_with(yaw=pi / 2), "the pose jumps by 0."),
}


def armed_at(time, controls):
    """Return a change of readings that arms the robot once."""
    armed = []

    def arm(made, readings):
        if made._clock.now() >= time and not armed:
            armed.append(True)
            controls.arm()
        return readings

    return arm


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_holds_the_robot_until_it_is_armed_again(name):
    make, reason = FAULTS[name]
    spoil = make()
    made, controls = link(), DriveControls(arm=True)
    made.on_read.append(lambda made, r: spoil(r) if BEGIN <= made._clock.now() < END else r)
    made.on_read.append(armed_at(ARMED, controls))
    result = driven(made, circle(DURATION), controls)
    held = next(change for change in result.changes if change.state is DriveState.HOLDING)
    assert held.reason.startswith(reason)
    sudden = reason.startswith("the pose jumps")
    assert held.t == pytest.approx(BEGIN if sudden else BEGIN + MAX_AGE, abs=2.1 * DT)
    at_rest = [value for t, value in made.sent if held.t + RAMP_TIME + DT < t < ARMED - DT]
    assert at_rest
    assert set(at_rest) == {STOP}
    again = [change.t for change in result.changes if change.state is DriveState.RUNNING]
    assert len(again) == 2
    assert again[1] >= ARMED - DT
    assert all(np.isfinite(value).all() for _, value in made.sent)
    # it goes on along the path, and ends where the reference ends
    assert result.finished
    assert made.states[-1].pose == pytest.approx(
        tuple(circle(DURATION).at(DURATION).pose), abs=2e-2
    )
    assert np.diff(result.run.t).min() > 0.0


@pytest.mark.parametrize("name", [name for name in FAULTS if name != "turn"])
def test_a_fault_at_the_start_lets_the_robot_wait(name):
    """It waits, or is held after 0.5 s, and nothing is raised."""
    spoil = FAULTS[name][0]()
    made, controls = link(), DriveControls(arm=True)
    made.on_read.append(lambda made, r: spoil(r) if made._clock.now() < END else r)
    made.on_read.append(armed_at(ARMED, controls))
    result = driven(made, circle(DURATION), controls, start=None)
    assert result.finished, result.changes
    rest = MAX_AGE + RAMP_TIME + 3.0 * DT
    moving = {value for t, value in made.sent if rest < t < END and value != STOP}
    assert name == "jump" or not moving  # a pose that is wrong from the start is no jump


def test_a_start_beside_the_measured_pose_holds_the_robot():
    result = driven(limited(link(), 1.0), start=Pose(0.0, 3.0, 0.0))
    held = result.changes[2]
    assert held.state is DriveState.HOLDING
    assert held.reason.startswith("the pose jumps by 3.00 m")


def limited(made, end):
    """Return the link, which is unplugged at ``end`` (s)."""
    from omnidrive.deploy.robot_link import LinkLost

    def unplug(made, _value):
        if made._clock.now() >= end:
            raise LinkLost("unplugged")

    made.on_send.append(unplug)
    return made


def test_nothing_moves_before_readings_arrive():
    made = limited(link(), 2.0)
    made.on_read.append(lambda *_: None)
    result = driven(made)
    assert {value for _, value in made.sent} == {STOP}
    assert [change.state for change in result.changes] == [DriveState.ARMED, DriveState.STOPPED]


def test_stamps_a_little_in_the_future_are_used():
    made = link()
    late = 0.9 * MAX_AHEAD
    made.on_read.append(lambda _, readings: fixes_with(stamp=late)(readings))
    assert driven(made, circle(DURATION)).finished


def test_a_process_that_was_stopped_holds_the_robot():
    """After SIGSTOP and SIGCONT the path goes on where the robot is, when it is armed."""
    made, controls = link(), DriveControls(arm=True)

    def sleep(made, _value):
        if len(made.sent) == 20:
            made._clock.time += 3.0

    made.on_send.append(sleep)
    made.on_read.append(armed_at(ARMED + 3.0, controls))
    result = driven(made, circle(DURATION), controls)
    held = next(change for change in result.changes if change.state is DriveState.HOLDING)
    assert held.reason == ("no command for 3.05 s, more than 0.5 s: the sample before took 3.00 s")
    assert {v for t, v in made.sent if held.t <= t + 1e-9 < ARMED + 3.0 - DT} == {STOP}
    assert result.finished
    steps = np.hypot(*np.diff(result.run.target[:, :2], axis=0).T)
    assert steps.max() < 0.15


def test_a_link_that_knows_the_cause_is_quoted():
    @dataclass(slots=True)
    class Explaining(type(link())):
        fault: str = "the cable is loose"

    made = Explaining(link().simulated, link().start)
    made.on_read.append(lambda made, r: None if made._clock.now() >= 1.0 else r)
    controls = DriveControls(arm=True)

    def end(made, readings):
        if made._clock.now() >= 3.0:
            controls.stop()
        return readings

    made.on_read.append(end)
    result = driven(made, circle(DURATION), controls)
    assert result.changes[2].reason.endswith("more than 0.5 s: the cable is loose")


def test_fixes_that_the_estimator_refuses_are_named():
    class Refusing(LatestFix):
        def update(self, readings):
            state = super().update(readings)
            return state._replace(fix_age=max(state.fix_age, state.stamp - BEGIN))

    made = limited(link(), 2.0)
    result = drive(
        made,
        Pipeline(controller(), Refusing()),
        circle(),
        rate=1.0 / DT,
        start=START,
        clock=SimulatedClock(),
    )
    held = result.changes[2]
    assert held.state is DriveState.HOLDING
    assert held.reason.startswith(OLD)
    assert held.reason.endswith(": newer ones arrive, but the estimator does not use them")


def test_without_newer_fixes_the_estimator_is_not_blamed():
    made = limited(link(), 2.0)
    made.on_read.append(lambda made, r: r if made._clock.now() < BEGIN else r._replace(fixes=()))
    held = driven(made).changes[2]
    assert held.reason.endswith("more than 0.5 s")


def test_zero_speed_is_sent_before_a_hold_is_noted():
    """A handler of the log may wait for a terminal."""
    made, controls, sent = link(), DriveControls(arm=True), []
    made.on_read.append(lambda made, r: None if BEGIN <= made._clock.now() < END else r)
    made.on_read.append(armed_at(ARMED, controls))
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda _: sent.append(made.sent[-1])
    logging.getLogger("omnidrive").addHandler(handler)
    try:
        result = driven(made, circle(DURATION), controls)
    finally:
        logging.getLogger("omnidrive").removeHandler(handler)
    (held,) = [each for each in result.changes if each.state is DriveState.HOLDING]
    assert sent == [(pytest.approx(held.t), STOP)]
