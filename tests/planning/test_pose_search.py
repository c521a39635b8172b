"""Search over position and heading, against a search of its own on explicit contacts."""

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import search
from omnidrive.planning.footprint import PoseSearch, search_poses
from tests.planning.footprints import (
    CHEVRON,
    CONVEX_PARTS,
    HEADINGS,
    RECTANGLE,
    deepest_contact,
    pose_graph,
)

ROOM = OccupancyGrid(np.zeros((30, 30), bool), 0.1)


def blocks(rng, rows, cols, count):
    occupied = np.zeros((rows, cols), bool)
    for row, col in rng.integers(0, (rows, cols), (count, 2)):
        occupied[row : row + rng.integers(1, 4), col : col + rng.integers(1, 4)] = True
    return occupied


def finely(poses, parts=20):
    """Return poses along the straight motions between poses."""
    at = np.arange(len(poses) - 1)[:, None] + np.arange(parts) / parts
    return np.column_stack(
        [np.interp(at.ravel(), np.arange(len(poses)), column) for column in poses.T]
    )


def cases():
    """Return a quick case of each shape, and long ones."""
    quick = [("rectangle", 0, 0.0), ("chevron", 2, 0.37), ("aside", 3, -2.0)]
    every = [(shape, seed, yaw) for shape in CONVEX_PARTS for seed, yaw in
             enumerate([0.0, 0.0, 0.37, -2.0, 1.0])]  # fmt: skip
    return [*quick, *(pytest.param(*each, marks=pytest.mark.long) for each in every)]


@pytest.mark.parametrize(("shape", "seed", "yaw"), cases())
def test_way_and_cost_are_those_of_dijkstra_over_all_poses(shape, seed, yaw):
    outline, parts = CONVEX_PARTS[shape]
    rng = np.random.default_rng(seed)
    grid = OccupancyGrid(blocks(rng, 15, 18, 8), 0.1, (0.3, -0.7), yaw=yaw)
    poses = PoseSearch(grid, outline)
    free, graph = pose_graph(grid, parts, poses.turn / 470832)
    ends = np.argwhere(free)
    found = []
    for k, row, col in rng.choice(ends, 3):
        lengths = dijkstra(
            graph, directed=False, indices=np.ravel_multi_index((k, row, col), free.shape)
        )
        for goal_k, goal_row, goal_col in rng.choice(ends, 8):
            length = lengths.reshape(free.shape)[goal_k, goal_row, goal_col]
            query = ((row, col, k), (goal_row, goal_col, goal_k))
            if np.isinf(length):
                with pytest.raises(NoPathFound):
                    poses.search(*query)
            else:
                result = poses.search(*query)
                assert result.cost == pytest.approx(length, abs=1e-5)
                assert deepest_contact(grid, parts, finely(result.poses, 5)) < 1e-9
            found.append(np.isfinite(length))
    assert any(found)
    for row, col in np.argwhere(~free.any(axis=0) & ~grid.occupied)[:3]:
        with pytest.raises(InvalidWaypoint, match="collides"):
            poses.search((row, col, None), tuple(ends[0][[1, 2, 0]]))


def test_free_headings_at_the_ends_give_the_shortest_of_all():
    rng = np.random.default_rng(5)
    grid = OccupancyGrid(blocks(rng, 20, 20, 8), 0.1)
    outline, parts = CONVEX_PARTS["rectangle"]
    poses = PoseSearch(grid, outline)
    free, graph = pose_graph(grid, parts, poses.turn / 470832)
    (row, col), (goal_row, goal_col) = rng.choice(np.argwhere(free.any(axis=0)), 2)
    starts = [
        np.ravel_multi_index((k, row, col), free.shape) for k in np.flatnonzero(free[:, row, col])
    ]
    lengths = dijkstra(graph, directed=False, indices=starts, min_only=True).reshape(free.shape)
    result = poses.search((row, col, None), (goal_row, goal_col, None))
    assert result.cost == pytest.approx(lengths[:, goal_row, goal_col].min(), abs=1e-5)


