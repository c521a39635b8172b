"""The real-time loop on simulated time: the same commands as a simulation, and every way to end."""

import os
from dataclasses import dataclass, field

import numpy as np
import pytest

from omnidrive import (
    FeedforwardController,
    KinematicPlant,
    PaperNoise,
    PerfectSensors,
    Pose,
    named_robot,
    simulate,
)
from omnidrive.control import Command, Pipeline, WheelSpeeds
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.command_gate import RAMP_TIME, CommandGate
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import MAX_AGE, drive
from omnidrive.deploy.drive_state import DriveState, StateMachine
from omnidrive.deploy.links.simulated import WATCHDOG, SimulatedLink, SimulatedRobot
from omnidrive.deploy.remaining_reference import RemainingReference
from omnidrive.deploy.robot_link import LinkLost, RobotLink
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.reference import RetimedReference

DT = 0.05
ROBOT = named_robot("small")
START = Pose(0.0, 0.0, 0.0)


def circle(duration=6.0):
    from omnidrive.components import configure
    from omnidrive.reference import ReferenceContext

    made = configure("references", "circle", {"radius": 0.5}).make(ReferenceContext(ROBOT, START))
    return RetimedReference(made, duration)


def controller():
    return FeedforwardController(DT)


@dataclass(slots=True)
class Link(SimulatedLink):
    """A simulated link whose calls tests can change; it keeps what was sent."""

    on_read: list = field(default_factory=list)
    on_send: list = field(default_factory=list)
    sent: list = field(default_factory=list)
    stops: int = 0
    closed: bool = False

    def read(self):
        readings = SimulatedLink.read(self)
        for change in self.on_read:
            readings = change(self, readings)
        return readings

    def send(self, value):
        for act in self.on_send:
            act(self, value)
        self.sent.append((self._clock.now(), value))
        SimulatedLink.send(self, value)

    def stop(self):
        self.stops += 1
        SimulatedLink.stop(self)

    def close(self):
        self.closed = True
        SimulatedLink.close(self)


def link(sensors=None):
    return Link(SimulatedRobot(ROBOT, KinematicPlant(ROBOT), sensors or PerfectSensors()), START)


def driven(made, reference=None, controls=None, ours=None):
    return drive(
        made,
        Pipeline(ours or controller()),
        reference or circle(),
        rate=1.0 / DT,
        start=START,
        controls=controls,
        clock=SimulatedClock(),
    )


def test_link_obeys_the_protocol():
    assert isinstance(link(), RobotLink)


@pytest.mark.parametrize("noisy", [False, True])
def test_commands_are_those_of_a_simulation(noisy):
    def sensors():
        return PaperNoise(np.random.default_rng(3)) if noisy else PerfectSensors()

    expected = simulate(
        KinematicPlant(ROBOT), controller(), circle(), start=START, dt=DT, sensors=sensors()
    )
    made = link(sensors())
    result = driven(made)
    assert result.finished
    assert result.ending == "the reference ends"
    np.testing.assert_allclose(result.run.command, expected.command, rtol=0.0, atol=1e-9)
    truth = np.array([state.pose for state in made.states])
    np.testing.assert_allclose(truth[: len(expected.t)], expected.pose, rtol=0.0, atol=1e-9)
    states = [change.state for change in result.changes]
    assert states == [DriveState.ARMED, DriveState.RUNNING, DriveState.STOPPED]
    assert made.closed
    assert made.sent[-1][1] != STOP
    assert made.stops >= 1


def silent(begin, end):
    """Return a fault: no readings, or readings without fixes, from ``begin`` to ``end`` (s)."""

    def change(made, readings):
        return None if begin <= made._clock.now() < end else readings

    return change


def without_fixes(begin, end):
    def change(made, readings):
        lost = begin <= made._clock.now() < end
        return readings._replace(fixes=()) if lost else readings

    return change


@pytest.mark.parametrize(
    ("fault", "reason"), [(silent, "no readings"), (without_fixes, "the last usable pose fix")]
)
def test_lost_readings_hold_the_robot_until_it_is_armed_again(fault, reason):
    made, controls = link(), DriveControls(arm=True)
    made.on_read.append(fault(2.0, 4.0))

    def arm(_made, readings):
        if made._clock.now() >= 6.0 and controls is not None and not armed:
            armed.append(made._clock.now())
            controls.arm()
        return readings

    armed: list[float] = []
    made.on_read.append(arm)
    result = driven(made, controls=controls)
    held = next(change for change in result.changes if change.state is DriveState.HOLDING)
    assert held.reason.startswith(reason)
    assert held.t == pytest.approx(2.0 + MAX_AGE, abs=2.1 * DT)
    at_rest = [value for t, value in made.sent if held.t + RAMP_TIME + DT < t < 6.0 - DT]
    assert at_rest
    assert set(at_rest) == {STOP}
    again = [change.t for change in result.changes if change.state is DriveState.RUNNING]
    assert len(again) == 2
    assert again[1] >= 6.0 - DT
    assert result.finished
    # it goes on along the path, and ends where the reference ends
    assert made.states[-1].pose == pytest.approx(tuple(circle().at(6.0).pose), abs=2e-2)
    assert np.diff(result.run.t).min() > 0.0


