"""Minimum time for a polygon: the proof decides, whatever the optimiser returns."""

import numpy as np
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath, Waypoint, footprint_clearance, plan_footprint
from omnidrive.planning.footprint import pose_distance, unproved_pieces
from omnidrive.reference import MotionLimits, minimum_time, time_within_limits
from omnidrive.reference.path_optimisation.transcription import Transcription
from omnidrive.robot import named_robot

ROBOT = named_robot("mecanum")
LIMITS = MotionLimits.of_robot(ROBOT)
BOX = np.array([[0.4, 0.22], [-0.4, 0.22], [-0.4, -0.22], [0.4, -0.22]])
YAWS = {"start_yaw": 1.5, "goal_yaw": 0.2}


@pytest.fixture(scope="module")
def door():
    """Map with a door of 0.6 m, and the plan of a robot of 0.8 x 0.44 m."""
    occupied = np.zeros((30, 40), bool)
    occupied[:, 19:22] = True
    occupied[12:18, 19:22] = False
    grid = OccupancyGrid(occupied, 0.1, (1.0, -2.0), yaw=0.3)
    corner = np.array(grid.origin)
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    (ax, ay), (bx, by) = corner + np.array([[1.0, 0.8], [3.2, 2.0]]) @ turn
    ends = Waypoint(ax, ay, YAWS["start_yaw"]), Waypoint(bx, by, YAWS["goal_yaw"])
    planned = plan_footprint(grid, *ends, footprint=BOX)
    assert planned.shape == "polygon"
    return grid, planned.spline


def fastest(door, **options):
    grid, spline = door
    return minimum_time(spline, ROBOT.chassis, LIMITS, grid, footprint=BOX, **YAWS | options)


def test_motion_is_faster_and_proved(door):
    grid, spline = door
    found = fastest(door)
    start = time_within_limits(spline, ROBOT.chassis, LIMITS)
    assert found.status == "converged"
    assert found.reference.duration < 0.95 * start.duration
    assert "% of the way" in found.message
    assert max(found.reference.limit_usage.values()) <= 1.0 + 1e-9
    assert footprint_clearance(grid, BOX, found.path) >= 0.0
    poses = found.reference.window(0.0, 4001, found.reference.duration / 4000)[:, :3]
    assert pose_distance(grid, Polygon.of(BOX), poses) >= -1e-9
    ends = found.path.control_points[[0, -1]]
    np.testing.assert_array_equal(ends, spline.control_points[[0, -1]])


@pytest.mark.parametrize("reach", [0.02, 0.3, 5.0])
def test_unproved_optimum_is_moved_back(door, monkeypatch, reach):
    """An optimiser that pushes the path into the walls, at most as far as the bounds allow."""
    grid, spline = door

    def push(_self, guess, _timed):
        points = guess.path.control_points.copy()
        points[1:-1, :2] += reach
        return SplinePath(np.clip(points, guess.low, guess.high)), False

    monkeypatch.setattr(Transcription, "solve", push)
    found = fastest(door)
    start = time_within_limits(spline, ROBOT.chassis, LIMITS)
    assert found.reference.duration <= start.duration
    same = (found.path.control_points == spline.control_points).all(axis=1)
    for piece in unproved_pieces(grid, BOX, found.path):
        assert same[piece : piece + 4].all()


def test_time_limit_ends_the_optimisation(door):
    found = fastest(door, time_limit=1e-6)
    assert found.status == "fallback"
    assert found.path is door[1]


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan")])
def test_time_limit_must_be_positive(door, limit):
    with pytest.raises(InvalidInput, match="time limit must be positive"):
        fastest(door, time_limit=limit)


@pytest.mark.parametrize("yaws", [{"start_yaw": 1.4}, {"goal_yaw": 2.0}, {"goal_yaw": np.inf}])
def test_other_end_headings_are_refused(door, yaws):
    with pytest.raises(InvalidInput, match=r"heading at the (start|goal)"):
        fastest(door, **yaws)
