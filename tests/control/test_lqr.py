"""LQR: gains against closed form and another library, decay, frame of the errors, wheel limit."""

from math import pi, sqrt

import control
import numpy as np
import pytest

from omnidrive.control.laws.lqr import LqrController, LqrTolerances, error_model, lqr_gain
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.reference import Hold
from omnidrive.robot import named_robot

CHASSIS = named_robot("small").chassis
DT = 0.05


@pytest.mark.parametrize("dt", [0.01, 0.05, 0.1, 1.0])
def test_gain_without_lag_is_the_closed_form(dt):
    """An integrator: ``(k dt)^2 / (1 - k dt) = (dt correction / error)^2``."""
    ratio = (dt * 0.1 / 0.02) ** 2
    expected = 0.5 * (sqrt(ratio**2 + 4.0 * ratio) - ratio) / dt
    assert lqr_gain(0.0, dt, 0.02, 0.1) == pytest.approx([expected, 0.0], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("lag", [0.006, 0.05, 0.5])
def test_gain_with_lag_is_that_of_another_library(lag):
    expected, _, _ = control.dlqr(*error_model(lag, DT), np.diag([0.02**-2, 0.0]), [[0.1**-2]])
    assert lqr_gain(lag, DT, 0.02, 0.1) == pytest.approx(expected[0], rel=1e-9)


@pytest.mark.parametrize("lag", [0.0, 0.05, 0.2])
def test_errors_decay_with_the_eigenvalues_of_the_closed_loop(lag):
    """On a robot whose velocity follows its commands with that lag, and which starts at rest."""
    law = LqrController(DT, CHASSIS, (lag, lag))
    a, b = error_model(lag, DT)
    loop = a - b @ lqr_gain(lag, DT, 0.02, 0.1)[np.newaxis]
    z, hold = np.array([0.02, 0.0]), Hold(Pose(1.0, 0.0, 0.0), 9.0)
    law.reset(State(0.0, Pose(1.0 + z[0], 0.0, 0.0)))
    for k in range(30):
        expected = np.linalg.matrix_power(loop, k) @ [0.02, 0.0]
        assert z == pytest.approx(expected, abs=1e-12)
        twist = law.step(k * DT, State(k * DT, Pose(1.0 + z[0], 0.0, 0.0)), hold).twist
        z = a @ z + b[:, 0] * twist.vx
    slowest = np.abs(np.linalg.eigvals(loop)).max()
    assert slowest < 1.0
    assert np.linalg.norm(z) < 2.0 * slowest**30 * 0.02 / DT


@pytest.mark.parametrize("yaw", [0.0, pi / 2, 2.0])
def test_gains_turn_with_the_robot(yaw):
    """The error along x of B decays at its own rate, whatever the heading."""
    tolerances = LqrTolerances(x=0.01, y=0.04)
    law = LqrController(DT, CHASSIS, (0.0, 0.0), tolerances)
    goal = Pose(0.3, -0.2, yaw)
    beside = move(goal, BodyTwist(0.01, 0.02, 0.0), 1.0)
    law.reset(State(0.0, beside))
    twist = law.step(0.0, State(0.0, beside), Hold(goal, 1.0)).twist
    along = lqr_gain(0.0, DT, 0.01, 0.1)[0] * 0.01
    across = lqr_gain(0.0, DT, 0.04, 0.1)[0] * 0.02
    assert twist == pytest.approx((-along, -across, 0.0), abs=1e-12)


def test_command_and_predicted_motion_are_within_the_wheel_limit():
    """From 5 m the wheels are at their limit, and the direction is that to the goal."""
    law = LqrController(DT, CHASSIS, (0.05, 0.05))
    start = State(0.0, Pose(3.0, 4.0, 0.0))
    law.reset(start)
    hold = Hold(Pose(0.0, 0.0, 0.0), 9.0)
    first = law.step(0.0, start, hold).twist
    speeds = CHASSIS.wheel_speeds(first)
    assert np.abs(speeds).max() == pytest.approx(CHASSIS.max_wheel_speed)
    assert first.vy / first.vx == pytest.approx(4.0 / 3.0)
    gain = lqr_gain(0.05, DT, 0.02, 0.1)
    _, b = error_model(0.05, DT)
    at_goal = law.step(DT, State(DT, Pose(0.0, 0.0, 0.0)), hold).twist
    assert at_goal.vx == pytest.approx(-gain[1] * b[1, 0] * first.vx)
