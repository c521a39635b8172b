"""Distance of polygons at poses to occupied cells."""

import numpy as np
import pytest

from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.footprint import pose_distance
from tests.planning.footprints import CONVEX_PARTS, deepest_contact, turned

POSES = np.array([[1.0, 1.1, 0.3], [0.62, 1.4, -2.0], [2.3, 0.7, 9.1], [1.9, 2.2, 4.0]])


def map_of(rng, share, yaw, *, walled=False):
    occupied = rng.random((34, 41)) < share
    return OccupancyGrid(occupied, 0.08, (-0.2, -0.1), yaw=yaw, walled=walled)


@pytest.mark.parametrize("shape", CONVEX_PARTS)
@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_distance_is_that_of_dense_points_of_the_outline(shape, yaw):
    corners, parts = CONVEX_PARTS[shape]
    rng = np.random.default_rng(3)
    ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    outline = np.vstack([np.linspace(a, b, 400) for a, b in ends])
    apart = 0
    for share in (0.002, 0.01, 0.03) * 4:
        grid = map_of(rng, share, yaw)
        for pose in POSES:
            found = pose_distance(grid, Polygon.of(corners), pose[None])
            sampled = grid.clearance(turned(outline, pose[2]) + pose[:2]).min()
            if found > 0.0:
                apart += 1
                assert sampled - 2e-3 <= found <= sampled + 1e-9
            elif np.isfinite(found):
                # a triangle may overlap less than the convex part that contains it
                deepest = deepest_contact(grid, parts, pose[None])
                assert -deepest - 1e-9 <= found < 0.0
    assert apart > 5


def test_least_of_many_poses_is_found():
    grid, polygon = (
        map_of(np.random.default_rng(8), 0.01, 0.2),
        Polygon.of(CONVEX_PARTS["aside"][0]),
    )
    rng = np.random.default_rng(2)
    poses = np.column_stack([rng.uniform(-0.5, 3.0, (300, 2)), rng.uniform(-7.0, 7.0, 300)])
    alone = [pose_distance(grid, polygon, pose[None]) for pose in poses]
    order = np.argsort(alone)
    for left_out in (0, 30, 150, 290):
        expected = alone[order[left_out]]
        found = pose_distance(grid, polygon, poses[order[left_out:]])
        assert found == pytest.approx(expected, abs=1e-12)


def test_walls_and_empty_maps():
    polygon = Polygon.of(CONVEX_PARTS["rectangle"][0])
    empty = OccupancyGrid(np.zeros((10, 20), bool), 0.1, walled=False)
    assert pose_distance(empty, polygon, POSES) == np.inf
    walled = OccupancyGrid(np.zeros((10, 20), bool), 0.1)
    pose = np.array([[1.0, 0.5, 0.0]])
    assert pose_distance(walled, polygon, pose) == pytest.approx(0.38)
    assert pose_distance(walled, polygon, pose + np.array([0.8, 0.0, 0.0])) == pytest.approx(-0.11)
    assert pose_distance(walled, polygon, np.full((3, 3), np.nan)) == np.inf
