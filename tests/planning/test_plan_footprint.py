"""Paths of the disc where it suffices, otherwise of the polygon."""

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import PathOptions, Waypoint, plan
from omnidrive.planning.footprint import plan_footprint
from tests.planning.footprints import CONVEX_PARTS, RECTANGLE, deepest_contact
from tests.shared_data import shared_table

FINE = np.linspace(0.0, 1.0, 3000)


def hall_with_door(yaw=0.0):
    """Two rooms of 2 x 4 m; their door of 0.6 m is narrower than the circle of the rectangle."""
    occupied = np.zeros((40, 40), bool)
    occupied[:, 19:22] = True
    occupied[17:23, 19:22] = False
    return OccupancyGrid(occupied, 0.1, yaw=yaw)


def test_disc_is_used_where_it_suffices_bit_for_bit():
    grid = OccupancyGrid(np.zeros((40, 40), bool), 0.1)
    ends = (Waypoint(0.8, 1.0, 0.3), Waypoint(3.2, 2.9))
    found = plan_footprint(grid, *ends, footprint=RECTANGLE, inflation_margin=0.05)
    radius = float(np.hypot(0.31, 0.12))
    expected = plan(grid, *ends, inflation=radius + 0.05, options=PathOptions())
    assert found.shape == "disc"
    assert "0.3324 m" in found.reason
    np.testing.assert_array_equal(found.spline.control_points, expected.spline.control_points)
    assert found.clearance == expected.clearance


@pytest.mark.parametrize("shape", CONVEX_PARTS)
@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_polygon_goes_where_the_disc_does_not(shape, yaw):
    corners, parts = CONVEX_PARTS[shape]
    grid = hall_with_door(yaw)
    (x, y), (to_x, to_y) = grid.points_of(np.array([[20.3, 8.4], [21.7, 33.1]]))
    start, goal = Waypoint(x, y, 1.234), Waypoint(to_x, to_y, -2.0)
    found = plan_footprint(grid, start, goal, footprint=corners)
    assert found.shape == "polygon"
    assert "no path for the disc" in found.reason
    poses = found.spline.poses(FINE)
    assert deepest_contact(grid, parts, poses) < 1e-9
    assert found.clearance > 0.0
    np.testing.assert_allclose(poses[0], start, atol=1e-12)
    np.testing.assert_allclose(poses[-1, :2], goal[:2], atol=1e-12)
    assert np.cos(poses[-1, 2] - goal.yaw) == pytest.approx(1.0)
    assert found.spline.length <= found.grid_path.length
    assert np.isfinite(found.spline.max_curvature[1])


def test_polygon_that_fits_exactly_follows_the_search():
    """In a channel of its own width the rectangle touches both walls and cannot turn."""
    occupied = np.ones((16, 48), bool)
    occupied[6:10, 4:44] = False
    grid = OccupancyGrid(occupied, 0.125)
    square = np.array([[0.25, 0.25], [-0.25, 0.25], [-0.25, -0.25], [0.25, -0.25]])
    rows = 8 * 0.125
    with pytest.raises(InvalidWaypoint, match="collides"):
        plan_footprint(
            grid, Waypoint(1.0, rows + 0.01, 0.0), Waypoint(5.0, rows, 0.0), footprint=square
        )
    shifted = square + np.array(
        [0.0, 0.0625]
    )  # the centres of cells lie aside of that of the channel
    found = plan_footprint(
        grid,
        Waypoint(1.0, rows - 0.0625, 0.0),
        Waypoint(5.0, rows - 0.0625, 0.0),
        footprint=shifted,
    )
    assert found.shape == "polygon"
    assert found.clearance == 0.0
    assert deepest_contact(grid, [shifted], found.spline.poses(FINE)) < 1e-9


def test_margin_is_kept_up_to_half_a_diagonal():
    grid = hall_with_door()
    margin = 0.1
    found = plan_footprint(
        grid, Waypoint(0.9, 1.1, 0.1), Waypoint(3.3, 2.8, 3.0),
        footprint=RECTANGLE, inflation_margin=margin,
    )  # fmt: skip
    assert found.shape == "polygon"
    corners = np.vstack([np.linspace(a, b, 20) for a, b in
                         zip(RECTANGLE, np.roll(RECTANGLE, -1, axis=0), strict=True)])  # fmt: skip
    for x, y, yaw in found.spline.poses(FINE[::10]):
        rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        at = corners @ rotation.T + (x, y)
        assert grid.clearance(at).min() >= margin - 0.1 * np.sqrt(0.5)