def test_polygon_passes_a_door_sideways_that_its_circle_does_not_fit():
    occupied = np.zeros((40, 40), bool)
    occupied[:, 20] = True
    occupied[18:23, 20] = False  # 0.5 m; the rectangle is 0.24 m wide, its circle 0.66 m
    grid = OccupancyGrid(occupied, 0.1)
    disc = grid.inflated(float(np.hypot(0.31, 0.12)))
    with pytest.raises(NoPathFound):
        search(disc, (20, 8), (20, 32))
    result = search_poses(grid, RECTANGLE, (20, 8, 18), (20, 32, 18))
    assert deepest_contact(grid, [RECTANGLE], finely(result.poses)) < 1e-9
    assert len(np.unique(result.headings)) > 1
    assert result.headings[0] == result.headings[-1] == 18
    steps = np.diff(result.poses, axis=0)
    assert np.abs(steps[:, 2]).max() <= 2 * np.pi / HEADINGS + 1e-12


def test_every_layer_is_the_map_inflated_by_the_polygon():
    rng = np.random.default_rng(3)
    for walled in (True, False):
        grid = OccupancyGrid(blocks(rng, 40, 150, 30), 0.05, walled=walled, yaw=0.2)
        poses = PoseSearch(grid, CHEVRON)
        for k in range(0, HEADINGS, 7):
            expected = ~grid.inflated_by(CHEVRON, k * 2 * np.pi / HEADINGS).occupied
            free = [[poses.is_free(row, col, k) for col in range(150)] for row in range(40)]
            np.testing.assert_array_equal(free, expected)


def test_polygon_larger_than_the_map():
    wall_less = OccupancyGrid(np.zeros((3, 4), bool), 0.1, walled=False)
    huge = RECTANGLE * 1e4
    assert search_poses(wall_less, huge, (0, 0, 0), (2, 3, 1)).cost > 0.0
    with pytest.raises(InvalidWaypoint, match="nowhere on the map"):
        search_poses(OccupancyGrid(np.zeros((3, 4), bool), 0.1), huge, (0, 0, 0), (2, 3, 1))


@pytest.mark.parametrize(
    ("footprint", "message"),
    [
        (RECTANGLE[:2], "at least three corners"),
        ([[0, 0], [1, 0], [np.nan, 1]], "finite"),
        ([[0, 0], [1, 0], [2, 0]], "area"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "edges 1 and 3 meet"),
        ([[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]], "meet"),
        ([[0, 0], [2, 0], [1, 0], [1, 1]], "edges 1 and 2 meet"),
        ([[0, 0], [1, 0], [1, 1], [1, 0]], "corners 2 and 4 .* coincide"),
        ([[0, 0], [1, 0], [1]], "pairs of numbers"),
        ("square", "pairs of numbers"),
        (np.column_stack([np.cos(np.arange(201) / 32), np.sin(np.arange(201) / 32)]), "200"),
    ],
)
def test_bad_polygon_is_named(footprint, message):
    with pytest.raises(InvalidInput, match=message):
        search_poses(ROOM, footprint, (15, 15, 0), (20, 20, 0))


def test_bad_ends_are_named():
    occupied = np.zeros((30, 30), bool)
    occupied[10:12] = True
    grid = OccupancyGrid(occupied, 0.1)
    with pytest.raises(InvalidWaypoint, match=r"goal .* outside the grid"):
        search_poses(grid, RECTANGLE, (20, 15, 0), (40, 20, 0))
    with pytest.raises(
        InvalidWaypoint, match=r"0.48 x 0.24 m collides at the start .*270 degrees; there .* free"
    ):
        search_poses(grid, RECTANGLE, (13, 15, 54), (20, 20, 0))
    with pytest.raises(InvalidWaypoint, match="nearest free position"):
        search_poses(grid, RECTANGLE, (11, 15, None), (20, 20, 0))
    with pytest.raises(NoPathFound, match="polygon of 4 corners"):
        search_poses(grid, RECTANGLE, (20, 15, 0), (5, 15, 0))
    with pytest.raises(InvalidInput, match="turn radius"):
        search_poses(grid, RECTANGLE, (20, 15, 0), (25, 15, 0), turn_radius=-1.0)
