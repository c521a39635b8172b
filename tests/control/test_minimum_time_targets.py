"""Targets that lead to a standing target: within the limits, without passing it."""

import numpy as np
import pytest

from omnidrive.control.nmpc.holonomic.minimum_time_targets import minimum_time_targets
from omnidrive.robot import ROBOTS, named_robot

DT = 0.01
WEIGHTS = np.array([90.0, 90.0, 40.0])


def targets(robot, start, twist, goal, count=400, reserve=1.0, reached=1.0, prompt=1.0):
    found = np.empty((count, 3))
    minimum_time_targets(
        np.array(start),
        twist,
        goal,
        WEIGHTS,
        robot.acceleration_faces,
        robot.chassis.jacobian,
        robot.max_wheel_speed,
        DT,
        0.0,
        reserve,
        reached,
        prompt,
        found,
    )
    return found


def in_body(vectors, yaws):
    c, s = np.cos(yaws), np.sin(yaws)
    x, y, yaw = vectors.T
    return np.stack([c * x + s * y, c * y - s * x, yaw], axis=1)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("goal", [(1.0, 1.0, 0.8), (-2.0, 0.5, 0.0), (0.0, 0.0, 3.0)])
def test_motion_from_rest_uses_the_limits_and_ends_at_the_target(name, goal):
    robot = named_robot(name)
    found = targets(robot, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), goal)
    assert not found[0].any()
    assert np.allclose(found[-1], goal, atol=1e-9)
    share = found @ np.array(goal) / np.dot(goal, goal)
    assert (np.diff(share) >= -1e-12).all()
    assert share.max() <= 1.0 + 1e-12
    velocities = np.diff(found, axis=0) / DT
    accelerations = np.diff(velocities, axis=0) / DT
    used = np.abs(in_body(accelerations, found[1:-1, 2]) @ robot.acceleration_faces.T).max(axis=1)
    speeds = np.abs(in_body(velocities, found[:-1, 2]) @ robot.chassis.jacobian.T).max(axis=1)
    assert used[:-40].max() < 1.03  # of a few per cent: a cell has one acceleration
    assert speeds.max() < robot.max_wheel_speed
    assert used[:3].min() > 0.98


def test_robot_that_moves_away_stops_first():
    robot = named_robot("small")
    found = targets(robot, (0.0, 0.0, 0.0), (-0.5, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert found[:, 0].min() < -0.02
    assert (found[2, 0] - found[1, 0]) / DT == pytest.approx(-0.5, abs=0.1)
    assert found[-1, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("speed", [1.0, 2.0, 3.0])
def test_robot_that_is_too_fast_decelerates_to_the_target(speed):
    robot = named_robot("small")
    found = targets(robot, (0.9, 0.0, 0.0), (speed, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert found[1, 0] - found[0, 0] == pytest.approx(speed * DT, rel=0.2)
    assert found[:, 0].max() <= 1.0 + 1e-12
    assert found[-1, 0] == pytest.approx(1.0, abs=1e-3)


def test_robot_above_the_speed_for_braking_uses_the_reserve_until_it_is_not():
    robot = named_robot("small")
    limit = 1.0 / np.abs(robot.acceleration_faces[:, 0]).max()
    speed = 1.05 * np.sqrt(2.0 * limit * 0.5)
    found = targets(robot, (0.0, 0.0, 0.0), (speed, 0.0, 0.0), (0.5, 0.0, 0.0), reserve=1.3)[:, 0]
    braking = -np.diff(found, n=2) / DT**2
    assert braking[:3] == pytest.approx(1.3 * limit, rel=0.05)
    assert braking[12:20].max() < 1.2 * limit
    assert found.max() <= 0.5 + 1e-12
    assert found[-1] == pytest.approx(0.5)


def test_robot_that_reaches_half_the_acceleration_brakes_half_as_hard():
    robot = named_robot("small")
    limit = 1.0 / np.abs(robot.acceleration_faces[:, 0]).max()
    found = targets(robot, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), reached=0.5)[:, 0]
    accelerations = np.diff(found, n=2) / DT**2
    assert accelerations.max() == pytest.approx(limit, rel=0.03)
    assert accelerations.min() > -0.5 * limit


def test_delayed_response_limits_the_ratio_of_speed_to_distance():
    robot = named_robot("small")
    found = targets(robot, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.8), prompt=0.33)[:, 2]
    left, speeds = 0.8 - found[:-1], np.diff(found) / DT
    far = left > 0.05  # in the last cell of the path the acceleration is constant
    assert (speeds[far] / left[far]).max() == pytest.approx(0.33 * 8.5, rel=0.03)