def test_heading_may_be_left_to_the_search():
    found = plan_footprint(
        hall_with_door(), Waypoint(0.9, 2.0), Waypoint(3.2, 2.0), footprint=RECTANGLE
    )
    assert found.shape == "polygon"
    assert np.ptp(found.spline.control_points[:, 2]) == pytest.approx(0.0, abs=1e-9)


def test_faults_are_named():
    grid, ends = hall_with_door(), (Waypoint(0.9, 2.0, 0.0), Waypoint(3.2, 2.0, 0.0))
    with pytest.raises(InvalidInput, match="margin"):
        plan_footprint(grid, *ends, footprint=RECTANGLE, inflation_margin=-1.0)
    with pytest.raises(InvalidInput, match="meet"):
        plan_footprint(grid, *ends, footprint=RECTANGLE[[0, 2, 1, 3]])
    with pytest.raises(InvalidWaypoint, match="outside the map"):
        plan_footprint(grid, Waypoint(9.0, 9.0), ends[1], footprint=RECTANGLE)
    with pytest.raises(InvalidWaypoint, match=r"collides at the start .* 5 degrees"):
        plan_footprint(grid, Waypoint(1.8, 0.5, 0.1), ends[1], footprint=RECTANGLE)
    with pytest.raises(NoPathFound, match="lower the margin"):
        plan_footprint(grid, *ends, footprint=RECTANGLE, inflation_margin=0.2)
    with pytest.raises(NoPathFound, match=r"polygon of 4 corners, 1.44 x 0.72 m"):
        plan_footprint(grid, ends[0], Waypoint(3.0, 2.0), footprint=3.0 * RECTANGLE)


ROBOT = np.array([[0.254, 0.215], [-0.254, 0.215], [-0.254, -0.215], [0.254, -0.215]])
CYLINDER = 0.075  # m, radius
RESOLUTION = 0.05  # m
LOW, SHAPE = np.array([-4.65, 1.5]), (260, 96)


def barn_map(cylinders):
    """Return the grid of a BARN world; a cell is occupied if a cylinder reaches into it."""
    rows, cols = SHAPE
    occupied = np.zeros(SHAPE, bool)
    left, below = LOW[0] + RESOLUTION * np.arange(cols), LOW[1] + RESOLUTION * np.arange(rows)
    for x, y in cylinders:
        dx = np.maximum(np.maximum(left - x, x - left - RESOLUTION), 0.0)
        dy = np.maximum(np.maximum(below - y, y - below - RESOLUTION), 0.0)
        occupied |= np.hypot(dx, dy[:, None]) < CYLINDER
    return OccupancyGrid(occupied, RESOLUTION, tuple(LOW.tolist()))


def distance_to_cylinders(cylinders, poses):
    nearest = np.inf
    for x, y, yaw in poses:
        around = (cylinders - (x, y)) @ (1, 1j)
        at = around[np.abs(around) < 1.0] * np.exp(-1j * yaw)
        apart = np.maximum(np.abs(at.real) - 0.254, 0.0) + 1j * np.maximum(
            np.abs(at.imag) - 0.215, 0.0
        )
        nearest = min(nearest, np.abs(apart).min(initial=np.inf) - CYLINDER)
    return nearest


def barn_distance(table, world):
    """Return the shape that a world needs, and the shortest distance to a cylinder."""
    cylinders = table[table[:, 0] == world, 1:]
    start, goal = Waypoint(-2.25, 3.0, np.pi / 2), Waypoint(-2.25, 13.0)
    found = plan_footprint(barn_map(cylinders), start, goal, footprint=ROBOT)
    return found.shape, distance_to_cylinders(cylinders, found.spline.poses(FINE[::2]))


def test_some_barn_worlds():
    table = shared_table("dynamic/barn.csv")
    for world, shape in ((1, "disc"), (285, "polygon"), (286, "polygon")):
        needed, distance = barn_distance(table, world)
        assert needed == shape
        assert distance > 0.0


@pytest.mark.long
def test_every_barn_world():
    table = shared_table("dynamic/barn.csv")
    found = [barn_distance(table, world) for world in np.unique(table[:, 0])]
    assert len(found) == 250
    assert min(distance for _, distance in found) > 0.0
    assert sum(shape == "polygon" for shape, _ in found) == 46
