"""Headings by rules: toward a point, early and late turns, the fastest direction."""

from math import pi

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import wrap
from omnidrive.planning import SplinePath
from omnidrive.reference import MotionLimits, time_within_limits
from omnidrive.robot import named_robot
from tests.reference.sample_paths import straight, wandering

ROBOTS = ("kiwi", "mecanum", "paper")


def timed(path, heading, robot="paper", **options):
    robot = named_robot(robot)
    limits = MotionLimits.of_robot(robot)
    return time_within_limits(path, robot.chassis, limits, heading=heading, **options)


def random_path(seed):
    """Return a path that turns by less than a right angle per control point."""
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.uniform(-0.6, 0.6, 30))
    steps = 0.3 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    points = np.cumsum(steps, axis=0)
    return SplinePath(np.column_stack([points, turns]))


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("seed", range(4))
def test_fastest_is_never_slower_than_the_tangent(robot, seed):
    path = random_path(seed)
    fastest, tangent = (timed(path, heading, robot) for heading in ("fastest", "tangent"))
    assert fastest.duration <= tangent.duration
    assert max(fastest.limit_usage.values()) <= 1.0 + 1e-3


def test_fastest_turns_a_fast_direction_along_the_path():
    """The wheels of `paper` have axles at 45 degrees: on them, top speed is along x and y of B."""
    path = straight(8.0, yaw=pi / 4)
    slow, fast = timed(path, "path"), timed(path, "fastest")
    assert fast.duration < 0.9 * slow.duration
    load = named_robot("paper").chassis.jacobian
    directions = np.linspace(0.0, 2.0 * pi, 361)
    loads = np.abs(load[:, :2] @ np.stack([np.cos(directions), np.sin(directions)])).max(axis=0)
    yaw = fast.at(0.5 * fast.duration).pose.yaw
    at = np.abs(load[:, :2] @ np.array([np.cos(-yaw), np.sin(-yaw)])).max()
    assert at <= loads.min() * 1.02


def test_fastest_meets_the_end_headings():
    motion = timed(random_path(5), "fastest", start_yaw=0.3, goal_yaw=-2.0)
    ends = motion.at(0.0).pose.yaw, motion.at(motion.duration).pose.yaw
    assert abs(wrap(ends[0] - 0.3)) < 1e-6
    assert abs(wrap(ends[1] + 2.0)) < 1e-6


def test_face_points_at_the_target():
    path, target = random_path(2), (3.0, 4.0)
    motion = timed(path, "face", target=target)
    rows = motion.window(0.0, 500, motion.duration / 499)
    toward = np.arctan2(target[1] - rows[:, 1], target[0] - rows[:, 0])
    assert np.abs(wrap(rows[:, 2] - toward)).max() < 0.03


@pytest.mark.parametrize("early", [True, False])
def test_turn_near_the_start_or_near_the_goal(early):
    path = straight(6.0, points=40)
    heading = "goal-first" if early else "goal-last"
    motion = timed(path, heading, start_yaw=0.5, goal_yaw=2.5)
    rows = motion.window(0.0, 2000, motion.duration / 1999)
    x, yaw = rows[:, 0], rows[:, 2]
    constant = yaw[x > 1.5] - 2.5 if early else yaw[x < 4.5] - 0.5
    assert np.abs(wrap(constant)).max() < 1e-6
    assert abs(wrap(yaw[0] - 0.5)) < 1e-6
    assert abs(wrap(yaw[-1] - 2.5)) < 1e-6
    assert np.abs(np.diff(yaw)).sum() == pytest.approx(2.0, abs=1e-3)  # the short way round


@pytest.mark.parametrize("heading", ["goal-first", "goal-last", "fastest", "face"])
def test_limits_hold(heading):
    path = wandering(3)
    options = {"target": (30.0, 2.0)} if heading == "face" else {}
    motion = timed(path, heading, start_yaw=1.0, goal_yaw=-1.0, **options)
    assert max(motion.limit_usage.values()) <= 1.0 + 1e-3


def test_bad_targets_are_refused():
    with pytest.raises(InvalidInput, match="needs a target"):
        timed(straight(3.0), "face")
    with pytest.raises(InvalidInput, match="must be finite"):
        timed(straight(3.0), "face", target=(np.nan, 0.0))
    with pytest.raises(InvalidReference, match="passes through the target"):
        timed(straight(3.0), "face", target=(0.0, 0.0))
