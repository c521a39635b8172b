"""Proved distance of a moving polygon, against fine samples."""

import numpy as np
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.planning.footprint import footprint_clearance
from tests.planning.footprints import CONVEX_PARTS, RECTANGLE, deepest_contact, turned

SIDE = 0.1


def outline_points(corners, parts=12):
    share = np.linspace(0.0, 1.0, parts, endpoint=False)[:, None, None]
    return (corners + share * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)


def random_path(rng, bend):
    start, goal = rng.uniform(0.5, 2.5, (2, 2))
    points = np.linspace(start, goal, 7) + bend * rng.standard_normal((7, 2))
    return SplinePath(np.column_stack([points, np.cumsum(rng.uniform(-0.6, 0.6, 7))]))


@pytest.mark.parametrize("shape", CONVEX_PARTS)
@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_bound_is_below_the_sampled_distance_and_near_it(shape, yaw):
    corners, parts = CONVEX_PARTS[shape]
    rng = np.random.default_rng(4)
    free = touching = 0
    for _ in range(15):
        grid = OccupancyGrid(rng.random((30, 30)) < 0.007, SIDE, yaw=yaw)
        path = random_path(rng, 0.15)
        path = SplinePath(
            np.column_stack([turned(path.control_points[:, :2], yaw), path.control_points[:, 2]])
        )
        bound = footprint_clearance(grid, corners, path)
        poses = path.poses(np.linspace(0.0, 1.0, 200))
        outline = np.vstack([turned(outline_points(corners), p[2]) + p[:2] for p in poses])
        sampled = grid.clearance(outline).min()
        if bound >= 0.0:
            assert deepest_contact(grid, parts, poses) < 1e-9
            assert bound <= sampled
            assert bound >= sampled / np.sqrt(2.0) - 0.25 * SIDE
            free += 1
        else:
            assert bound <= sampled
            assert sampled < 0.2 * SIDE or deepest_contact(grid, parts, poses) > 0.0
            touching += 1
    assert free > 2
    assert touching > 2


def test_motion_along_a_wall_in_contact_has_the_bound_0():
    grid = OccupancyGrid(np.zeros((10, 40), bool), 0.125)
    square = np.array([[0.25, 0.25], [-0.25, 0.25], [-0.25, -0.25], [0.25, -0.25]])
    line = np.linspace((0.5, 0.25, 0.0), (4.0, 0.25, 0.0), 9)
    assert footprint_clearance(grid, square, SplinePath(line)) == 0.0
    assert footprint_clearance(grid, square, SplinePath(line - (0.0, 0.01, 0.0))) < -0.01
    aside = footprint_clearance(grid, square, SplinePath(line - (0.0, -0.05, 0.0)))
    assert aside == pytest.approx(0.05, abs=1.5e-3)


def test_square_inside_the_polygon_is_a_contact():
    occupied = np.zeros((40, 40), bool)
    occupied[20, 20] = True
    grid = OccupancyGrid(occupied, 0.1)
    large = RECTANGLE * 5.0
    at = np.repeat([[2.0, 2.05, 0.0]], 4, axis=0)
    assert footprint_clearance(grid, large, SplinePath(at)) <= -0.05


def test_without_obstacles_the_bound_is_infinite():
    grid = OccupancyGrid(np.zeros((9, 9), bool), 0.1, walled=False)
    path = SplinePath(np.linspace((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), 5))
    assert footprint_clearance(grid, RECTANGLE, path) == np.inf
    with pytest.raises(InvalidInput, match="tolerance"):
        footprint_clearance(grid, RECTANGLE, path, tolerance=0.0)
