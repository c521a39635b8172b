"""The real-time loop on simulated time: the same commands as a simulation, and every way to end."""

import os

import numpy as np
import pytest

from omnidrive import (
    FeedforwardController,
    KinematicPlant,
    PaperNoise,
    PerfectSensors,
    simulate,
)
from omnidrive.control import Command, Pipeline, WheelSpeeds
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.command_gate import CommandGate
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_state import DriveState, StateMachine
from omnidrive.deploy.links.simulated import WATCHDOG
from omnidrive.deploy.remaining_reference import RemainingReference
from omnidrive.deploy.robot_link import LinkLost, RobotLink
from omnidrive.errors import InvalidInput
from omnidrive.estimation import EncoderSettings, PoseEstimator, SensorSettings
from omnidrive.geometry import BodyTwist
from omnidrive.reference.reference import WindowReference
from omnidrive.simulation import SensorSuite
from tests.deploy.simulated_drive import DT, ROBOT, START, circle, controller, driven, link


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


def test_commands_with_quantized_encoders_are_those_of_a_simulation():
    """One more count is a tenth of a millimetre: rounding errors in times would show."""
    settings = SensorSettings(encoders=EncoderSettings(counts_per_turn=4096))

    def parts():
        sensors = SensorSuite(settings, ROBOT.chassis, np.random.default_rng(5))
        return sensors, Pipeline(controller(), PoseEstimator(ROBOT, settings))

    sensors, pipeline = parts()
    expected = simulate(
        KinematicPlant(ROBOT), pipeline, circle(), start=START, dt=DT, sensors=sensors
    )
    sensors, pipeline = parts()
    made = link(sensors)
    result = drive(made, pipeline, circle(), rate=1.0 / DT, start=START, clock=SimulatedClock())
    np.testing.assert_array_equal(result.run.command[:-1], expected.command[:-1])
    truth = np.array([state.pose for state in made.states])
    np.testing.assert_array_equal(truth[: len(expected.t)], expected.pose)


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


def test_loop_that_wakes_late_processes_the_last_sample_that_is_due():
    made = link()

    class Late(SimulatedClock):
        def sleep_until(self, t):
            SimulatedClock.sleep_until(self, t + (2.5 * DT if len(made.sent) == 10 else 0.0))

    result = driven(made, clock=Late())
    timing = result.timing.summary()
    assert (timing.misses, timing.skipped) == (1, 2)
    assert timing.jitter_max == pytest.approx(2.5 * DT)
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


def test_remaining_reference_reads_the_reference_singly_only_while_it_eases():
    """The whole rest is read when a robot is armed again, between two samples."""
    whole, calls = circle(), []

    class Counted(WindowReference):
        duration = whole.duration

        def window(self, t, n, dt):
            calls.append(n)
            return whole.window(t, n, dt)

    rows = RemainingReference(Counted(), 2.0).window(0.0, 200, 0.02)
    assert sorted(calls) == [1] * 50 + [150]
    rest = RemainingReference(whole, 2.0)
    singly = [rest.window(0.02 * k, 1, 0.0)[0] for k in range(200)]
    np.testing.assert_allclose(rows, singly, rtol=0.0, atol=1e-12)


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
