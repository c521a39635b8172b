"""Paths over maps with costs: exact search, smoothing within a tolerance, lanes, changed maps."""

from dataclasses import replace
from heapq import heappop, heappush

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, NoPathFound
from omnidrive.maps import CostMap, Inflation, Lane, OccupancyGrid, random_map, rooms_map
from omnidrive.planning import GridSearch, PathOptions, Planner, Waypoint, plan, search

MOVES = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)]


def dijkstra(costs, start, goal):
    """Return the least cost from start to goal in cells, by the definition of the cost."""
    free = ~costs.grid.occupied
    weights = np.rint(256.0 * (1.0 + costs.costs)) / 256.0
    done, queue = {}, [(0.0, start)]
    while queue:
        cost, cell = heappop(queue)
        if cell in done:
            continue
        done[cell] = cost
        if cell == goal:
            return cost
        for move in MOVES:
            row, col = cell[0] + move[0], cell[1] + move[1]
            if not (0 <= row < free.shape[0] and 0 <= col < free.shape[1] and free[row, col]):
                continue
            if not (free[cell[0], col] and free[row, cell[1]]):
                continue
            factor = 0.5 * sum(
                weights[each] + against(costs, each, move) for each in (cell, (row, col))
            )
            heappush(queue, (cost + np.hypot(*move) * factor, (row, col)))
    return None


def against(costs, cell, move):
    """Return the cost of a move against the lane of a cell."""
    if costs.directions is None or np.isnan(costs.directions[cell]):
        return 0.0
    step = 2.0 * np.pi / 64
    lane = step * np.rint((costs.directions[cell] - costs.grid.yaw) / step)
    turn = np.arctan2(*move) - lane
    return np.rint(128.0 * costs.against * (1.0 - np.cos(turn))) / 256.0


def random_costs(seed):
    """Return a random map with random costs and lanes, some of them tall or rotated."""
    rng = np.random.default_rng(seed)
    shape = (400, 12) if seed % 5 == 4 else tuple(rng.integers(5, 40, 2))
    grid = OccupancyGrid(rng.random(shape) < 0.2, 0.1, yaw=rng.choice([0.0, 0.7]))
    costs = rng.choice([0.0, 0.3, 2.0, 200.0], shape) * rng.random(shape)
    directions = np.where(rng.random(shape) < 0.3, rng.uniform(-9.0, 9.0, shape), np.nan)
    return CostMap(
        grid,
        costs.astype(np.float32),
        directions=directions.astype(np.float32) if seed % 2 else None,
        against=float(rng.choice([0.0, 5.0])),
    ), rng


@pytest.mark.parametrize("seed", range(25))
def test_search_finds_the_least_cost(seed):
    costs, rng = random_costs(seed)
    free = np.argwhere(~costs.grid.occupied)
    searcher = GridSearch(costs.grid, costs=costs)
    for _ in range(4):
        start, goal = (tuple(cell.tolist()) for cell in free[rng.integers(len(free), size=2)])
        best = dijkstra(costs, start, goal)
        if best is None:
            with pytest.raises(NoPathFound):
                searcher.search(start, goal)
            continue
        found = searcher.search(start, goal)
        assert found.cost == pytest.approx(best, rel=1e-9, abs=1e-9)
        assert found.length <= found.cost + 1e-9
        zero = searcher.search(start, goal, heuristic="zero")
        assert zero.cost == found.cost


def test_costs_of_zero_change_nothing():
    grid = random_map(40, 60, 0.2, np.random.default_rng(3))
    cells = np.argwhere(~grid.occupied)
    start, goal = tuple(cells[0].tolist()), tuple(cells[-1].tolist())
    plain, costly = search(grid, start, goal), search(grid, start, goal, costs=CostMap.of(grid))
    assert np.array_equal(plain.cells, costly.cells)
    assert plain.cost == costly.cost


def hall():
    """Return a hall of 6 m x 12 m with two pillars."""
    occupied = np.zeros((60, 120), bool)
    occupied[20:30, 40:50] = occupied[30:44, 80:86] = True
    return OccupancyGrid(occupied, 0.1)


def mean_clearance(grid, path):
    points = path.poses(np.linspace(0.0, 1.0, 2001))[:, :2]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return float(np.average(grid.clearance(0.5 * (points[1:] + points[:-1])), weights=steps))


ENDS = Waypoint(0.5, 0.6), Waypoint(11.5, 3.5)


def test_path_keeps_to_the_middle_where_there_is_room():
    grid = hall()
    near = plan(grid, *ENDS, inflation=0.3, options=PathOptions())
    far = plan(grid, *ENDS, inflation=0.3, options=PathOptions(), around_obstacles=Inflation())
    assert mean_clearance(grid, far.spline) > 1.2 * mean_clearance(grid, near.spline)
    assert far.spline.length < 1.06 * near.spline.length
    assert far.clearance > 0.0
    assert far.spline.clearance(far.free_space)[0] > 0.0


def test_smoothing_keeps_the_cost_of_the_search():
    grid = hall()
    strip = np.zeros(grid.occupied.shape, np.float32)
    strip[:52] = 3.0  # only the upper edge is cheap
    found = plan(
        grid, *ENDS, inflation=0.3, options=PathOptions(), costs=CostMap.of(grid).with_costs(strip)
    )
    points = found.spline.poses(np.linspace(0.0, 1.0, 4001))[:, :2]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    row, col = grid.cells_of(0.5 * (points[1:] + points[:-1])).T
    cost = float((steps * (1.0 + strip[row, col])).sum())
    assert cost < 1.05 * found.search_result.cost * grid.resolution


