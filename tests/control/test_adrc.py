"""ADRC: poles of the observer, rejection of disturbances, decay, wheel limit."""

from math import exp

import numpy as np
import pytest

from omnidrive.control import FeedforwardController, FeedforwardGains
from omnidrive.control.laws.adrc import AdrcController, AdrcParameters, observer_gains
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.testing.laws import Circle

CHASSIS = named_robot("small").chassis
DT = 0.1


def closed_loop(law, reference, start, samples, disturbance):
    """Distances to the reference, and last command, of a robot that executes command + disturbance.

    Commands are scaled down to the limits of the wheels.
    """
    pose, errors = start, []
    law.reset(State(0.0, start))
    for k in range(samples):
        target = reference.at(k * DT).pose
        errors.append(np.hypot(pose.x - target.x, pose.y - target.y))
        command = law.step(k * DT, State(k * DT, pose), reference)
        twist = CHASSIS.saturate(command.twist)
        executed = BodyTwist(*(a + b for a, b in zip(twist, disturbance, strict=True)))
        pose = move(pose, executed, DT)
    return np.array(errors), command


@pytest.mark.parametrize("bandwidth", [0.5, 6.0, 50.0])
def test_both_poles_of_the_observer_are_at_its_bandwidth(bandwidth):
    """Of the error of pose and disturbance after the correction: (I - L C) A."""
    gains = np.array(observer_gains(bandwidth, DT))
    model, output = np.array([[1.0, DT], [0.0, 1.0]]), np.array([1.0, 0.0])
    errors = (np.eye(2) - np.outer(gains, output)) @ model
    pole = exp(-bandwidth * DT)
    assert np.trace(errors) == pytest.approx(2.0 * pole)
    assert np.linalg.det(errors) == pytest.approx(pole**2)


def test_constant_disturbance_is_rejected_to_zero_error_on_a_circle():
    """Of the commanded twist, in B; proportional feedback keeps an error of disturbance / gain."""
    push, circle = BodyTwist(0.1, -0.05, 0.2), Circle(0.3, 20.0)
    start = circle.at(0.0).pose
    errors, command = closed_loop(AdrcController(DT, CHASSIS), circle, start, 150, push)
    assert errors.max() > 0.01
    assert errors[-20:].max() < 1e-9
    assert command.details == pytest.approx(push, abs=1e-9)
    proportional = FeedforwardController(DT, FeedforwardGains(4.0, 4.0))
    errors, _ = closed_loop(proportional, circle, start, 150, push)
    assert errors[-20:].min() > 0.015


def test_error_decays_at_the_bandwidth_of_the_controller():
    rest, hold = BodyTwist(0.0, 0.0, 0.0), Hold(Pose(0.0, 0.0, 0.0), 9.0)
    law = AdrcController(DT, CHASSIS, AdrcParameters(control=3.0))
    errors, command = closed_loop(law, hold, Pose(0.06, 0.08, 0.0), 20, rest)
    assert errors == pytest.approx(0.1 * np.exp(-3.0 * DT * np.arange(20)))
    assert command.details == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_limit_of_the_wheels_is_no_disturbance():
    """From 5 m: the observer predicts by the command that is executed, and nothing winds up."""
    rest, hold = BodyTwist(0.0, 0.0, 0.0), Hold(Pose(0.0, 0.0, 0.0), 9.0)
    law = AdrcController(DT, CHASSIS)
    errors, command = closed_loop(law, hold, Pose(3.0, 4.0, 0.0), 60, rest)
    steps = -np.diff(errors)
    assert steps[0] < 0.5 * (1.0 - exp(-4.0 * DT)) * 5.0  # limited
    assert (steps > 0.0).all()  # without overshoot
    assert errors[-1] < 1e-3
    assert command.details == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_disturbance_beyond_the_bound_leaves_the_error_of_its_rest():
    """Of 0.3 m/s, 0.2 m/s are rejected; 0.01 m in a sample remain."""
    push, hold = BodyTwist(0.3, 0.0, 0.0), Hold(Pose(0.0, 0.0, 0.0), 9.0)
    law = AdrcController(DT, CHASSIS, AdrcParameters(control=4.0, observer=6.0, max_speed=0.2))
    errors, command = closed_loop(law, hold, Pose(0.0, 0.0, 0.0), 100, push)
    left, missed = exp(-4.0 * DT), exp(-2.0 * 6.0 * DT)  # of the error; of the innovation
    assert errors[-1] == pytest.approx(0.01 / (1.0 - left) + 0.01 * missed / (1.0 - missed))
    assert command.details == pytest.approx((0.2, 0.0, 0.0))
