"""Errors with respect to the path of a reference: late, off the path, at crossings and stops."""

from dataclasses import replace
from math import isnan, nan, pi

import numpy as np
import pytest

from omnidrive.evaluation import measure, path_errors
from omnidrive.evaluation.measures.path_error import arrival
from omnidrive.geometry import Pose
from omnidrive.reference import Eight, ShapeReference, delay_within_limits, limit_rows
from omnidrive.reference.timing.limits import MotionLimits
from omnidrive.robot import named_robot
from tests.evaluation.test_metrics import log

DT = 0.1


def run_of(pose, target):
    """Return a log with these poses; the sample time is that of the other tests of metrics."""
    run = log(pose, target)
    return replace(run, t=DT * np.arange(len(run.t)))


def poses(reference, times):
    return np.array([reference.at(float(t)).pose for t in times])


def eight(duration=10.0, more=0.0):
    times = np.arange(0.0, duration + more + 1e-9, DT)
    reference = ShapeReference(Eight(), duration)
    return reference, times, poses(reference, times)


def test_robot_that_is_late_is_on_the_path():
    reference, times, target = eight(more=1.5)
    run = run_of(poses(reference, times - 0.7), target)
    errors = path_errors(run)
    assert errors.position.max() < 1e-3
    assert errors.heading.max() < 5e-3
    moving = (times > 3.0) & (times < 9.0)
    assert errors.delay[moving] == pytest.approx(0.7, abs=0.02)
    assert measure(run, named_robot("small").chassis).me > 0.3  # to the moving point


def test_distance_across_and_heading():
    _, _, target = eight()
    aside = target + 0.03 * np.column_stack(
        [-np.sin(target[:, 2]), np.cos(target[:, 2]), np.zeros(len(target))]
    )
    aside[:, 2] += 0.1 + 2.0 * pi
    errors = path_errors(run_of(aside, target))
    assert errors.position[5:-5] == pytest.approx(0.03, abs=1e-3)
    assert errors.heading[5:-5] == pytest.approx(0.1, abs=0.02)


def test_crossing_is_passed_on_the_robots_own_branch():
    """The eight passes its crossing in other directions at 0, 5 and 10 s."""
    reference, times, target = eight()
    errors = path_errors(run_of(poses(reference, times - 0.3), target))
    assert errors.delay[(times > 4.0) & (times < 6.0)] == pytest.approx(0.3, abs=0.03)


def test_standing_reference_is_not_left_behind():
    x = np.concatenate([np.linspace(0.0, 1.0, 20), np.ones(60), np.linspace(1.0, 2.0, 20)])
    target = np.column_stack([x, 0.0 * x, 0.0 * x])
    errors = path_errors(run_of(target, target))
    assert errors.position.max() < 1e-9
    assert np.abs(errors.delay).max() < 0.02


def test_arrival():
    *_, target = eight(more=2.0)
    late = np.vstack([target[:1].repeat(10, axis=0), target[:-10]])  # by 1 s
    punctual, delayed = (arrival(run_of(each, target)) for each in (target, late))
    assert punctual < 10.0
    assert delayed == pytest.approx(punctual + 1.0)
    assert isnan(arrival(run_of(target[:-30], np.vstack([target[:-31], target[-1:]]))))
    assert arrival(run_of(target[:1], target[:1])) == 0.0


def test_unknown_poses_give_unknown_errors():
    """A run that fails before its first sample has one row without a target."""
    run = run_of([(0.0, 0.0, 0.0)], [(nan, nan, nan)])
    assert np.isnan(path_errors(run).position).all()
    assert isnan(arrival(run))


def test_governed_reference_has_no_path_error():
    robot = named_robot("kiwi")
    reference, _, _ = eight(8.0)
    delayed = delay_within_limits(
        reference, limit_rows(robot.chassis, MotionLimits.of_robot(robot))
    )
    times = np.arange(0.0, delayed.duration, DT)
    run = run_of(poses(delayed, times), poses(reference, times))
    figures = measure(run, robot.chassis)
    assert figures.path_me < 1e-3
    assert figures.path_mae < 5e-3
    assert figures.me > 0.3
    assert 8.0 < figures.arrival < delayed.duration
    assert run.pose[0] == pytest.approx(Pose(*reference.at(0.0).pose))


@pytest.mark.parametrize("wild", [1e300, -1e300, 1e155, nan])
def test_targets_without_a_spline_have_errors_of_the_samples(wild):
    target = np.array([(0.1 * k, 0.0, 0.0) for k in range(20)])
    target[7, 0] = wild
    found = path_errors(run_of(np.zeros((20, 3)), target))
    assert found.position[:7] == pytest.approx(np.abs(target[:7, 0]))


@pytest.mark.parametrize("wild", [1e300, 2.0**53])
def test_times_without_a_spline_have_errors_of_the_samples(wild):
    target = np.array([(0.1 * k, 0.0, 0.0) for k in range(20)])
    run = run_of(np.zeros((20, 3)), target)
    found = path_errors(replace(run, t=np.append(run.t[:-1], wild)))
    assert found.position == pytest.approx(target[:, 0])