def test_lanes_are_taken_along_their_direction():
    grid = OccupancyGrid(np.zeros((40, 80), bool), 0.1)
    low, high = [(1.0, 0.0), (7.0, 0.0), (7.0, 2.0), (1.0, 2.0)], [
        (1.0, 2.0), (7.0, 2.0), (7.0, 4.0), (1.0, 4.0),
    ]  # fmt: skip
    costs = CostMap.of(grid).with_lanes([Lane(low, 0.0), Lane(high, np.pi)])
    there = plan(grid, Waypoint(0.5, 2.0), Waypoint(7.5, 2.0), inflation=0.0,
                 options=PathOptions(), costs=costs)  # fmt: skip
    back = plan(grid, Waypoint(7.5, 2.0), Waypoint(0.5, 2.0), inflation=0.0,
                options=PathOptions(), costs=costs)  # fmt: skip
    middle = np.linspace(0.2, 0.8, 50)
    assert (there.spline.poses(middle)[:, 1] < 2.05).all()
    assert (back.spline.poses(middle)[:, 1] > 1.95).all()


@pytest.mark.parametrize("seed", range(6))
def test_planner_after_changes_equals_a_new_one(seed):
    rng = np.random.default_rng(seed)
    grid = replace(rooms_map(70, 90, 15, rng), resolution=0.1)
    layers = CostMap.of(grid).with_costs(rng.random(grid.occupied.shape))
    around = Inflation(radius=rng.choice([0.3, 1.0]), scaling=2.0, weight=3.0)
    settings = {"inflation": 0.15, "costs": layers if seed % 2 else None,
                "around_obstacles": around if seed % 3 else None}  # fmt: skip
    planner = Planner(grid, **settings)
    for _ in range(3):
        cells = rng.integers((0, 0), grid.occupied.shape, (5, 2))
        planner.update(cells, rng.random(5) < 0.5)
    fresh = Planner(planner.grid, **settings)
    assert np.array_equal(planner.free_space.occupied, fresh.free_space.occupied)
    if fresh.costs is not None:
        assert np.array_equal(planner.costs.costs, fresh.costs.costs)
    free = np.argwhere(~fresh.free_space.occupied)
    start, goal = (Waypoint(*grid.centre(*cell)) for cell in free[rng.integers(len(free), size=2)])
    try:
        expected = fresh.plan(start, goal)
    except NoPathFound:
        with pytest.raises(NoPathFound):
            planner.plan(start, goal)
        return
    found = planner.plan(start, goal)
    assert np.array_equal(found.spline.control_points, expected.spline.control_points)


def test_planner_takes_changed_cells():
    grid = hall()
    planner = Planner(grid, inflation=0.3)
    before = planner.plan(*ENDS)
    wall = np.argwhere(np.ones((60, 3))) + np.array([0, 60])
    planner.update(wall, True)
    with pytest.raises(NoPathFound):
        planner.plan(*ENDS)
    planner.update(wall, False)
    after = planner.plan(*ENDS)
    assert np.array_equal(before.spline.control_points, after.spline.control_points)
    with pytest.raises(InvalidInput, match="outside the map of"):
        planner.update(np.array([[60, 0]]), True)


def test_bad_costs_are_refused():
    grid = hall()
    shape = grid.occupied.shape
    with pytest.raises(InvalidInput, match=r"shape \(3, 4\)"):
        CostMap(grid, np.zeros((3, 4), np.float32))
    for value in (-1.0, np.nan, np.inf, 251.0):
        with pytest.raises(InvalidInput, match="7200 costs are not numbers from 0 to 250"):
            CostMap(grid, np.full(shape, value, np.float32))
    two = "costs are not numbers.*; a largest speed is not a positive number"
    with pytest.raises(InvalidInput, match=two):
        CostMap(grid, np.full(shape, -1.0, np.float32), np.zeros(shape, np.float32))
    costs = CostMap.of(grid)
    for bad in (Inflation(radius=-1.0), Inflation(scaling=np.nan), Inflation(weight=251.0)):
        with pytest.raises(InvalidInput, match="inflation"):
            costs.with_inflation(0.3, bad)
    with pytest.raises(InvalidInput, match="heading of a lane"):
        costs.with_lanes([Lane([(0, 0), (1, 0), (0, 1)], np.nan)])
    with pytest.raises(InvalidInput, match="same cost"):
        costs.with_lanes([Lane([(0, 0), (1, 0), (0, 1)], 0.0, c) for c in (1.0, 2.0)])
    with pytest.raises(InvalidInput, match="the map"):
        plan(grid, *ENDS, inflation=0.3, options=PathOptions(),
             costs=CostMap.of(OccupancyGrid(np.zeros((3, 4), bool), 0.1)))  # fmt: skip
    with pytest.raises(InvalidInput, match="jump-point does not support costs"):
        search(grid, (0, 0), (5, 5), method="jump-point",
               costs=costs.with_inflation(0.0))  # fmt: skip
