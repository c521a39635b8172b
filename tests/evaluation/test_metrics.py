"""Metrics of logs with values computed by hand."""

from math import nan, pi

import numpy as np
import pytest

from omnidrive.evaluation import Metrics, measure
from omnidrive.robot import named_robot
from omnidrive.simulation import Outcome, Run


def log(pose, target, measured=None, command=None, wheel_speed_command=None):
    n = len(pose)
    zeros = np.zeros((n, 3))
    return Run(
        t=0.5 * np.arange(n),
        pose=np.asarray(pose, float),
        measured=np.asarray(pose if measured is None else measured, float),
        target=np.asarray(target, float),
        command=zeros if command is None else np.asarray(command, float),
        twist=zeros,
        wheel_speed=np.zeros((n, 4)),
        wheel_torque=np.zeros((n, 4)),
        saturated=np.zeros(n, np.int64),
        wheel_speed_command=np.zeros((n, 0))
        if wheel_speed_command is None
        else wheel_speed_command,
        wheel_torque_command=np.zeros((n, 0)),
        work=np.linspace(0.0, 7.0, n),
        step_time=np.append(np.arange(1.0, n), np.nan),
        position_sigma=np.zeros(n),
        yaw_sigma=np.zeros(n),
        status=np.zeros(n, np.int64),
        collisions=np.zeros(n, np.int64),
        outcome=Outcome.FINISHED,
    )


def metrics(*args, **kwargs):
    return measure(log(*args, **kwargs), named_robot("paper").chassis)


def test_mean_and_largest_errors():
    target = np.zeros((6, 3))
    pose = [(3, 4, 0)] * 2 + [(0, 1, 0.2)] * 4
    m = metrics(pose, target)
    assert m.me == pytest.approx((2 * 5 + 4 * 1) / 6)
    assert m.max_error == 5.0
    assert m.mae == pytest.approx(4 * 0.2 / 6)
    assert m.me_after_start == pytest.approx(1.0)  # rows from 2 s on
    assert m.mae_after_start == pytest.approx(0.2)
    assert m.work == 7.0


def test_heading_error_is_wrapped():
    m = metrics([(0, 0, pi - 0.1)] * 3, [(0, 0, -pi + 0.1)] * 3)
    assert m.mae == pytest.approx(0.2)
    assert metrics([(0, 0, 6 * pi)] * 3, [(0, 0, 0)] * 3).mae == pytest.approx(0.0, abs=1e-12)


def test_measured_and_true_errors_differ():
    m = metrics(np.zeros((3, 3)), np.zeros((3, 3)), measured=[(0.3, 0.4, 0.1)] * 3)
    assert (m.me, m.mae) == (0.0, 0.0)
    assert (m.me_measured, m.mae_measured) == pytest.approx((0.5, 0.1))


def test_effort_is_the_mean_change_of_wheel_speed():
    """Rotation at 1 rad/s, on and off: each wheel speed changes by distance / radius."""
    robot = named_robot("paper")
    command = [(0, 0, 1), (0, 0, 0), (0, 0, 1), (0, 0, 1)]
    m = metrics(np.zeros((4, 3)), np.zeros((4, 3)), command=command)
    change = robot.effective_radius / robot.wheel.radius
    assert m.wheel_acceleration == pytest.approx(3 * change / 1.5)


def test_step_times_exclude_the_last_row():
    m = metrics(np.zeros((5, 3)), np.zeros((5, 3)))
    assert m.step_time_median == 2.5


def test_effort_of_commanded_wheel_speeds_equals_that_of_their_twists():
    robot = named_robot("paper")
    twists = np.array([(0.1, 0.0, 1.0), (0.0, 0.2, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)])
    unknown, still = np.full((4, 3), np.nan), np.zeros((4, 3))
    speeds = twists @ robot.chassis.jacobian.T
    by_twists = metrics(still, still, command=twists)
    by_wheels = metrics(still, still, command=unknown, wheel_speed_command=speeds)
    assert by_wheels.wheel_acceleration == pytest.approx(by_twists.wheel_acceleration)
    assert np.isnan(metrics(still, still, command=unknown).wheel_acceleration)


def test_text_has_units_and_three_significant_digits():
    values = dict.fromkeys(Metrics._fields, 0.0) | {
        "me": 0.002067507303762554, "mae": 0.0008110846442733601, "work": nan, "fallbacks": 3,
        "step_time_median": 394.235, "arrival": 3.7, "max_error": 5e-8,
    }  # fmt: skip
    metrics = Metrics(**values)
    lines = [" ".join(line.split()) for line in str(metrics).splitlines()]
    assert len(lines) == len(Metrics._fields)
    for line in ("ME 2.07 mm", "MAE 0.811 mrad", "max. error < 0.001 mm", "work –",
                 "step time 394 µs", "arrival 3.70 s", "fallbacks 3"):  # fmt: skip
        assert line in lines, lines
    assert repr(metrics).startswith("Metrics(me=0.002067507303762554, ")