def test_ramp_to_rest_decreases_in_proportion():
    gate = CommandGate(ROBOT)
    gate.passed(BodyTwist(0.4, -0.2, 0.1))
    gate.hold()
    twists = [gate.ramp(0.1) for _ in range(6)]
    assert twists[0] == pytest.approx(BodyTwist(0.32, -0.16, 0.08))
    assert twists[4:] == [STOP, STOP]


def test_gate_passes_only_finite_commands_within_the_wheels():
    gate = CommandGate(ROBOT)
    assert gate.passed(BodyTwist(float("nan"), 0.0, 0.0)) is None
    assert gate.passed(WheelSpeeds([np.inf] * len(ROBOT.mounts))) is None
    fast = gate.passed(BodyTwist(100.0, 50.0, 0.0))
    assert fast is not None
    assert np.abs(ROBOT.chassis.wheel_speeds(fast)).max() == pytest.approx(ROBOT.max_wheel_speed)
    assert fast.vx == pytest.approx(2.0 * fast.vy)
    assert gate.limited == 1
    slow = BodyTwist(0.1, 0.0, 0.0)
    assert gate.passed(slow) is slow
    assert gate.limited == 1


class Failing(FeedforwardController):
    """A controller that fails at 1 s."""

    def step(self, t, state, reference):
        if t >= 1.0:
            return Command(BodyTwist(float("nan"), 0.0, 0.0))
        return super().step(t, state, reference)


def test_command_that_is_not_finite_stops_the_robot():
    made = link()
    result = driven(made, ours=Failing(DT))
    assert not result.finished
    assert "not finite" in result.ending
    assert result.changes[-1].t == pytest.approx(1.0)
    assert all(np.isfinite(value).all() for _, value in made.sent)
    assert made.closed


def lose(made, _value):
    if made._clock.now() >= 1.0:
        raise LinkLost("the cable is unplugged")


def break_down(made, _value):
    if made._clock.now() >= 1.0:
        raise RuntimeError("a defect of the link")


def test_lost_link_ends_the_drive():
    made = link()
    made.on_send.append(lose)
    result = driven(made)
    assert result.ending == "the link is lost: the cable is unplugged"
    assert made.stops >= 1
    assert made.closed


def test_exception_of_the_link_stops_the_robot_too():
    made = link()
    made.on_send.append(break_down)
    with pytest.raises(RuntimeError, match="defect"):
        driven(made)
    assert made.stops >= 1
    assert made.closed


def test_stop_button_on_a_file_descriptor():
    made, controls = link(), DriveControls(arm=True)
    button, finger = os.pipe()
    controls.watch(button, "the stop button is pressed")

    def press(_made, readings):
        if made._clock.now() >= 1.0:
            os.write(finger, b"x")
        return readings

    made.on_read.append(press)
    try:
        result = driven(made, controls=controls)
    finally:
        os.close(button)
        os.close(finger)
    assert result.ending == "the stop button is pressed"
    assert result.changes[-1].t == pytest.approx(1.0, abs=DT)


def test_unarmed_robot_gets_zero_speed_only():
    made, controls = link(), DriveControls()

    def give_up(_made, readings):
        if made._clock.now() >= 1.0:
            controls.stop("given up")
        return readings

    made.on_read.append(give_up)
    result = driven(made, controls=controls)
    assert [change.state for change in result.changes] == [DriveState.STOPPED]
    assert {value for _, value in made.sent} == {STOP}
    assert not result.finished


def test_late_sample_skips_those_that_are_over():
    made = link()

    def delay(_made, _value):
        if len(made.sent) == 10:
            made._clock.time += 2.5 * DT

    made.on_send.append(delay)
    result = driven(made)
    timing = result.timing.summary()
    assert (timing.misses, timing.skipped) == (1, 2)
    steps = np.diff(result.run.t)
    assert steps.max() == pytest.approx(3.0 * DT)
    assert np.sum(steps > 1.5 * DT) == 1
    assert result.finished


def test_remaining_reference_begins_at_rest_and_ends_alike():
    whole = circle()
    rest = RemainingReference(whole, 2.0)
    begin = rest.at(0.0)
    assert begin.pose == pytest.approx(whole.at(2.0).pose)
    assert begin.twist == pytest.approx((0.0, 0.0, 0.0))
    assert rest.at(rest.duration).pose == pytest.approx(whole.at(6.0).pose)
    h = 1e-5
    for t in (0.3, 0.7, 0.9999, 1.5, 3.0):
        rows = rest.window(t - h, 3, h)
        np.testing.assert_allclose((rows[2, :3] - rows[0, :3]) / (2 * h), rows[1, 3:], atol=1e-4)


def test_states_follow_their_order():
    machine = StateMachine()
    with pytest.raises(ValueError, match="idle is not followed by running"):
        machine.change(0.0, DriveState.RUNNING, "at once")
    machine.change(0.0, DriveState.STOPPED, "no")
    with pytest.raises(ValueError, match="stopped is not followed by"):
        machine.change(0.0, DriveState.ARMED, "again")


@pytest.mark.parametrize(
    ("change", "message"),
    [({"rate": 2000.0}, "rate"), ({"rate": 10.0}, "sample time of 0.05 s")],
)
def test_bad_input(change, message):
    with pytest.raises(InvalidInput, match=message):
        drive(link(), Pipeline(controller()), circle(), clock=SimulatedClock(), **change)


def test_watchdog_is_shorter_than_a_second():
    assert WATCHDOG <= 1.0
