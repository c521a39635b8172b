"""Random queries of a polygon: no contact, and a way wherever a search by brute force finds one."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from omnidrive.errors import InvalidWaypoint, NoPathFound
from omnidrive.maps import OccupancyGrid, load_map, maze_map, random_map, rooms_map, warehouse_map
from omnidrive.planning import Waypoint
from omnidrive.planning.footprint import plan_footprint
from tests.planning.footprints import CONVEX_PARTS, deepest_contact, pose_graph
from tests.shared_data import shared

RESOLUTION = 0.1  # m
QUERIES = 38  # per map
STEP = 0.1  # cells between sampled poses, of every corner


def walled(occupied, times=1):
    """Return a map with a border of occupied cells, each cell drawn ``times`` as wide."""
    return OccupancyGrid(np.pad(np.kron(occupied, np.ones((times, times), bool)), 1,
                                constant_values=True), RESOLUTION)  # fmt: skip


def coarse(name, times):
    """Return the known part of a real map, in cells ``times`` as wide; half occupied counts."""
    occupied = load_map(shared(f"maps/{name}")).occupied
    free = np.argwhere(~occupied)
    (top, left), (bottom, right) = free.min(axis=0), free.max(axis=0) + 1
    occupied = occupied[top:bottom, left:right]
    rows, cols = (n - n % times for n in occupied.shape)
    blocks = occupied[:rows, :cols].reshape(rows // times, times, cols // times, times)
    return walled(blocks.mean(axis=(1, 3)) >= 0.5)


def generated(make, times, seed):
    return walled(make(np.random.default_rng(seed)).occupied, times)


MAPS = {
    "random blocks": lambda: generated(lambda rng: random_map(20, 24, 0.36, rng), 4, 1),
    "random cells": lambda: generated(lambda rng: random_map(70, 80, 0.025, rng), 1, 2),
    "maze": lambda: generated(lambda rng: maze_map(15, 15, 1, rng), 5, 3),
    "rooms": lambda: generated(lambda rng: rooms_map(25, 25, 7, rng), 4, 4),
    "warehouse": lambda: generated(lambda rng: warehouse_map(20, 25, rng), 4, 5),
    "depot": lambda: coarse("nav2/depot.yaml", 4),
    "sandbox": lambda: coarse("nav2/tb3_sandbox.yaml", 1),
    "smoothers": lambda: coarse("nav2/smoothers_world.yaml", 4),
}


def sampled(spline, reach):
    """Return poses along a path between which no corner moves by more than a tenth of a cell."""
    fine = spline.poses(np.linspace(0.0, 1.0, 4001))
    steps = np.hypot(*np.diff(fine[:, :2], axis=0).T) + reach * np.abs(np.diff(fine[:, 2]))
    away = np.concatenate([[0.0], np.cumsum(steps)])
    count = 2 + int(away[-1] / (STEP * RESOLUTION))
    places = np.searchsorted(away, np.linspace(0.0, away[-1], count))
    return fine[np.unique(places.clip(max=len(fine) - 1))]


def answers(grid, shape, count, rng):
    """Return for random queries whether brute force has a way, the shape used, and the contact."""
    corners, parts = CONVEX_PARTS[shape]
    free, moves = pose_graph(grid, parts, 1.0)
    region = connected_components(moves, directed=False)[1].reshape(free.shape)
    poses, found = np.argwhere(free), []
    for k in range(count):
        ends = poses[rng.integers(len(poses), size=2)]
        places = grid.centres(ends[:, 1:])
        yaws = 2.0 * np.pi / len(free) * ends[:, 0]
        open_goal = k % 3 == 0
        start = Waypoint(*places[0].tolist(), float(yaws[0]))
        goal = Waypoint(*places[1].tolist(), None if open_goal else float(yaws[1]))
        headings = slice(None) if open_goal else ends[1, 0]
        goals = np.where(free, region, -1)[headings, ends[1, 1], ends[1, 2]]
        exists = bool((region[tuple(ends[0])] == goals).any())
        try:
            plan = plan_footprint(grid, start, goal, footprint=corners)
        except (NoPathFound, InvalidWaypoint):
            found.append((exists, "none", 0.0))
            continue
        reach = float(np.hypot(*corners.T).max())
        found.append(
            (exists, plan.shape, deepest_contact(grid, parts, sampled(plan.spline, reach)))
        )
    return found


def check(names, count):
    """Check random queries, and return the shapes that were used."""
    shapes, all_found = list(CONVEX_PARTS), []
    for i, name in enumerate(names):
        rng = np.random.default_rng(100 + i)
        found = answers(MAPS[name](), shapes[i % len(shapes)], count, rng)
        assert [exists for exists, _, _ in found] == [used != "none" for _, used, _ in found], name
        assert max(depth for _, _, depth in found) < 1e-9, name
        all_found += found
    return [used for _, used, _ in all_found]


def test_some_queries():
    used = check(["rooms", "random blocks"], 8)
    assert used.count("polygon") > 3


@pytest.mark.long
def test_three_hundred_queries_on_eight_maps():
    used = check(list(MAPS), QUERIES)
    assert len(used) >= 300
    assert min(used.count(each) for each in ("polygon", "none", "disc")) > 20
