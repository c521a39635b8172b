"""Headings that move the robot sideways as little as smooth turns allow."""

from math import pi

import numpy as np
import pytest

from omnidrive.geometry import wrap
from omnidrive.planning import SplinePath
from omnidrive.reference import MotionLimits, time_within_limits
from omnidrive.reference.headings.heading_policies import turning_once
from omnidrive.reference.headings.heading_spline import TURN_LENGTH
from omnidrive.reference.headings.initial_headings import with_end_headings
from omnidrive.reference.headings.least_strafing import least_strafing
from omnidrive.robot import named_robot
from tests.reference.sample_paths import straight, turning, wandering

U = np.linspace(0.0, 1.0, 8001)


def strafing(path, yaw=None):
    """Return the integral of the squared sideways share of the motion over the arc length, m."""
    x, y, _ = path.first_derivatives(U).T
    yaw = path.poses(U)[:, 2] if yaw is None else yaw
    speed = np.hypot(x, y)
    across = (y * np.cos(yaw) - x * np.sin(yaw)) / np.maximum(speed, 1e-12)
    return np.trapezoid(speed * across**2, U)


def objective(path):
    """Return the minimised integral, m."""
    x, y, turn = path.first_derivatives(U).T
    speed = np.hypot(x, y)
    away = np.arctan2(y, x) - path.poses(U)[:, 2]
    extra = turn / speed - path.curvature(U)
    return np.trapezoid(speed * (4.0 * np.sin(0.5 * away) ** 2 + (TURN_LENGTH * extra) ** 2), U)


def smooth_path(seed):
    """Return a path of about 8 m with a curvature below 2.5 1/m."""
    rng = np.random.default_rng(seed)
    turns = np.cumsum(np.convolve(rng.uniform(-0.4, 0.4, 90), np.ones(10) / 10.0, "valid"))
    points = np.cumsum(0.1 * np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)
    return SplinePath(np.column_stack([points, turns]))


@pytest.mark.parametrize("seed", range(20))
def test_less_strafing_than_other_headings(seed):
    path, rng = smooth_path(seed), np.random.default_rng(100 + seed)
    start, goal = rng.uniform(-pi, pi, 2)
    found = least_strafing(path, start, goal)
    others = {
        "goal-first": turning_once(path, start, goal, early=True),
        "goal-last": turning_once(path, start, goal, early=False),
        "path": with_end_headings(path, start, goal),
    }
    for name, other in others.items():
        assert strafing(found) < strafing(other), name
    assert strafing(found) < strafing(path, np.full(len(U), start))


@pytest.mark.parametrize("seed", range(5))
def test_no_change_of_a_control_point_lowers_the_integral(seed):
    path, rng = smooth_path(seed), np.random.default_rng(seed)
    found = least_strafing(path, 2.0, -1.0)
    least = objective(found)
    for _ in range(20):
        points = found.control_points.copy()
        points[rng.integers(1, len(points) - 1), 2] += rng.choice([-0.02, 0.02])
        assert objective(SplinePath(points)) > least


@pytest.mark.parametrize("first", [0.5, 1.5, 2.5, -3.0])
def test_turn_on_a_straight_line_is_the_closed_form(first):
    path = least_strafing(straight(6.0, points=200), first)
    poses = path.poses(U)
    expected = 4.0 * np.arctan(np.exp(-poses[:, 0] / TURN_LENGTH) * np.tan(first / 4.0))
    np.testing.assert_allclose(poses[:, 2], expected, atol=2e-3)


@pytest.mark.parametrize("seed", range(5))
def test_without_end_headings_it_is_the_direction_of_travel(seed):
    path = least_strafing(smooth_path(seed))
    x, y, _ = path.first_derivatives(U).T
    away = wrap(path.poses(U)[:, 2] - np.arctan2(y, x))
    assert np.abs(away).max() < 0.02


@pytest.mark.parametrize("seed", range(5))
def test_end_headings_are_exact_and_turns_smooth_and_bounded(seed):
    path = smooth_path(seed)
    found = least_strafing(path, 3.0, -2.5)
    ends = found.poses(np.array([0.0, 1.0]))[:, 2]
    np.testing.assert_allclose(wrap(ends - [3.0, -2.5]), 0.0, atol=1e-12)
    np.testing.assert_array_equal(found.control_points[:, :2], path.control_points[:, :2])
    pieces = len(path.control_points) - 3
    knots, step = np.arange(1, pieces) / pieces, 1e-7
    before, after = (found._derivatives[2](knots + side)[:, 2] for side in (-step, step))
    np.testing.assert_allclose(before, after, atol=1e-3 * np.abs(after).max())
    x, y, turn = found.first_derivatives(U).T
    rate = np.abs(turn) / np.hypot(x, y)
    assert rate.max() < 1.05 * (2.0 / TURN_LENGTH + np.abs(path.curvature(U)).max())


def test_path_that_reverses_and_turns_on_the_spot():
    out, back = np.linspace(0.0, 3.0, 31), np.linspace(3.0, 0.0, 31)
    x = np.concatenate([out, [3.0] * 4, back])
    path = SplinePath(np.column_stack([x, np.zeros(len(x)), np.zeros(len(x))]))
    found = least_strafing(path, 0.0, pi)
    yaw = found.control_points[:, 2]
    assert np.abs(yaw[:20]).max() < 0.15
    assert abs(abs(yaw[-1]) - pi) < 1e-12
    assert np.abs(np.abs(yaw[-20:]) - pi).max() < 0.15
    on_the_spot = least_strafing(turning(1.0), 0.5, -1.0).control_points[:, 2]
    assert on_the_spot[0] == pytest.approx(0.5)
    assert on_the_spot[-1] == pytest.approx(-1.0)
    assert (np.diff(on_the_spot) < 0.0).all()
    kept = least_strafing(turning(1.0)).control_points[:, 2]
    assert (kept[0], kept[-1]) == pytest.approx((0.0, 1.0))


def test_headings_follow_several_turns_of_the_path():
    angles = np.linspace(0.0, 6.0 * pi, 400)  # on a circle of 1 m
    points = np.column_stack([np.cos(angles), np.sin(angles), angles + 0.5 * pi])
    found = least_strafing(SplinePath(points), 0.0, 0.0)
    assert found.poses(1.0)[2] - found.poses(0.0)[2] == pytest.approx(6.0 * pi)
    assert strafing(found) < 1.5


@pytest.mark.parametrize("seed", range(3))
def test_limits_hold(seed):
    robot = named_robot("mecanum")
    limits = MotionLimits.of_robot(robot)
    motion = time_within_limits(
        wandering(seed), robot.chassis, limits, heading="strafe-least", start_yaw=1.0, goal_yaw=-2.0
    )
    assert max(motion.limit_usage.values()) <= 1.0 + 1e-3
    assert abs(wrap(motion.at(motion.duration).pose.yaw + 2.0)) < 1e-9
